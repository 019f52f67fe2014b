#include "libmap/bag/bag_rig.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "libmap/bag/depth_message.h"
#include "libmap/camera/image_codec.h"
#include "tests/libmap/bag/bag_samples.h"
#include "tests/support/test_support.h"

namespace bag_rig_test {

namespace fs = std::filesystem;
namespace rm = graspmap_test::rm;
using graspmap_test::bytes_of;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::is_error_text;
using graspmap_test::sample_depth;
using graspmap_test::sample_header;
using graspmap_test::sample_image;
using graspmap_test::sample_info;
using graspmap_test::SampleBag;
using graspmap_test::scratch_folder;
using libmap::BagRigOptions;
using libmap::BagRigPlan;
using libmap::make_pose_from_rpy;
using libmap::Pose;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

fs::path bag_path() { return scratch_folder() / "a.bag"; }

BagRigPlan plan(const BagRigOptions& options = {},
                const std::optional<double>& stamp_s = std::nullopt) {
  return libmap::plan_bag_rig(bag_path(), options, stamp_s);
}

libmap::Error refusal(const BagRigOptions& options = {}) {
  return error_of([&] { plan(options); });
}

// Written images of one camera in the order of their stamps.
std::vector<std::vector<std::uint16_t>> images_of(const BagRigPlan& plan,
                                                  const std::string& camera) {
  const fs::path folder = scratch_folder() / "rig";
  fs::create_directory(folder);
  libmap::export_bag_rig(bag_path(), plan, folder);
  const libmap::CameraRig rig = libmap::read_rig(folder / "rig.yaml");
  std::vector<std::vector<std::uint16_t>> images;
  for (const libmap::RigImage& image : libmap::list_rig_images(folder, rig))
    if (rig.cameras[image.camera].name == camera)
      images.push_back(libmap::read_rig_units(image, rig.cameras[image.camera]).pixels);
  return images;
}

// A camera with calibration and frame, but without images.
void add_surroundings(SampleBag& bag, const std::string& name) {
  bag.transform("base_link", name + "_optical", Pose::Identity());
  bag.write("/" + name + "/camera_info", 1.0, sample_info(name + "_optical", 1.0));
}

TEST(BagRig, CamerasOfInfosAndTransforms) {
  const Pose mast = make_pose_from_rpy({0, 0, 0.3}, {5, -10, 90});
  const Pose front = make_pose_from_rpy({0.2, 0, 0}, {-90, 0, -90});
  SampleBag bag(bag_path());
  bag.transform("mast", "front_optical", front).transform("base_link", "mast", mast);
  bag.transform("base_link", "rear_optical", front.inverse());
  bag.transform("map", "base_link", mast);
  bag.camera("/front", {5.0}).camera("/rear", {5.01});
  // Color images are not depth images.
  bag.write("/front/color/image_raw", 5.0, sample_image("front_optical", 5.0, "rgb8", 1, 1, "abc"));
  bag.close();
  const BagRigPlan result = plan();
  ASSERT_EQ(result.rig.cameras.size(), 2U);
  EXPECT_THAT(result.topics, ElementsAre("/front/image_raw", "/rear/image_raw"));
  EXPECT_EQ(result.rig.cameras[0].name, "front");
  EXPECT_EQ(result.rig.cameras[0].camera.width, 4);
  EXPECT_EQ(result.rig.cameras[0].camera.fy, 6);
  EXPECT_EQ(result.rig.cameras[0].camera.cy, 1.25);
  EXPECT_EQ(result.rig.cameras[0].depth_scale_m, 0.001);
  EXPECT_TRUE(result.rig.cameras[0].camera.base_from_camera.isApprox(mast * front, 1e-12));
  EXPECT_TRUE(result.rig.cameras[1].camera.base_from_camera.isApprox(front.inverse(), 1e-12));
  EXPECT_THAT(images_of(result, "rear"),
              ElementsAre(ElementsAre(1000, 1001, 1002, 1003, 1004, 1005, 1006, 1007, 1008, 1009,
                                      1010, 1011)));
  const BagRigPlan on_mast = plan({.base_frame = "mast"});
  EXPECT_TRUE(on_mast.rig.cameras[0].camera.base_from_camera.isApprox(front, 1e-12));
}

TEST(BagRig, EncodingsOfDepth) {
  SampleBag bag(bag_path());
  add_surroundings(bag, "a");
  // Two bytes after each row, the other byte order.
  std::string padded;
  for (int row = 0; row < 3; ++row)
    padded +=
        bytes_of(std::vector<std::uint16_t>(4, static_cast<std::uint16_t>(300 + row)), true) + "xx";
  rm::Image image = sample_image("a_optical", 2.0, "16UC1", 4, 3, padded);
  image.is_bigendian = 1;
  bag.write("/a/image_raw", 2.0, image);
  const std::vector<float> meters = {1.5F,    nan,     infinity, -1,   0,    0.00014F,
                                     6.5534F, 6.5536F, 70,       0.1F, 0.2F, 0.3F};
  bag.write("/a/image_raw", 3.0, sample_image("a_optical", 3.0, "32FC1", 4, 3, bytes_of(meters)));
  bag.write("/a/image_raw", 4.0,
            sample_image("a_optical", 4.0, "mono16", 4, 3,
                         bytes_of(std::vector<std::uint16_t>(12, 65535))));
  bag.close();
  const BagRigPlan fine = plan({.depth_scale_m = 0.0001});
  EXPECT_THAT(
      images_of(fine, "a"),
      ElementsAre(
          ElementsAre(3000, 3000, 3000, 3000, 3010, 3010, 3010, 3010, 3020, 3020, 3020, 3020),
          ElementsAre(15000, 0, 0, 0, 0, 1, 65534, 0, 0, 1000, 2000, 3000), testing::Each(65535)));
  EXPECT_EQ(libmap::export_bag_rig(bag_path(), fine, {}).overflow_pixels, 2U);
  // Units of the bag's 16-bit images other than millimeters are kept.
  EXPECT_EQ(images_of(plan({.depth_unit_m = 0.00025}), "a")[0][0], 300);
}

rm::CompressedImage compressed(const std::string& format, double stamp_s, float a, float b,
                               const std::vector<std::uint16_t>& values) {
  rm::CompressedImage image;
  image.header = sample_header("a_optical", stamp_s);
  image.format = rm::to_ros(format);
  libmap::Image<std::uint16_t> pixels(4, 3);
  pixels.pixels = values;
  const std::string bytes = bytes_of(std::vector<std::int32_t>{0}) +
                            bytes_of(std::vector<float>{a, b}) + libmap::encode_png(pixels);
  image.data.assign(bytes.begin(), bytes.end());
  return image;
}

TEST(BagRig, CompressedDepth) {
  const std::string topic = "/a/image_raw/compressedDepth";
  std::vector<std::uint16_t> values(12, 900);
  values[1] = 0;
  {
    SampleBag bag(bag_path());
    add_surroundings(bag, "a");
    bag.write(topic, 2.0, compressed("16UC1; compressedDepth png", 2.0, 0, 0, values));
    // Inverse depth: d = a / (value - b).
    bag.write(topic, 3.0, compressed("32FC1; compressedDepth", 3.0, 1800.0F, 100.0F, values));
    bag.write(topic, 4.0, compressed("16UC1; compressedDepth rvl", 4.0, 0, 0, values));
    bag.close();
  }
  const BagRigPlan result = plan();
  const auto images = images_of(result, "a");
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[0], values);
  EXPECT_EQ(images[1][0], 2250);  // mm
  EXPECT_EQ(images[1][1], 0);
  EXPECT_THAT(libmap::export_bag_rig(bag_path(), result, {}).warnings,
              ElementsAre(HasSubstr("PNG")));
  // Compressed images are redundant if there are raw ones.
  SampleBag bag(bag_path());
  bag.transform("base_link", "a_optical", Pose::Identity()).camera("/a", {2.0});
  bag.write(topic, 2.0, compressed("16UC1; compressedDepth", 2.0, 0, 0, values));
  bag.close();
  EXPECT_THAT(plan().topics, ElementsAre("/a/image_raw"));
  EXPECT_THAT(plan({.topics = {topic}}).topics, ElementsAre(topic));
}

