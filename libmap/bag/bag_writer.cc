#include "libmap/bag/bag_writer.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "libmap/bag/bag_storage.h"
#include "libmap/bag/message_codec.h"
#include "libmap/bag/message_encoding.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;
using ros_message::Header;

void require_topic_name(const std::string& topic) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '/';
  };
  if (topic.size() < 2 || topic.front() != '/' || topic.back() == '/' ||
      !std::all_of(topic.begin(), topic.end(), allowed))
    throw Error("not a ROS topic name",
                {.field = "topic",
                 .value = topic,
                 .bound = "names of letters, digits and '_', each after a '/'"});
}

std::unique_ptr<BagSink> new_bag(const fs::path& path, BagFormat format,
                                 BagCompression compression) {
  switch (format) {
    case BagFormat::ros1:
      return new_ros1_bag(path, compression);
    case BagFormat::mcap:
      return new_mcap(path, compression);
    case BagFormat::sqlite:
      break;
  }
  if (compression != BagCompression::none)
    throw Error("a folder of .db3 cannot be compressed; use .mcap",
                {.field = "compression", .bound = "none"});
  return new_sqlite_bag(path);
}

// Encodes messages and writes them to a bag.
class BagOutput {
 public:
  BagOutput(const fs::path& path, BagFormat format, BagCompression compression)
      : format_(format), sink_(new_bag(path, format, compression)) {}

  Header header(double stamp_s, const std::string& frame) const {
    // ROS 1 stores seconds in 32 bits, ROS 2 in 31.
    const bool ros1 = format_ == BagFormat::ros1;
    const double end = ros1 ? 4294967295.0 : 2147483648.0;
    if (!(stamp_s >= 1e-9) || !(stamp_s < end))
      throw Error("outside ROS's range of time",
                  {.field = "stamp",
                   .value = to_text(stamp_s),
                   .bound = ros1 ? ">= 1e-9 and < 2^32 - 1 s" : ">= 1e-9 and < 2^31 s"});
    const double seconds = std::floor(stamp_s);
    return {.stamp = {static_cast<std::int64_t>(seconds) * 1'000'000'000 +
                      std::llround((stamp_s - seconds) * 1e9)},
            .frame_id = frame};
  }

  template <typename Message>
  void write(const std::string& topic, const Header& header, const Message& message,
             bool latching) {
    require_topic_name(topic);
    const auto encoding = format_ == BagFormat::ros1 ? MessageEncoding::ros1 : MessageEncoding::cdr;
    sink_->write({topic, Message::type, ros_message::definition_of<Message>,
                  header.stamp.nanoseconds, latching, ros_message::encode(encoding, message)});
  }

  void write_transforms(const Header& header, const std::vector<BagTransform>& transforms) {
    if (transforms.empty()) return;
    ros_message::TFMessage message;
    for (const BagTransform& transform : transforms) {
      message.transforms.push_back(encode_transform(transform));
      message.transforms.back().header.stamp = header.stamp;
    }
    write("/tf_static", header, message, true);
  }

  void close() { sink_->close(); }

 private:
  BagFormat format_;
  std::unique_ptr<BagSink> sink_;
};

// Sorts by stamp, but puts each camera's first image before all others: a bag lists topics in the
// order of recording, which is then the order of the rig.
std::vector<RigImage> in_recording_order(std::vector<RigImage> images) {
  const auto by_stamp = [](const RigImage& a, const RigImage& b) { return a.stamp_s < b.stamp_s; };
  std::stable_sort(images.begin(), images.end(), by_stamp);
  std::set<std::size_t> seen;
  const auto rest = std::stable_partition(images.begin(), images.end(), [&](const RigImage& image) {
    return seen.insert(image.camera).second;
  });
  std::sort(images.begin(), rest,
            [](const RigImage& a, const RigImage& b) { return a.camera < b.camera; });
  return images;
}

std::string optical_frame(const RigCamera& camera) { return camera.name + "_depth_optical_frame"; }

}  // namespace

BagFormat bag_format_of(const fs::path& path) {
  const std::string extension = lower_case(path.extension().string());
  if (extension == ".bag") return BagFormat::ros1;
  if (extension == ".mcap") return BagFormat::mcap;
  if (extension.empty()) return BagFormat::sqlite;
  throw Error("not a bag format",
              {.file = path.string(),
               .field = "extension",
               .value = extension,
               .bound = ".bag (ROS 1), .mcap, or none: a folder of .db3 (ROS 2)"});
}

void write_bag(const fs::path& path, BagFormat format, const BagContent& content,
               BagCompression compression) {
  BagOutput bag(path, format, compression);
  const auto header = [&](const std::string& frame) { return bag.header(content.stamp_s, frame); };
  bag.write_transforms(header(""), content.transforms);
  for (const BagCloud& cloud : content.clouds) {
    ros_message::PointCloud2 message = encode_cloud(cloud.cloud);
    message.header = header(cloud.frame);
    bag.write(cloud.topic, message.header, message, true);
  }
  for (const BagTargets& targets : content.targets) {
    const Header own = header(targets.frame);
    bag.write(targets.marker_topic, own, encode_markers(targets, own), true);
    ros_message::PoseArray poses = encode_poses(targets.targets);
    poses.header = own;
    bag.write(targets.pose_topic, own, poses, true);
  }
  for (const BagGrid& grid : content.grids) {
    const Header own = header(grid.frame);
    bag.write(grid.grid_map_topic, own, encode_grid_map(grid, own), true);
    bag.write(grid.occupancy_topic, own, encode_occupancy_grid(grid, own), true);
  }
  bag.close();
}

void write_rig_bag(const fs::path& path, BagFormat format, const CameraRig& rig,
                   const std::vector<RigImage>& images, const RigBagOptions& options) {
  const std::vector<RigImage> ordered = in_recording_order(images);
  if (ordered.empty()) throw no_elements("images");
  std::vector<BagTransform> transforms;
  for (const RigCamera& camera : rig.cameras)
    transforms.push_back(
        {options.base_frame, optical_frame(camera), camera.camera.base_from_camera});
  BagOutput bag(path, format, options.compression);
  bag.write_transforms(bag.header(ordered.front().stamp_s + options.stamp_offset_s, ""),
                       transforms);
  for (const RigImage& image : ordered) {
    const RigCamera& camera = rig.cameras.at(image.camera);
    const Header header = bag.header(image.stamp_s + options.stamp_offset_s, optical_frame(camera));
    ros_message::Image message = encode_depth(read_rig_units(image, camera), camera.depth_scale_m);
    message.header = header;
    bag.write("/" + camera.name + "/depth/image_raw", header, message, false);
    ros_message::CameraInfo info = encode_camera_info(camera.camera);
    info.header = header;
    bag.write("/" + camera.name + "/depth/camera_info", header, info, false);
  }
  bag.close();
}

}  // namespace libmap
