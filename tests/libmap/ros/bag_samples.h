// Bags of the tests' own messages, written by librosbag itself.
#pragma once

#include <rosbag/bag.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/ros/ros_messages.h"

namespace graspmap_test {

namespace rm = libmap::ros_message;

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
// Rows of `bytes` one after the other, `step` bytes each.
rm::Image sample_image(const std::string& frame, double stamp_s, const std::string& encoding,
                       std::uint32_t width, std::uint32_t height, const std::string& bytes);
rm::Image sample_depth(const std::string& frame, double stamp_s);
rm::CameraInfo sample_info(const std::string& frame, double stamp_s);

// The bytes of numbers, in this machine's order or the other one.
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
