#include "libmap/scan/rig_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "libmap/camera/image_codec.h"
#include "tests/support/test_support.h"

namespace rig_images_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using libmap::fullest_synchronized_set;
using libmap::RigImage;
using libmap::SynchronizedSet;
using State = libmap::SynchronizedSet::Camera::State;

libmap::CameraRig rig_of(const std::vector<std::string>& names) {
  libmap::CameraRig rig;
  for (const std::string& name : names) {
    libmap::RigCamera camera;
    camera.name = name;
    camera.camera.width = 4;
    camera.camera.height = 3;
    camera.camera.fx = camera.camera.fy = 4;
    rig.cameras.push_back(camera);
  }
  return rig;
}

void touch(const fs::path& path) {
  fs::create_directories(path.parent_path());
  write_text(path, "");
}

TEST(RigImages, FoldersByCameraThenStamp) {
  const fs::path folder = scratch_folder() / "run";
  touch(folder / libmap::rig_image_name("right", 100.25));
  touch(folder / "left" / "20.5.png");
  touch(folder / "left" / "3.PNG");
  touch(folder / "left" / "notes.txt");
  touch(folder / "left" / ".hidden.png");
  touch(folder / "stranger" / "1.png");
  const auto images = list_rig_images(folder, rig_of({"right", "left", "absent"}));
  ASSERT_EQ(images.size(), 3U);
  EXPECT_EQ(images[0].camera, 0U);
  EXPECT_EQ(images[0].stamp_s, 100.25);
  EXPECT_EQ(images[0].file, folder / "right" / "100.250000.png");
  EXPECT_EQ(images[1].stamp_s, 3.0);
  EXPECT_EQ(images[2].stamp_s, 20.5);
}

TEST(RigImages, TableStandsAboveFolders) {
  const fs::path folder = scratch_folder() / "run";
  touch(folder / "left" / "1.png");
  write_text(folder / "images.csv",
             "file,camera,stamp_s\npictures/b.png,left,2.5\n/data/a.png,left,1e1\n");
  const auto images = list_rig_images(folder, rig_of({"left"}));
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[0].file, folder / "pictures/b.png");
  EXPECT_EQ(images[1].file, "/data/a.png");
  EXPECT_EQ(images[1].stamp_s, 10.0);
  write_text(folder / "images.csv", "file,camera,stamp_s\nb.png,lfet,2.5\n");
  EXPECT_TRUE(is_error(error_of([&] { list_rig_images(folder, rig_of({"left"})); }),
                       {.field = "camera", .value = "lfet", .about = "'left'"}));
  write_text(folder / "images.csv", "file,camera,stamp_s\nb.png,left,nan\n");
  EXPECT_TRUE(is_error(error_of([&] { list_rig_images(folder, rig_of({"left"})); }),
                       {.field = "stamp_s", .value = "nan"}));
}

TEST(RigImages, BadFoldersAreNamed) {
  const auto said = [](const fs::path& folder) {
    return error_of([&] { list_rig_images(folder, rig_of({"left"})); });
  };
  EXPECT_TRUE(is_error(said(scratch_folder() / "none"), {.file = "none"}));
  touch(scratch_folder() / "file");
  EXPECT_TRUE(is_error(said(scratch_folder() / "file"), {.file = "file"}));
  fs::create_directories(scratch_folder() / "empty" / "left");
  EXPECT_TRUE(is_error(said(scratch_folder() / "empty"), {.file = "empty"}));
  touch(scratch_folder() / "odd" / "left" / "first.png");
  EXPECT_TRUE(is_error(said(scratch_folder() / "odd"), {.field = "name", .value = "first"}));
}

std::vector<RigImage> images_at(const std::vector<std::vector<double>>& stamps) {
  std::vector<RigImage> images;
  for (std::size_t camera = 0; camera < stamps.size(); ++camera)
    for (const double stamp : stamps[camera]) images.push_back({camera, stamp, {}});
  return images;
}

