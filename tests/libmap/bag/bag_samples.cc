#include "tests/libmap/bag/bag_samples.h"

#include <numeric>

namespace graspmap_test {

SampleBag::SampleBag(const std::filesystem::path& path,
                     rosbag::compression::CompressionType compression) {
  bag_.open(path.string(), rosbag::bagmode::Write);
  bag_.setCompression(compression);
}

SampleBag& SampleBag::camera(const std::string& topic, const std::vector<double>& stamps_s) {
  const std::string frame = topic.substr(1) + "_optical";
  for (const double stamp : stamps_s) {
    write(topic + "/image_raw", stamp, sample_depth(frame, stamp));
    write(topic + "/camera_info", stamp, sample_info(frame, stamp));
  }
  return *this;
}

SampleBag& SampleBag::transform(const std::string& parent, const std::string& child,
                                const libmap::Pose& parent_from_child, const std::string& topic) {
  rm::TFMessage message;
  message.transforms.push_back(sample_transform(parent, child, parent_from_child));
  return write(topic, 1.0, message);
}

rm::TransformStamped sample_transform(const std::string& parent, const std::string& child,
                                      const libmap::Pose& parent_from_child) {
  rm::TransformStamped transform;
  transform.header = sample_header(parent, 1.0);
  transform.child_frame_id = rm::to_ros(child);
  const Eigen::Vector3d t = parent_from_child.translation();
  const Eigen::Quaterniond q(parent_from_child.linear());
  transform.transform.translation.x = t.x();
  transform.transform.translation.y = t.y();
  transform.transform.translation.z = t.z();
  transform.transform.rotation.x = q.x();
  transform.transform.rotation.y = q.y();
  transform.transform.rotation.z = q.z();
  transform.transform.rotation.w = q.w();
  return transform;
}

rm::Header sample_header(const std::string& frame, double stamp_s) {
  rm::Header header;
  header.frame_id = rm::to_ros(frame);
  if (stamp_s > 0) header.stamp = ros::Time(stamp_s);
  return header;
}

rm::Image sample_image(const std::string& frame, double stamp_s, const std::string& encoding,
                       std::uint32_t width, std::uint32_t height, const std::string& bytes) {
  rm::Image image;
  image.header = sample_header(frame, stamp_s);
  image.encoding = rm::to_ros(encoding);
  image.width = width;
  image.height = height;
  image.step = static_cast<std::uint32_t>(bytes.size()) / height;
  image.data.assign(bytes.begin(), bytes.end());
  return image;
}

rm::Image sample_depth(const std::string& frame, double stamp_s) {
  std::vector<std::uint16_t> millimeters(12);
  std::iota(millimeters.begin(), millimeters.end(), std::uint16_t{1000});
  return sample_image(frame, stamp_s, "16UC1", 4, 3, bytes_of(millimeters));
}

rm::CameraInfo sample_info(const std::string& frame, double stamp_s) {
  rm::CameraInfo info;
  info.header = sample_header(frame, stamp_s);
  info.width = 4;
  info.height = 3;
  info.distortion_model = rm::to_ros("plumb_bob");
  info.K = {5, 0, 1.5, 0, 6, 1.25, 0, 0, 1};
  info.P = {7, 0, 1.75, 0, 0, 8, 1.0, 0, 0, 0, 1, 0};
  return info;
}

}  // namespace graspmap_test
