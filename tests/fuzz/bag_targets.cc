// Bags of ROS 1, and the messages in them.
#include "libmap/image/image_codec.h"
#include "libmap/ros/bag_cloud.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/ros/bag_rig.h"
#include "libmap/ros/cloud_message.h"
#include "libmap/ros/depth_message.h"
#include "libmap/ros/message_encoding.h"
#include "libmap/ros/transform_message.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"
#include "tests/libmap/ros/bag_samples.h"

namespace graspmap_fuzz {

namespace {

namespace rm = graspmap_test::rm;

// librosbag itself runs in a process of its own, which may fall: what counts is that this one
// always hears of it.
bool run_bag(std::string_view bytes) {
  static const ScratchFile file("sample.bag");
  file.write(bytes);
  accepts([&] { libmap::read_bag_cloud(file.path()); });
  accepts([&] { libmap::plan_bag_rig(file.path(), {}); });
  return accepts([&] { libmap::list_bag(file.path()); });
}

rm::PointCloud2 sample_cloud() {
  libmap::PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 2, 3}};
  cloud.add_field("score", libmap::ScalarType::float32);
  return libmap::encode_cloud(cloud);
}

Seeds bag_seeds() {
  Seeds seeds;
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4})
    seeds.push_back(written("seed.bag", [&](const std::filesystem::path& path) {
      graspmap_test::SampleBag bag(path, compression);
      bag.camera("/front", {1.0, 2.0});
      bag.transform("base_link", "front_optical", libmap::Pose::Identity());
      bag.write("/cloud", 1.5, sample_cloud());
      bag.close();
    }));
  return seeds;
}

bool run_bag_message(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 5);
  return accepts([&] {
    switch (choice) {
      case 0:
        libmap::decode_cloud(bytes);
        break;
      case 1:
      case 2: {
        const bool compressed = choice == 2;
        accepts([&] { libmap::read_image_head(bytes, compressed); });
        libmap::decode_depth(bytes, compressed, {});
        break;
      }
      default:
        libmap::decode_camera_info(bytes, choice == 3);
    }
  });
}

template <typename Message>
std::string serialized(const Message& message) {
  std::string bytes(ros::serialization::serializationLength(message), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

Seeds bag_message_seeds() {
  rm::CompressedImage compressed;
  compressed.header = graspmap_test::sample_header("front", 1.0);
  compressed.format = rm::to_ros("16UC1; compressedDepth");
  const std::string png =
      std::string(12, '\0') + libmap::encode_png(libmap::Image<std::uint16_t>(4, 3));
  compressed.data.assign(png.begin(), png.end());
  rm::Image floats = graspmap_test::sample_image("front", 1.0, "32FC1", 2, 1,
                                                 graspmap_test::bytes_of<float>({1.5F, 0.0F}));
  return {with_choice(0, serialized(sample_cloud())),
          with_choice(1, serialized(graspmap_test::sample_depth("front", 1.0))),
          with_choice(1, serialized(floats)),
          with_choice(2, serialized(compressed)),
          with_choice(3, serialized(graspmap_test::sample_info("front", 1.0))),
          with_choice(4, serialized(graspmap_test::sample_info("front", 1.0)))};
}

// Ways between frames are looked for in what a broken message leaves too.
bool run_bag_transforms(std::string_view bytes) {
  libmap::TransformTree tree;
  const bool is_whole = accepts([&] { libmap::add_transforms(bytes, tree); });
  const std::vector<std::string> frames = tree.frames();
  for (const std::string& frame : frames) {
    accepts([&] { tree.root_of(frame); });
    accepts([&] { tree.target_from_source(frames.front(), frame); });
  }
  return is_whole;
}

Seeds bag_transforms_seeds() {
  libmap::Pose pose = libmap::Pose::Identity();
  pose.translation().x() = 0.5;
  rm::TFMessage message;
  for (const auto& [parent, child] :
       {std::pair{"/map", "base_link"}, {"base_link", "front"}, {"front", "front_optical"}})
    message.transforms.push_back(graspmap_test::sample_transform(parent, child, pose));
  return {serialized(message)};
}

}  // namespace

std::vector<FuzzTarget> bag_targets() {
  return {
      {"bag", "bags of ROS 1", run_bag, bag_seeds},
      {"bag_message", "clouds, depth images and calibrations out of bags", run_bag_message,
       bag_message_seeds},
      {"bag_transforms", "transforms out of bags", run_bag_transforms, bag_transforms_seeds},
  };
}

}  // namespace graspmap_fuzz
