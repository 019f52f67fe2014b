#include "libmap/scan/rtabmap_blobs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"

namespace libmap {

namespace {

using PoseFloats = std::array<float, 12>;

template <typename T, std::size_t N>
std::string to_bytes(const std::array<T, N>& numbers) {
  std::string bytes(sizeof(T) * N, '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

// Maximum Frobenius distance to the nearest rotation; old versions have errors of 1e-4.
constexpr double max_rotation_error = 0.05;

template <typename T, std::size_t N>
std::array<T, N> numbers_of(std::string_view bytes, const char* what) {
  std::array<T, N> numbers{};
  if (bytes.size() != sizeof numbers)
    throw Error("wrong", {.field = std::string("length of ") + what,
                          .value = std::to_string(bytes.size()) + " bytes",
                          .bound = std::to_string(sizeof numbers) + " bytes"});
  std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
  return numbers;
}

std::uint64_t elements_of(const StoredMatrix& matrix) {
  return static_cast<std::uint64_t>(matrix.rows) * static_cast<std::uint64_t>(matrix.columns) *
         static_cast<std::uint64_t>(matrix.channels);
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

void require_optimized_poses(const std::string& ids_blob, const std::string& poses_blob) {
  const StoredMatrix ids = read_matrix_header(ids_blob);
  const StoredMatrix poses = read_matrix_header(poses_blob);
  if (ids.element != MatrixElement::int32 || poses.element != MatrixElement::float32)
    throw Error("ids and poses are not matrices of int32 and float32");
  constexpr std::uint64_t pose_numbers = pose_bytes / sizeof(float);
  if (elements_of(poses) % pose_numbers != 0 ||
      elements_of(poses) / pose_numbers != elements_of(ids))
    throw Error("ids and poses do not match; their numbers are " +
                std::to_string(elements_of(ids)) + " and " +
                std::to_string(elements_of(poses) / pose_numbers));
}

std::optional<Pose> decode_pose(std::string_view bytes) {
  const auto numbers = numbers_of<float, 12>(bytes, "pose");
  if (std::all_of(numbers.begin(), numbers.end(), [](float number) { return number == 0; }))
    return std::nullopt;
  using RowMajor = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  const Eigen::Matrix<double, 3, 4> stored =
      Eigen::Map<const RowMajor>(numbers.data()).cast<double>();
  if (!stored.allFinite()) throw Error("not finite", {.field = "pose"});
  if (stored.col(3).cwiseAbs().maxCoeff() > max_position_m)
    throw Error("more than 1e8 m from the origin", {.field = "pose"});
  Pose pose = Pose::Identity();
  pose.linear() = nearest_rotation(stored.leftCols<3>());
  pose.translation() = stored.col(3);
  if ((pose.linear() - stored.leftCols<3>()).norm() > max_rotation_error)
    throw Error("not a rotation", {.field = "matrix of the pose"});
  return pose;
}

Matrix6d decode_information(std::string_view bytes) {
  const auto numbers = numbers_of<double, 36>(bytes, "information matrix");
  using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  Matrix6d information = Eigen::Map<const RowMajor>(numbers.data());
  if (!(information.cwiseAbs().array() <= max_information).all())
    throw Error("not finite or larger than 1e300", {.field = "information matrix"});
  return information;
}

std::optional<std::array<double, 6>> decode_velocity(std::string_view bytes) {
  const auto numbers = numbers_of<float, 6>(bytes, "velocity");
  std::array<double, 6> velocity{};
  std::copy(numbers.begin(), numbers.end(), velocity.begin());
  const bool is_known =
      std::any_of(velocity.begin(), velocity.end(), [](double v) { return v != 0; }) &&
      std::all_of(velocity.begin(), velocity.end(), [](double v) { return std::isfinite(v); });
  return is_known ? std::optional(velocity) : std::nullopt;
}

std::optional<GpsFix> decode_gps(std::string_view bytes) {
  const auto numbers = numbers_of<double, 6>(bytes, "gps");
  if (std::all_of(numbers.begin(), numbers.end(), [](double number) { return number == 0; }))
    return std::nullopt;
  if (!std::all_of(numbers.begin(), numbers.end(), [](double n) { return std::isfinite(n); }))
    throw Error("a number is not finite");
  return GpsFix{numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]};
}

}  // namespace libmap