TEST(SynchronizedSets, SeenLateAndMissing) {
  const auto images = images_at({{1.0, 2.0}, {1.95, 2.04}, {2.0201}, {}, {0.5}});
  const SynchronizedSet set = synchronized_set_at(images, 5, 2.0, 0.02);
  ASSERT_EQ(set.cameras.size(), 5U);
  EXPECT_EQ(set.seen(), 1U);
  EXPECT_EQ(set.cameras[0].state, State::seen);
  EXPECT_EQ(set.cameras[0].image, 1U);
  EXPECT_EQ(set.cameras[1].state, State::late);
  EXPECT_NEAR(set.cameras[1].offset_s, 0.04, 1e-12);
  EXPECT_EQ(set.cameras[2].state, State::late);
  EXPECT_EQ(set.cameras[3].state, State::missing);
  EXPECT_NEAR(set.cameras[4].offset_s, -1.5, 1e-12);
  EXPECT_EQ(synchronized_set_at(images, 5, 2.0, 0.05).seen(), 3U);
}

TEST(SynchronizedSets, ToleranceHoldsItsBound) {
  // 0.1 + 0.02 - 0.1 is a little more than 0.02 in binary.
  EXPECT_EQ(synchronized_set_at(images_at({{0.12}}), 1, 0.1, 0.02).seen(), 1U);
  EXPECT_EQ(synchronized_set_at(images_at({{0.12001}}), 1, 0.1, 0.02).seen(), 0U);
}

TEST(SynchronizedSets, FullestThenTightestThenEarliest) {
  // Three cameras at 2, three more closely at 3 and 4; two at 1.
  const auto images =
      images_at({{1.0, 2.00, 3.000, 4.000}, {1.0, 2.01, 3.001, 4.001}, {2.01, 3.001, 4.001}});
  const SynchronizedSet set = fullest_synchronized_set(images, 3, 0.02);
  EXPECT_EQ(set.seen(), 3U);
  EXPECT_EQ(set.stamp_s, 3.001);
  // Oracle: no other stamp of an image has more cameras.
  for (const RigImage& image : images)
    EXPECT_LE(synchronized_set_at(images, 3, image.stamp_s, 0.02).seen(), 3U);
  EXPECT_TRUE(
      is_error(error_of([&] { fullest_synchronized_set({}, 3, 0.02); }), {.field = "images"}));
}

TEST(SynchronizedSets, FullestAgreesWithLookingAtEveryStamp) {
  for (int round = 0; round < 200; ++round) {
    std::vector<RigImage> images;
    // Stamps of several images, and ties on both sides.
    for (int n = 0; n < 40; ++n)
      images.push_back({static_cast<std::size_t>(graspmap_test::uniform(0, 3.99)),
                        0.25 * std::floor(graspmap_test::uniform(0, 60)),
                        {}});
    std::set<double> stamps;
    for (const RigImage& image : images) stamps.insert(image.stamp_s);
    SynchronizedSet best;
    double least = HUGE_VAL;
    for (const double stamp : stamps) {
      const SynchronizedSet set = synchronized_set_at(images, 4, stamp, 0.5);
      double sum = 0.0;
      for (const SynchronizedSet::Camera& camera : set.cameras)
        sum += camera.state == State::seen ? std::abs(camera.offset_s) : 0.0;
      if (!best.cameras.empty() && set.seen() < best.seen()) continue;
      if (!best.cameras.empty() && set.seen() == best.seen() && sum >= least) continue;
      best = set;
      least = sum;
    }
    const SynchronizedSet found = fullest_synchronized_set(images, 4, 0.5);
    EXPECT_EQ(found.stamp_s, best.stamp_s);
    for (std::size_t camera = 0; camera < 4; ++camera) {
      EXPECT_EQ(found.cameras[camera].state, best.cameras[camera].state);
      EXPECT_EQ(found.cameras[camera].image, best.cameras[camera].image);
    }
  }
}