TEST(BagRig, CalibrationsOfAllKinds) {
  const auto camera_of = [](const rm::CameraInfo& info, bool rectified) {
    return libmap::decode_camera_info(libmap::MessageEncoding::ros1, rm::serialized(info),
                                      rectified)
        .camera;
  };
  rm::CameraInfo info = sample_info("a", 1.0);
  info.D = {0.1, 0.02, 0.001, 0.002, 0.3};
  EXPECT_EQ(camera_of(info, false).distortion_model, libmap::DistortionModel::radial_tangential);
  EXPECT_THAT(camera_of(info, false).distortion, ElementsAre(0.1, 0.02, 0.001, 0.002, 0.3));
  EXPECT_FALSE(camera_of(info, true).is_distorted());
  EXPECT_EQ(camera_of(info, true).fx, 7);
  EXPECT_EQ(camera_of(info, true).cx, 1.75);
  info.distortion_model = rm::to_ros("magic");
  EXPECT_TRUE(is_error(error_of([&] { camera_of(info, false); }),
                       {.field = "distortion_model", .value = "magic"}));
  info.D = {0.1, 0.02, 0.001, 0.002};
  info.distortion_model = rm::to_ros("equidistant");
  EXPECT_EQ(camera_of(info, false).distortion_model, libmap::DistortionModel::equidistant);
  info.D = {0, 0, 0, 0, 0};
  EXPECT_FALSE(camera_of(info, false).is_distorted());
  // The central 400 x 200 of 640 x 480 pixels with a binning of 2 x 2.
  info.width = 640;
  info.height = 480;
  info.K = {500, 0, 320, 0, 600, 240, 0, 0, 1};
  info.binning_x = info.binning_y = 2;
  info.roi.x_offset = 120;
  info.roi.y_offset = 140;
  info.roi.width = 400;
  info.roi.height = 200;
  const libmap::Camera part = camera_of(info, false);
  EXPECT_EQ(part.width, 200);
  EXPECT_EQ(part.height, 100);
  EXPECT_EQ(part.fx, 250);
  EXPECT_EQ(part.cx, 100);
  EXPECT_EQ(part.cy, 50);
  info.K = {};
  EXPECT_TRUE(is_error(error_of([&] { camera_of(info, false); }),
                       {.field = "fx", .value = "0", .bound = "1e-06 to 1e+09"}));
}

