// Bags, and the messages in them.
#include <filesystem>

#include "libmap/bag/bag_cloud.h"
#include "libmap/bag/bag_reader.h"
#include "libmap/bag/bag_rig.h"
#include "libmap/bag/bag_storage.h"
#include "libmap/bag/bag_writer.h"
#include "libmap/bag/depth_message.h"
#include "libmap/bag/message_codec.h"
#include "libmap/bag/message_encoding.h"
#include "libmap/bag/transform_tree.h"
#include "libmap/camera/image_codec.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"
#ifdef GRASPMAP_FUZZ_ROS
#include "tests/libmap/bag/bag_samples.h"
#endif

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;
namespace rm = libmap::ros_message;
using libmap::MessageEncoding;

constexpr MessageEncoding encodings[] = {MessageEncoding::ros1, MessageEncoding::cdr};

bool read_all_of_bag(const fs::path& path) {
  accepts([&] { libmap::read_bag_cloud(path); });
  accepts([&] { libmap::plan_bag_rig(path, {}); });
  return accepts([&] { libmap::list_bag(path); });
}

libmap::PointCloud sample_cloud() {
  libmap::PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 2, 3}};
  cloud.add_field("score", libmap::ScalarType::float32);
  return cloud;
}

#ifdef GRASPMAP_FUZZ_ROS
// librosbag itself runs in a process of its own, which may fall: what counts is that this one
// always hears of it.
bool run_bag(std::string_view bytes) {
  static const ScratchFile file("sample.bag");
  file.write(bytes);
  return read_all_of_bag(file.path());
}

Seeds bag_seeds() {
  Seeds seeds;
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4})
    seeds.push_back(written("seed.bag", [&](const fs::path& path) {
      graspmap_test::SampleBag bag(path, compression);
      bag.camera("/front", {1.0, 2.0});
      bag.transform("base_link", "front_optical", libmap::Pose::Identity());
      bag.close();
    }));
  return seeds;
}
#endif

bool run_bag_ros2(std::string_view bytes) {
  static const ScratchFile file("sample.db3");
  file.write(bytes);
  return read_all_of_bag(file.path());
}

Seeds bag_ros2_seeds() {
  libmap::BagContent content;
  content.clouds = {{"/cloud", "map", sample_cloud()}};
  content.transforms = {{"map", "base_link", libmap::Pose::Identity()}};
  Seeds seeds;
  for (const auto compression :
       {libmap::BagCompression::none, libmap::BagCompression::lz4, libmap::BagCompression::zstd})
    seeds.push_back(written("seed.mcap", [&](const fs::path& path) {
      libmap::write_bag(path, libmap::BagFormat::mcap, content, compression);
    }));
  seeds.push_back(written("seed.db3", [&](const fs::path& path) {
    const fs::path folder = path.parent_path() / "folder";
    fs::create_directory(folder);
    libmap::write_bag(folder, libmap::BagFormat::sqlite, content);
    fs::rename(folder / libmap::names_in_bag_folder().back(), path);
    fs::remove_all(folder);
  }));
  return seeds;
}

bool run_bag_metadata(std::string_view bytes) {
  static const ScratchFile file("metadata.yaml");
  file.write(bytes);
  return accepts([&] { libmap::read_rosbag2_metadata(file.path()); });
}

Seeds bag_metadata_seeds() {
  libmap::RecordedTopics topics;
  topics.add(topics.index_of({.name = "/map", .type = "sensor_msgs/msg/PointCloud2"}), 1, 5, 5);
  return {libmap::rosbag2_metadata(topics, "sqlite3", "bag_0.db3")};
}

bool run_bag_message(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 10);
  const MessageEncoding encoding = encodings[choice / 5];
  return accepts([&] {
    switch (choice % 5) {
      case 0:
        libmap::decode_cloud(encoding, bytes);
        break;
      case 1:
      case 2: {
        const bool compressed = choice % 5 == 2;
        accepts([&] { libmap::read_image_head(encoding, bytes, compressed); });
        libmap::decode_depth(encoding, bytes, compressed, {});
        break;
      }
      default:
        libmap::decode_camera_info(encoding, bytes, choice % 5 == 3);
    }
  });
}

Seeds bag_message_seeds() {
  libmap::Image<std::uint16_t> image(4, 3);
  rm::CompressedImage compressed;
  compressed.format = "16UC1; compressedDepth";
  const std::string png = std::string(12, '\0') + libmap::encode_png(image);
  compressed.data.assign(png.begin(), png.end());
  libmap::Camera camera;
  camera.width = 4;
  camera.height = 3;
  camera.fx = camera.fy = 5;
  const rm::CameraInfo info = libmap::encode_camera_info(camera);
  Seeds seeds;
  for (std::size_t n = 0; n < 2; ++n) {
    const auto add = [&](std::size_t choice, const auto& message) {
      seeds.push_back(with_choice(5 * n + choice, rm::encode(encodings[n], message)));
    };
    add(0, libmap::encode_cloud(sample_cloud()));
    add(1, libmap::encode_depth(image, 0.001));
    add(1, libmap::encode_depth(image, 0.0001));
    add(2, compressed);
    add(3, info);
    add(4, info);
  }
  return seeds;
}

// Ways between frames are looked for in what a broken message leaves too.
bool run_bag_transforms(std::string_view bytes) {
  const MessageEncoding encoding = encodings[take_choice(bytes, 2)];
  libmap::TransformTree tree;
  const bool is_whole = accepts([&] { libmap::add_transforms(encoding, bytes, tree); });
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
    message.transforms.push_back(libmap::encode_transform({parent, child, pose}));
  return {with_choice(0, rm::encode(encodings[0], message)),
          with_choice(1, rm::encode(encodings[1], message))};
}

}  // namespace

std::vector<FuzzTarget> bag_targets() {
  return {
#ifdef GRASPMAP_FUZZ_ROS
      {"bag", "bags of ROS 1", run_bag, bag_seeds},
#endif
      {"bag_ros2", "bags of ROS 2: .db3 and .mcap", run_bag_ros2, bag_ros2_seeds},
      {"bag_metadata", "metadata.yaml of bags of ROS 2", run_bag_metadata, bag_metadata_seeds},
      {"bag_message", "clouds, depth images and calibrations out of bags", run_bag_message,
       bag_message_seeds},
      {"bag_transforms", "transforms out of bags", run_bag_transforms, bag_transforms_seeds},
  };
}

}  // namespace graspmap_fuzz
