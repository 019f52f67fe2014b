// The ROS 1 messages that bags hold, as Debian's message packages define them. Inside libmap/ros
// alone: other parts see plain data.
#pragma once

#include <geometry_msgs/PoseArray.h>
#include <ros/serialization.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <string_view>

#include "libmap/core/error.h"

namespace libmap::ros_message {

// Bytes that the messages of this thread may still take.
inline thread_local std::size_t allocation_budget = std::numeric_limits<std::size_t>::max();

// Serialized arrays begin with their length, and roscpp makes room for it before it looks whether
// so much follows: a length that the message cannot hold would take gigabytes. The allocator takes
// no more than the budget. It also has the `rebind` that the message headers ask for, which
// std::allocator lost in C++20.
template <typename T>
struct BoundedAllocator {
  using value_type = T;
  template <typename U>
  struct rebind {
    using other = BoundedAllocator<U>;
  };

  BoundedAllocator() = default;
  template <typename U>
  BoundedAllocator(const BoundedAllocator<U>&) noexcept {}

  T* allocate(std::size_t count) {
    if (count > allocation_budget / sizeof(T)) throw std::bad_alloc();
    return std::allocator<T>().allocate(count);
  }
  void deallocate(T* place, std::size_t count) { std::allocator<T>().deallocate(place, count); }
  template <typename U>
  bool operator==(const BoundedAllocator<U>&) const {
    return true;
  }
};

template <>
struct BoundedAllocator<void> {
  using value_type = void;
  template <typename U>
  struct rebind {
    using other = BoundedAllocator<U>;
  };

  BoundedAllocator() = default;
  template <typename U>
  BoundedAllocator(const BoundedAllocator<U>&) noexcept {}
};

using Allocator = BoundedAllocator<void>;
using Text = std::basic_string<char, std::char_traits<char>, BoundedAllocator<char>>;
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

// One line of ASCII, as ROS's names are: anything else becomes '?'.
template <typename AnyText>
std::string printable(const AnyText& text) {
  std::string line(text.begin(), text.end());
  for (char& c : line)
    if (c < ' ' || c > '~') c = '?';
  return line;
}
inline std::string from_ros(const Text& text) { return printable(text); }

// "sensor_msgs/Image" and its md5sum.
template <typename Message>
std::string type_of() {
  return ros::message_traits::DataType<Message>::value();
}
template <typename Message>
std::string md5sum_of() {
  return ros::message_traits::MD5Sum<Message>::value();
}

// Calls read(stream) on the message's bytes. Throws Error if the message ends too early or promises
// more than it holds.
template <typename Read>
void read_serialized(std::string_view bytes, const Read& read) {
  // No message takes more than 4 times as much memory as bytes: a field of a PointCloud2 without a
  // name, 48 for 13.
  const std::size_t before = allocation_budget;
  allocation_budget = 4 * bytes.size() + 1024;
  // IStream adds to its pointer before it looks at the end, even for a message without bytes.
  if (bytes.empty()) bytes = "";
  // It reads alone, but takes no constant bytes.
  ros::serialization::IStream stream(
      reinterpret_cast<std::uint8_t*>(const_cast<char*>(bytes.data())),
      static_cast<std::uint32_t>(bytes.size()));
  try {
    read(stream);
  } catch (const std::exception&) {
    allocation_budget = before;
    throw Error("a message promises more than its " + std::to_string(bytes.size()) +
                " bytes contain");
  }
  allocation_budget = before;
}

template <typename Message>
Message decode(std::string_view bytes) {
  Message message;
  read_serialized(bytes, [&](ros::serialization::IStream& stream) {
    ros::serialization::deserialize(stream, message);
  });
  return message;
}

inline std::int64_t nanoseconds_of(const ros::Time& time) {
  return std::int64_t{time.sec} * 1'000'000'000 + time.nsec;
}
inline double seconds_of(std::int64_t nanoseconds) {
  const std::int64_t seconds = nanoseconds / 1'000'000'000;
  return static_cast<double>(seconds) + static_cast<double>(nanoseconds % 1'000'000'000) * 1e-9;
}

}  // namespace libmap::ros_message
