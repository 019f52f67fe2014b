#include "libmap/ros/bag_writer.h"

#include <rosbag/bag.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/image/image_codec.h"
#include "libmap/ros/message_encoding.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

ros::Time time_of(double stamp_s) {
  constexpr double end = 4294967295.0;
  if (!(stamp_s >= 1e-9) || !(stamp_s < end))
    throw Error("ROS has no such time",
                {.field = "stamp", .value = to_text(stamp_s), .bound = ">= 1e-9 and < 2^32 - 1 s"});
  const double seconds = std::floor(stamp_s);
  const auto nanoseconds = static_cast<std::uint32_t>(std::llround((stamp_s - seconds) * 1e9));
  const auto whole = static_cast<std::uint32_t>(seconds);
  return nanoseconds == 1'000'000'000 ? ros::Time(whole + 1, 0) : ros::Time(whole, nanoseconds);
}

ros_message::Header header_of(const ros::Time& time, const std::string& frame) {
  ros_message::Header header;
  header.stamp = time;
  header.frame_id = ros_message::to_ros(frame);
  return header;
}

void require_topic_name(const std::string& topic) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '/';
  };
  if (topic.size() < 2 || topic.front() != '/' || topic.back() == '/' ||
      !std::all_of(topic.begin(), topic.end(), allowed))
    throw Error("is no name of a ROS topic",
                {.field = "topic", .value = topic, .bound = "'/', letters, digits and '_'"});
}

rosbag::CompressionType to_rosbag(BagCompression compression) {
  switch (compression) {
    case BagCompression::none:
      return rosbag::compression::Uncompressed;
    case BagCompression::bz2:
      return rosbag::compression::BZ2;
    case BagCompression::lz4:
      return rosbag::compression::LZ4;
  }
  return rosbag::compression::Uncompressed;
}

// librosbag looks for plugins of encryption by rospack, which keeps what it finds in the user's
// folder, and complains where it cannot. While this lives it keeps that in a folder of its own.
class PluginSearch {
 public:
  PluginSearch() {
    std::error_code code;
    std::string folder = (fs::temp_directory_path(code) / "graspmap-XXXXXX").string();
    if (code || mkdtemp(folder.data()) == nullptr) return;
    folder_ = folder;
    if (const char* const before = std::getenv(variable)) before_ = before;
    setenv(variable, folder.c_str(), 1);
  }
  ~PluginSearch() {
    if (folder_.empty()) return;
    if (before_)
      setenv(variable, before_->c_str(), 1);
    else
      unsetenv(variable);
    std::error_code code;
    fs::remove_all(folder_, code);
  }
  PluginSearch(const PluginSearch&) = delete;
  PluginSearch& operator=(const PluginSearch&) = delete;

 private:
  static constexpr const char* variable = "ROS_HOME";

  fs::path folder_;
  std::optional<std::string> before_;
};

std::unique_ptr<rosbag::Bag> new_bag() {
  const PluginSearch search;
  return std::make_unique<rosbag::Bag>();
}

// A bag in the making.
class BagFile {
 public:
  BagFile() = default;
  // On a full disk librosbag's destructor throws: such a bag is kept instead.
  ~BagFile() {
    try {
      bag_->close();
    } catch (const std::exception&) {
      static auto* const kept = new std::vector<rosbag::Bag*>();
      kept->push_back(bag_.release());
    }
  }
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;

  void open(const fs::path& path, BagCompression compression) {
    bag_->open(path.string(), rosbag::bagmode::Write);
    bag_->setCompression(to_rosbag(compression));
  }

  template <typename Message>
  void write(const std::string& topic, const ros::Time& time, const Message& message,
             bool latching) {
    require_topic_name(topic);
    const auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = topic;
    (*header)["type"] = ros_message::type_of<Message>();
    (*header)["md5sum"] = ros_message::md5sum_of<Message>();
    (*header)["message_definition"] = ros::message_traits::Definition<Message>::value();
    (*header)["callerid"] = "/graspmap";
    (*header)["latching"] = latching ? "1" : "0";
    bag_->write(topic, time, message, header);
  }

  void close() { bag_->close(); }

 private:
  std::unique_ptr<rosbag::Bag> bag_ = new_bag();
};

// librosbag's exceptions as Errors: only the disk can fail it, and the system knows how.
template <typename Write>
void write_bag_file(const fs::path& path, BagCompression compression, const Write& write) {
  errno = 0;
  try {
    BagFile bag;
    bag.open(path, compression);
    write(bag);
    bag.close();
  } catch (const rosbag::BagException& error) {
    throw Error(
        std::string("cannot be written: ") + (errno == 0 ? error.what() : std::strerror(errno)),
        {.file = path.string()}, ErrorKind::failed);
  }
}

void write_transforms(BagFile& bag, const ros::Time& time,
                      const std::vector<BagTransform>& transforms) {
  if (transforms.empty()) return;
  ros_message::TFMessage message;
  for (const BagTransform& transform : transforms) {
    message.transforms.push_back(encode_transform(transform));
    message.transforms.back().header.stamp = time;
  }
  bag.write("/tf_static", time, message, true);
}

void write_places(BagFile& bag, const ros::Time& time, const BagPlaces& places) {
  const ros_message::Header header = header_of(time, places.frame);
  bag.write(places.marker_topic, time, encode_markers(places, header), true);
  ros_message::PoseArray poses = encode_poses(places.places);
  poses.header = header;
  bag.write(places.pose_topic, time, poses, true);
}

// By stamp, but each camera's first image before all others: a bag lists its topics in the order in
// which they come, and so they stand in the rig's order.
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

void write_bag(const fs::path& path, const BagContent& content, BagCompression compression) {
  const ros::Time time = time_of(content.stamp_s);
  write_bag_file(path, compression, [&](BagFile& bag) {
    write_transforms(bag, time, content.transforms);
    for (const BagCloud& cloud : content.clouds) {
      ros_message::PointCloud2 message = encode_cloud(cloud.cloud);
      message.header = header_of(time, cloud.frame);
      bag.write(cloud.topic, time, message, true);
    }
    for (const BagPlaces& places : content.places) write_places(bag, time, places);
  });
}

void write_rig_bag(const fs::path& path, const CameraRig& rig, const std::vector<RigImage>& images,
                   const RigBagOptions& options) {
  const std::vector<RigImage> ordered = in_recording_order(images);
  if (ordered.empty()) throw Error("there are no images to write");
  std::vector<BagTransform> transforms;
  for (const RigCamera& camera : rig.cameras)
    transforms.push_back(
        {options.base_frame, optical_frame(camera), camera.camera.base_from_camera});
  write_bag_file(path, options.compression, [&](BagFile& bag) {
    write_transforms(bag, time_of(ordered.front().stamp_s + options.stamp_offset_s), transforms);
    for (const RigImage& image : ordered) {
      const RigCamera& camera = rig.cameras.at(image.camera);
      const ros::Time time = time_of(image.stamp_s + options.stamp_offset_s);
      const ros_message::Header header = header_of(time, optical_frame(camera));
      ros_message::Image message =
          encode_depth(read_rig_units(image, camera), camera.depth_scale_m);
      message.header = header;
      bag.write("/" + camera.name + "/depth/image_raw", time, message, false);
      ros_message::CameraInfo info = encode_camera_info(camera.camera);
      info.header = header;
      bag.write("/" + camera.name + "/depth/camera_info", time, info, false);
    }
  });
}

}  // namespace libmap