// The name of a topic decides if its images are rectified: "direct" does not count.
TEST(BagRig, RectifiedImagesAreToldByTheirName) {
  rm::CameraInfo info = sample_info("o", 5.0);
  info.D = {0.1, 0.02, 0.001, 0.002, 0.3};
  for (const auto& [name, distorted] :
       std::map<std::string, bool>{{"/direct/image_raw", true},
                                   {"/d/image_rect_raw", false},
                                   {"/d/image_rect", false},
                                   {"/rect/image_rectangle", true}}) {
    const std::string folder = name.substr(0, name.rfind('/'));
    SampleBag bag(bag_path());
    bag.write(name, 5.0, sample_depth("o", 5.0));
    bag.write(folder + "/camera_info", 5.0, info);
    bag.transform("base_link", "o", Pose::Identity());
    bag.close();
    EXPECT_EQ(plan().rig.cameras[0].camera.is_distorted(), distorted) << name;
  }
}

TEST(BagRig, SetsAreChosen) {
  SampleBag bag(bag_path());
  bag.transform("base_link", "a_optical", Pose::Identity());
  bag.transform("base_link", "b_optical", Pose::Identity());
  bag.camera("/a", {5.0, 5.1, 5.2, 5.3, 5.4}).camera("/b", {5.012, 5.111, 5.3, 5.405}).close();
  const BagRigPlan all = plan();
  ASSERT_EQ(all.sets.size(), 5U);
  EXPECT_EQ(all.sets[0].seen(), 2U);
  EXPECT_EQ(all.sets[2].seen(), 1U);  // b has no image in this set
  EXPECT_EQ(all.images.size(), 9U);
  const BagRigPlan second = plan({.every = 2});
  EXPECT_EQ(second.images.size(), 5U);
  EXPECT_EQ(second.sets_in_bag, 5U);
  EXPECT_EQ(images_of(second, "a").size(), 3U);
  EXPECT_THAT(graspmap_test::read_text(scratch_folder() / "rig" / "synchronized_sets.csv"),
              HasSubstr("stamp_s,cameras,spread_s\n5.000000,2,0.012000\n5.200000,1,0.000000\n"));
  const BagRigPlan one = plan({}, 5.28);
  ASSERT_EQ(one.sets.size(), 1U);
  EXPECT_NEAR(one.sets[0].stamp_s, 5.3, 1e-9);
  EXPECT_EQ(plan({.tolerance_s = 0.001}).sets.size(), 8U);
}

TEST(BagRig, OddStampsAndCalibrationsAreLeftOut) {
  SampleBag bag(bag_path());
  bag.transform("base_link", "a_optical", Pose::Identity());
  bag.camera("/a", {5.0, 5.1});
  bag.write("/a/image_raw", 5.2, sample_depth("a_optical", 5.1));  // the same stamp
  bag.write("/a/image_raw", 5.3, sample_depth("a_optical", 0.0));  // no stamp
  rm::CameraInfo info = sample_info("a_optical", 6.0);
  info.K[0] = 5.5;
  bag.write("/a/camera_info", 6.0, info);
  bag.write("/a/image_raw", 6.0, sample_depth("a_optical", 6.0));
  bag.close();
  const BagRigPlan result = plan();
  ASSERT_EQ(result.images.size(), 3U);
  EXPECT_EQ(result.images[2].stamp_ns, 5300000000);
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("1 images are dropped because an earlier"),
                                           HasSubstr("1 images are dropped because the cal"),
                                           HasSubstr("no stamp")));
  for (const std::string& warning : result.warnings)
    EXPECT_TRUE(is_error_text(warning, {.field = "/a/image_raw"}));
}

