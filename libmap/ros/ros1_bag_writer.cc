// ROS 1's storage, written by librosbag.
#include <geometry_msgs/PoseArray.h>
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/ros/bag_storage.h"

namespace libmap {

// An encoded message, as librosbag's templates take one.
struct EncodedMessage {
  const StoredMessage& message;
  std::string definition;
};

}  // namespace libmap

namespace ros {

namespace message_traits {

template <>
struct MD5Sum<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.message.type.md5sum;
  }
};
template <>
struct DataType<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.message.type.name;
  }
};
template <>
struct Definition<libmap::EncodedMessage> {
  static const char* value(const libmap::EncodedMessage& encoded) {
    return encoded.definition.c_str();
  }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<libmap::EncodedMessage> {
  template <typename Stream>
  static void write(Stream& stream, const libmap::EncodedMessage& encoded) {
    const std::string& bytes = encoded.message.bytes;
    std::copy(bytes.begin(), bytes.end(), stream.advance(static_cast<std::uint32_t>(bytes.size())));
  }
  static std::uint32_t serializedLength(const libmap::EncodedMessage& encoded) {
    return static_cast<std::uint32_t>(encoded.message.bytes.size());
  }
};

}  // namespace serialization

}  // namespace ros

namespace libmap {

namespace {

namespace fs = std::filesystem;

// The text of the type's definition in ROS 1, with those that it contains.
std::string definition_of_type(const std::string& type) {
  using namespace ros::message_traits;
  static const std::map<std::string, std::string> definitions = {
      {"geometry_msgs/PoseArray", definition<geometry_msgs::PoseArray>()},
      {"sensor_msgs/CameraInfo", definition<sensor_msgs::CameraInfo>()},
      {"sensor_msgs/Image", definition<sensor_msgs::Image>()},
      {"sensor_msgs/PointCloud2", definition<sensor_msgs::PointCloud2>()},
      {"tf2_msgs/TFMessage", definition<tf2_msgs::TFMessage>()},
      {"visualization_msgs/MarkerArray", definition<visualization_msgs::MarkerArray>()}};
  const auto found = definitions.find(type);
  if (found == definitions.end())
    throw Error("bags of ROS 1 are written without it", {.field = "message", .value = type});
  return found->second;
}

rosbag::CompressionType to_rosbag(BagCompression compression) {
  switch (compression) {
    case BagCompression::none:
      return rosbag::compression::Uncompressed;
    case BagCompression::bz2:
      return rosbag::compression::BZ2;
    case BagCompression::lz4:
      return rosbag::compression::LZ4;
    case BagCompression::zstd:
      break;
  }
  throw Error("is not of bags of ROS 1",
              {.field = "compression", .value = "zstd", .bound = "none, bz2 or lz4"});
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

// librosbag's exceptions as Errors: only the disk can fail it, and the system knows how.
template <typename Action>
void guarded(const fs::path& path, const Action& action) {
  errno = 0;
  try {
    action();
  } catch (const rosbag::BagException& error) {
    throw Error(
        std::string("cannot be written: ") + (errno == 0 ? error.what() : std::strerror(errno)),
        {.file = path.string()}, ErrorKind::failed);
  }
}

class Ros1Sink : public BagSink {
 public:
  // Delegates, so that the destructor is called where opening fails.
  Ros1Sink(const fs::path& path, BagCompression compression) : Ros1Sink(path) {
    const rosbag::CompressionType type = to_rosbag(compression);
    guarded(path_, [&] {
      bag_->open(path_.string(), rosbag::bagmode::Write);
      bag_->setCompression(type);
    });
  }
  // On a full disk librosbag's destructor throws: such a bag is kept instead.
  ~Ros1Sink() override {
    try {
      bag_->close();
    } catch (const std::exception&) {
      static auto* const kept = new std::vector<rosbag::Bag*>();
      kept->push_back(bag_.release());
    }
  }
  Ros1Sink(const Ros1Sink&) = delete;
  Ros1Sink& operator=(const Ros1Sink&) = delete;

  void write(const StoredMessage& message) override {
    const EncodedMessage encoded{message, definition_of_type(message.type.name)};
    const auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = message.topic;
    (*header)["type"] = message.type.name;
    (*header)["md5sum"] = message.type.md5sum;
    (*header)["message_definition"] = encoded.definition;
    (*header)["callerid"] = "/graspmap";
    (*header)["latching"] = message.latching ? "1" : "0";
    constexpr std::int64_t second = 1'000'000'000;
    const ros::Time time(static_cast<std::uint32_t>(message.stamp_ns / second),
                         static_cast<std::uint32_t>(message.stamp_ns % second));
    guarded(path_, [&] { bag_->write(message.topic, time, encoded, header); });
  }

  void close() override {
    guarded(path_, [&] { bag_->close(); });
  }

 private:
  explicit Ros1Sink(const fs::path& path) : path_(path) {}

  fs::path path_;
  std::unique_ptr<rosbag::Bag> bag_ = new_bag();
};

}  // namespace

std::unique_ptr<BagSink> new_ros1_bag(const fs::path& path, BagCompression compression) {
  return std::make_unique<Ros1Sink>(path, compression);
}

}  // namespace libmap
