// Bags of sample messages of ROS 1's types, encoded and written by its libraries.
#pragma once

#include <geometry_msgs/PoseArray.h>
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "libmap/core/pose.h"

namespace graspmap_test {

namespace rm {

// Allocator with the `rebind` that the message headers require; C++20 removed it.
template <typename T>
struct RebindAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = RebindAllocator<U>;
  };
  RebindAllocator() = default;
  template <typename U>
  RebindAllocator(const RebindAllocator<U>&) noexcept {}
};
template <>
struct RebindAllocator<void> {
  using value_type = void;
  template <typename U>
  struct rebind {
    using other = RebindAllocator<U>;
  };
};

using Allocator = RebindAllocator<void>;
using Text = std::basic_string<char, std::char_traits<char>, RebindAllocator<char>>;
using Header = std_msgs::Header_<Allocator>;
using Image = sensor_msgs::Image_<Allocator>;
using CompressedImage = sensor_msgs::CompressedImage_<Allocator>;
using CameraInfo = sensor_msgs::CameraInfo_<Allocator>;
using PointCloud2 = sensor_msgs::PointCloud2_<Allocator>;
using PointField = sensor_msgs::PointField_<Allocator>;
using TransformStamped = geometry_msgs::TransformStamped_<Allocator>;
using TFMessage = tf2_msgs::TFMessage_<Allocator>;
using PoseArray = geometry_msgs::PoseArray_<Allocator>;
using Marker = visualization_msgs::Marker_<Allocator>;
using MarkerArray = visualization_msgs::MarkerArray_<Allocator>;

inline Text to_ros(std::string_view text) { return Text(text.begin(), text.end()); }
inline std::string from_ros(const Text& text) { return {text.begin(), text.end()}; }

template <typename Message>
std::string serialized(const Message& message) {
  std::string bytes(ros::serialization::serializationLength(message), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}
template <typename Message>
Message decode(std::string bytes) {
  Message message;
  ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::deserialize(stream, message);
  return message;
}

}  // namespace rm

class SampleBag {
 public:
  explicit SampleBag(
      const std::filesystem::path& path,
      rosbag::compression::CompressionType compression = rosbag::compression::Uncompressed);

  template <typename Message>
  SampleBag& write(const std::string& topic, double recorded_s, const Message& message) {
    bag_.write(topic, ros::Time(recorded_s), message);
    return *this;
  }
  // 4 x 3 pixels: 1000, 1001, ... mm; on TOPIC/image_raw and TOPIC/camera_info, frame
  // "NAME_optical" for TOPIC "/NAME".
  SampleBag& camera(const std::string& topic, const std::vector<double>& stamps_s);
  SampleBag& transform(const std::string& parent, const std::string& child,
                       const libmap::Pose& parent_from_child,
                       const std::string& topic = "/tf_static");
  void close() { bag_.close(); }

 private:
  rosbag::Bag bag_;
};

rm::TransformStamped sample_transform(const std::string& parent, const std::string& child,
                                      const libmap::Pose& parent_from_child);
rm::Header sample_header(const std::string& frame, double stamp_s);
// Consecutive rows of `bytes`, `step` bytes each.
rm::Image sample_image(const std::string& frame, double stamp_s, const std::string& encoding,
                       std::uint32_t width, std::uint32_t height, const std::string& bytes);
rm::Image sample_depth(const std::string& frame, double stamp_s);
rm::CameraInfo sample_info(const std::string& frame, double stamp_s);

// Bytes of numbers in this machine's order or swapped.
template <typename T>
std::string bytes_of(const std::vector<T>& numbers, bool swapped = false) {
  std::string bytes;
  for (const T& number : numbers) {
    std::string one(reinterpret_cast<const char*>(&number), sizeof(T));
    bytes += swapped ? std::string(one.rbegin(), one.rend()) : one;
  }
  return bytes;
}

}  // namespace graspmap_test
