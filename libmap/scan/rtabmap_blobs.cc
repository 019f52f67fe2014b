#include "libmap/scan/rtabmap_blobs.h"

#include <algorithm>
#include <cstring>

#include "libmap/image/matrix_codec.h"

namespace libmap {

namespace {

using PoseFloats = std::array<float, 12>;

template <typename T, std::size_t N>
std::string to_bytes(const std::array<T, N>& numbers) {
  std::string bytes(sizeof(T) * N, '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

}  // namespace

std::string to_blob(const Pose& pose) {
  PoseFloats floats{};
  using RowMajor = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(floats.data()) = pose.matrix().topRows<3>().cast<float>();
  return to_bytes(floats);
}

std::string null_pose_blob() { return to_bytes(PoseFloats{}); }

std::string to_blob(const Matrix6d& information) {
  std::array<double, 36> numbers{};
  using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  Eigen::Map<RowMajor>(numbers.data()) = 0.5 * (information + information.transpose());
  return to_bytes(numbers);
}

std::string to_blob(const std::array<double, 6>& velocity) {
  std::array<float, 6> floats{};
  std::transform(velocity.begin(), velocity.end(), floats.begin(),
                 [](double value) { return static_cast<float>(value); });
  return to_bytes(floats);
}

std::string to_blob(const GpsFix& fix) {
  return to_bytes(std::array<double, 6>{fix.stamp_s, fix.longitude_deg, fix.latitude_deg,
                                        fix.altitude_m, fix.error_m, fix.bearing_deg});
}

OptimizedPoseBlobs to_blobs(const std::map<int, Pose>& map_from_base) {
  StoredMatrix ids{.rows = 1,
                   .columns = static_cast<int>(map_from_base.size()),
                   .channels = 1,
                   .element = MatrixElement::int32,
                   .bytes = {}};
  StoredMatrix poses = ids;
  poses.columns *= 12;
  poses.element = MatrixElement::float32;
  for (const auto& [id, pose] : map_from_base) {
    ids.bytes.append(reinterpret_cast<const char*>(&id), sizeof(id));
    poses.bytes += to_blob(pose);
  }
  return {encode_matrix(ids), encode_matrix(poses)};
}

}  // namespace libmap