TEST(BagRig, BrokenImagesAreCountedAndLeftOut) {
  SampleBag bag(bag_path());
  bag.transform("base_link", "a_optical", Pose::Identity()).camera("/a", {5.0});
  const auto add = [&](double stamp, const auto& change) {
    rm::Image image = sample_depth("a_optical", stamp);
    change(image);
    bag.write("/a/image_raw", stamp, image);
  };
  add(6, [](rm::Image& image) { image.data.resize(23); });
  add(7, [](rm::Image& image) { image.step = 7; });
  add(8, [](rm::Image& image) { image.width = 0; });
  add(9, [](rm::Image& image) { image.width = image.height = 0xffffffff; });
  add(10, [](rm::Image& image) { image.height = 0x40000000; });
  add(11, [](rm::Image& image) { image.encoding = rm::to_ros("bgr8"); });
  add(12, [](rm::Image& image) { image.height = 2; });
  add(13, [](rm::Image& image) { image.step = 0xffffffff; });
  bag.close();
  const libmap::BagRigExport result = libmap::export_bag_rig(bag_path(), plan(), {});
  EXPECT_EQ(result.images, 1U);
  EXPECT_EQ(result.undecodable_images, 8U);
  ASSERT_EQ(result.warnings.size(), 1U);
  EXPECT_TRUE(is_error_text(result.warnings[0], {.field = "/a/image_raw", .about = "8 images"}));
  EXPECT_THAT(result.warnings[0], HasSubstr("23 bytes"));
  // A set without usable images is dropped.
  ASSERT_EQ(result.sets.size(), 1U);
  EXPECT_EQ(result.sets[0].stamp_s, 5.0);
}

TEST(BagRig, ABagWithoutAnImageThatCanBeUsedIsAnError) {
  const auto write = [](const auto& change) {
    SampleBag bag(bag_path());
    rm::Image image = sample_depth("a_optical", 5.0);
    change(image);
    add_surroundings(bag, "a");
    bag.write("/a/image_raw", 5.0, image).close();
  };
  write([](rm::Image& image) { image.data.resize(23); });
  const BagRigPlan broken = plan();
  const auto said = [&] {
    return error_of([&] { libmap::export_bag_rig(bag_path(), broken, {}); });
  };
  EXPECT_TRUE(is_error(said(), {.file = bag_path(), .about = "data is 23 bytes"}));
  // The bag has changed.
  write([](rm::Image& image) { image.header.stamp = ros::Time(7.0); });
  EXPECT_TRUE(is_error(said(), {.file = bag_path()}));
  // A compressed image with fewer bytes than the header before the PNG.
  rm::CompressedImage image;
  image.header = sample_header("a_optical", 5.0);
  image.format = rm::to_ros("16UC1; compressedDepth png");
  image.data.resize(11);
  SampleBag bag(bag_path());
  add_surroundings(bag, "a");
  bag.write("/a/image_raw/compressedDepth", 5.0, image).close();
  EXPECT_TRUE(is_error(error_of([&] { libmap::export_bag_rig(bag_path(), plan(), {}); }),
                       {.file = bag_path(), .about = "data is 11 bytes"}));
}

TEST(BagRig, RigOfOnesOwn) {
  SampleBag(bag_path())
      .write("/robot/left_cam/depth", 5.0, sample_depth("l", 5.0))
      .write("/robot/other/depth", 5.0, sample_depth("o", 5.0))
      .close();
  libmap::CameraRig rig;
  for (const char* name : {"other", "left", "spare"}) {
    libmap::RigCamera camera;
    camera.name = name;
    camera.camera.width = 4;
    camera.camera.height = 3;
    camera.camera.fx = camera.camera.fy = 4;
    camera.depth_scale_m = 0.0005;
    camera.near_m = 0.28;
    rig.cameras.push_back(camera);
  }
  BagRigOptions options{.rig = rig};
  EXPECT_TRUE(is_error(refusal(options), {.field = "topic", .value = "/robot/left_cam/depth"}));
  EXPECT_TRUE(is_error(refusal(options), {.field = "topic", .value = "/robot/left_cam/depth"}));
  options.topics = {"left=/robot/left_cam/depth", "/robot/other/depth"};
  const BagRigPlan result = plan(options);
  EXPECT_THAT(result.topics, ElementsAre("/robot/other/depth", "/robot/left_cam/depth", ""));
  EXPECT_EQ(result.rig.cameras[1].near_m, 0.28);
  EXPECT_EQ(images_of(result, "left")[0][0], 2000);
  options.topics = {"left=/robot/left_cam/depth", "left=/robot/other/depth"};
  EXPECT_TRUE(is_error(refusal(options), {.field = "topic", .value = "/robot/other/depth"}));
  options.topics = {"left=/robot/left_cam/depth", "other=/robot/left_cam/depth"};
  EXPECT_TRUE(is_error(refusal(options), {.field = "topic", .value = "/robot/left_cam/depth"}));
  options.topics = {"lfet=/robot/left_cam/depth"};
  EXPECT_TRUE(is_error(refusal(options),
                       {.field = "topic", .value = "/robot/left_cam/depth", .about = "'left'"}));
}