// As many images as a bag of 100 kB can contain, all within the tolerance: cubic time would take
// minutes.
TEST(SynchronizedSets, OfVeryManyImagesOfOneMoment) {
  std::vector<RigImage> images;
  for (std::size_t n = 0; n < 3'000; ++n)
    images.push_back({n % 2, 1e-6 * static_cast<double>(n), {}});
  EXPECT_EQ(libmap::synchronized_sets(images, 2, 0.02).size(), 1'500U);
  EXPECT_EQ(fullest_synchronized_set(images, 2, 0.02).seen(), 2U);
}

TEST(RigDepth, UnitsBecomeMeters) {
  libmap::Image<std::uint16_t> units(4, 3);
  units.at(1, 2) = 4000;
  units.at(2, 0) = 65535;
  units.at(3, 0) = 65534;
  const fs::path file = scratch_folder() / "1.png";
  write_text(file, libmap::encode_png(units));
  libmap::RigCamera camera = rig_of({"front"}).cameras[0];
  camera.depth_scale_m = 0.00025;
  const libmap::DepthImage depth = read_rig_depth({0, 1.0, file}, camera);
  EXPECT_FLOAT_EQ(depth.at(1, 2), 1.0F);
  EXPECT_EQ(depth.at(2, 0), 0.0F);
  EXPECT_FLOAT_EQ(depth.at(3, 0), 16.3835F);
  camera.camera.width = 5;
  EXPECT_TRUE(is_error(error_of([&] {
                         read_rig_depth({0, 1.0, file}, camera);
                       }),
                       {.file = graspmap_test::scratch_folder() / "1.png",
                        .field = "image size",
                        .value = "4 x 3",
                        .bound = "5 x 3"}));
  write_text(file, libmap::encode_png(libmap::GrayImage(4, 3)));
  EXPECT_TRUE(is_error(
      error_of([&] {
        read_rig_depth({0, 1.0, file}, camera);
      }),
      {.file = graspmap_test::scratch_folder() / "1.png", .value = "PNG of 1 x 8 bits per pixel"}));
  write_text(file, "");
  EXPECT_TRUE(is_error(error_of([&] {
                         read_rig_depth({0, 1.0, file}, camera);
                       }),
                       {.file = file, .field = "image", .bound = "JPEG or PNG"}));
}

TEST(SynchronizedSets, EachImageIsInOneMoment) {
  std::vector<RigImage> images;
  for (std::size_t camera = 0; camera < 4; ++camera)
    for (int n = 0; n < 60; ++n)
      images.push_back({camera, 0.1 * n + graspmap_test::uniform(0, 0.05), {}});
  // Images in any order, some of them missing.
  std::shuffle(images.begin(), images.end(), graspmap_test::random_engine());
  images.resize(200);
  for (const double tolerance : {0.0, 0.02, 0.05, 1.0}) {
    std::vector<int> times(images.size(), 0);
    double last = -1.0;
    for (const SynchronizedSet& set : libmap::synchronized_sets(images, 4, tolerance)) {
      double first = 1e9;
      for (std::size_t camera = 0; camera < 4; ++camera) {
        const SynchronizedSet::Camera& one = set.cameras[camera];
        if (one.state != State::seen) continue;
        const RigImage& image = images[one.image];
        EXPECT_EQ(image.camera, camera);
        EXPECT_NEAR(image.stamp_s, set.stamp_s, tolerance + 1e-5);
        EXPECT_EQ(one.offset_s, image.stamp_s - set.stamp_s);
        first = std::min(first, image.stamp_s);
        ++times[one.image];
      }
      EXPECT_GE(first, last);
      last = first;
    }
    EXPECT_THAT(times, testing::Each(1));
  }
  EXPECT_EQ(libmap::synchronized_sets(images, 4, 0.05).size(), 60U);
  EXPECT_TRUE(libmap::synchronized_sets({}, 4, 0.05).empty());
}

}  // namespace rig_images_test