TEST(BagRig, WhatIsMissingIsNamed) {
  const auto bag = [](const auto& fill) {
    SampleBag made(bag_path());
    fill(made);
    made.close();
  };
  bag([](SampleBag& made) { made.transform("a", "b", Pose::Identity()); });
  EXPECT_TRUE(is_error(refusal(), {.file = graspmap_test::scratch_folder() / "a.bag",
                                   .field = "topics of images",
                                   .value = "none"}));
  bag([](SampleBag& made) {
    made.write("/a/color", 1.0, sample_image("a", 1.0, "rgb8", 1, 1, "abc"));
  });
  EXPECT_TRUE(is_error(refusal(), {.field = "topics of images", .value = "/a/color rgb8"}));
  EXPECT_TRUE(is_error(refusal({.topics = {"/a/color"}}),
                       {.field = "encoding of /a/color", .value = "rgb8"}));
  EXPECT_TRUE(is_error(
      refusal({.topics = {"/a/colr"}}),
      {.field = "topic", .value = "/a/colr", .bound = "one of /a/color", .about = "'/a/color'"}));
  bag([](SampleBag& made) { made.write("/a/image_raw", 1.0, sample_depth("a", 1.0)); });
  EXPECT_TRUE(is_error(refusal(), {.field = "topic", .value = "/tf_static"}));
  bag([](SampleBag& made) {
    made.write("/a/image_raw", 1.0, sample_depth("a", 1.0));
    made.transform("base_link", "a", Pose::Identity());
  });
  EXPECT_TRUE(is_error(refusal(), {.field = "/a/image_raw: topic", .value = "/a/camera_info"}));
  bag([](SampleBag& made) {
    rm::Image image = sample_depth("a_optical", 1.0);
    image.header.seq = 7;  // read as a number of transforms, it would be too large
    made.write("/a/image_raw", 1.0, image);
  });
  EXPECT_TRUE(
      is_error(refusal({.transform_topic = "/a/image_raw"}), {.field = "type of /a/image_raw",
                                                              .value = "sensor_msgs/Image",
                                                              .bound = "tf2_msgs/TFMessage"}));
  bag([](SampleBag& made) {
    made.camera("/a", {1.0}).transform("base_link", "a_optcal", Pose::Identity());
  });
  EXPECT_TRUE(is_error(
      refusal(), {.field = "/a/image_raw: frame", .value = "a_optical", .about = "'a_optcal'"}));
  bag([](SampleBag& made) {
    made.camera("/a", {1.0}).transform("a_optical", "b", Pose::Identity());
    made.transform("b", "a_optical", Pose::Identity());
  });
  EXPECT_TRUE(is_error(refusal(), {.field = "frame", .value = "a_optical"}));
  bag([](SampleBag& made) {
    rm::CameraInfo info = sample_info("a_optical", 1.0);
    info.K = {};
    made.write("/a/image_raw", 1.0, sample_depth("a_optical", 1.0));
    made.write("/a/camera_info", 1.0, info).transform("x", "a_optical", Pose::Identity());
  });
  EXPECT_TRUE(is_error(refusal(), {.field = "/a/image_raw: /a/camera_info"}));
  bag([](SampleBag& made) {
    rm::TFMessage message;
    message.transforms.resize(1);
    message.transforms[0].header = sample_header("base", 1.0);
    message.transforms[0].child_frame_id = rm::to_ros("a_optical");
    made.camera("/a", {1.0}).write("/tf_static", 1.0, message);
  });
  EXPECT_TRUE(is_error(refusal(), {.field = "/tf_static: quaternion of frame a_optical"}));
}

}  // namespace bag_rig_test
