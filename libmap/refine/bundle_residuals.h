// Residuals of observations and what is known beforehand of a camera, for Ceres. Inner part of
// libmap/refine.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "libmap/image/depth_correction.h"
#include "libmap/refine/frame_calibration.h"
#include "libmap/refine/pose_residuals.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

// What the calibration of its camera changes in one observation, linear about a calibration that is
// known already.
struct CalibratedObservation {
  bool intrinsics = false;  // which of the camera's numbers are unknown
  bool depth = false;
  bool registration = false;
  bool timing = false;
  DepthCorrection::Terms terms{};
  double added_m = 0.0;                    // to the depth, by the known registration and timing
  Vector6d by_step = Vector6d::Zero();     // of the depth, by a step of the registration
  Vector6d known_step = Vector6d::Zero();  // of the known timing
  double row_share = 0.0;                  // row_share_of
};

// x, y in the picture and depth, in standard deviations, by pose (7), point (3) and then, those
// that are unknown: intrinsics (4), four numbers of the depth's spline (1 each) and the radial ones
// (3), registration (6), motion of the base (6) and timing (2). The intrinsics are steps away from
// those by which the feature's ray was made: of fx and fy in parts, of cx and cy in pixels; the
// registration is a step from the known one.
class ObservationCost : public ceres::CostFunction {
 public:
  ObservationCost(const Feature& feature, const Camera& camera,
                  const CalibratedObservation& calibrated)
      : camera_from_base_(camera.base_from_camera.linear().transpose()),
        base_from_camera_(camera.base_from_camera.translation()),
        ray_(feature.ray.cast<double>()),
        depth_(static_cast<double>(feature.depth_m)),
        focal_(camera.fx, camera.fy),
        weight_(1.0 / static_cast<double>(feature.pixel_noise_px),
                1.0 / static_cast<double>(feature.pixel_noise_px),
                1.0 / static_cast<double>(feature.depth_noise_m)),
        calibrated_(calibrated) {
    set_num_residuals(3);
    std::vector<int>& sizes = *mutable_parameter_block_sizes();
    sizes = {7, 3};
    if (calibrated.intrinsics) sizes.push_back(4);
    if (calibrated.depth) sizes.insert(sizes.end(), {1, 1, 1, 1, 3});
    if (calibrated.registration) sizes.push_back(6);
    if (calibrated.timing) sizes.insert(sizes.end(), {6, 2});
  }

  // As Ceres calls it; false for a point that is not in front of the camera.
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  Eigen::Matrix3d camera_from_base_;
  Eigen::Vector3d base_from_camera_;  // the camera's place
  Eigen::Vector2d ray_;
  double depth_;
  Eigen::Vector2d focal_;
  Eigen::Vector3d weight_;
  CalibratedObservation calibrated_;
};

// A step or a motion is near `mean`: three numbers by one standard deviation, three by another.
class NearResidual {
 public:
  NearResidual(const Vector6d& mean, double shift_m, double turn_rad)
      : mean_(mean), shift_m_(shift_m), turn_rad_(turn_rad) {}
  template <typename T>
  bool operator()(const T* step, T* residual) const {
    for (int n = 0; n < 6; ++n)
      residual[n] = (step[n] - T(mean_[n])) / T(n < 3 ? shift_m_ : turn_rad_);
    return true;
  }

 private:
  Vector6d mean_;
  double shift_m_;
  double turn_rad_;
};

// Linear in single numbers and one block of three: prior, smoothness and gauge of a correction.
class LinearResidual : public ceres::CostFunction {
 public:
  LinearResidual(std::vector<double> of_numbers, const std::array<double, 3>& of_radial)
      : of_numbers_(std::move(of_numbers)), of_radial_(of_radial) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->assign(of_numbers_.size(), 1);
    mutable_parameter_block_sizes()->push_back(3);
  }
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const std::size_t numbers = of_numbers_.size();
    residual[0] = 0.0;
    for (std::size_t n = 0; n < numbers; ++n) residual[0] += of_numbers_[n] * blocks[n][0];
    for (std::size_t n = 0; n < 3; ++n) residual[0] += of_radial_[n] * blocks[numbers][n];
    if (jacobians == nullptr) return true;
    for (std::size_t n = 0; n < numbers; ++n)
      if (jacobians[n] != nullptr) jacobians[n][0] = of_numbers_[n];
    if (jacobians[numbers] != nullptr)
      std::copy(of_radial_.begin(), of_radial_.end(), jacobians[numbers]);
    return true;
  }

 private:
  std::vector<double> of_numbers_;
  std::array<double, 3> of_radial_;
};

// Of a step of the intrinsics.
class IntrinsicsPrior {
 public:
  IntrinsicsPrior(double focal, double center_px) : focal_(focal), center_(center_px) {}
  template <typename T>
  bool operator()(const T* intrinsics, T* residual) const {
    residual[0] = intrinsics[0] / T(focal_);
    residual[1] = intrinsics[1] / T(focal_);
    residual[2] = intrinsics[2] / T(center_);
    residual[3] = intrinsics[3] / T(center_);
    return true;
  }

 private:
  double focal_;
  double center_;
};

// Delay of depth and time of the rows are short.
class TimingPrior {
 public:
  explicit TimingPrior(double short_s) : short_s_(short_s) {}
  template <typename T>
  bool operator()(const T* timing, T* residual) const {
    for (int n = 0; n < 2; ++n) residual[n] = timing[n] / T(short_s_);
    return true;
  }

 private:
  double short_s_;
};

// Residual of an observation with its derivatives by a step of the pose and by the point.
struct Linearized {
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6> by_pose;
  Eigen::Matrix3d by_point;
};

inline Linearized linearize(const Feature& feature, const Camera& camera, const Pose& map_from_base,
                            const Eigen::Vector3d& point) {
  const Pose camera_from_base = camera.base_from_camera.inverse();
  const Eigen::Vector3d in_base = map_from_base.inverse() * point;
  const Eigen::Vector3d p = camera_from_base * in_base;
  Eigen::Matrix3d projection;
  projection << camera.fx / p.z(), 0.0, -camera.fx * p.x() / (p.z() * p.z()), 0.0,
      camera.fy / p.z(), -camera.fy * p.y() / (p.z() * p.z()), 0.0, 0.0, 1.0;
  const double pixel = 1.0 / static_cast<double>(feature.pixel_noise_px);
  const double depth = 1.0 / static_cast<double>(feature.depth_noise_m);
  const Eigen::Vector3d weight(pixel, pixel, depth);
  const Eigen::Matrix3d by_base = weight.asDiagonal() * projection * camera_from_base.linear();
  Linearized result;
  result.residual = weight.cwiseProduct(
      Eigen::Vector3d(camera.fx * (p.x() / p.z() - static_cast<double>(feature.ray.x())),
                      camera.fy * (p.y() / p.z() - static_cast<double>(feature.ray.y())),
                      p.z() - static_cast<double>(feature.depth_m)));
  // A step of the pose moves the point against it: d in_base = -t + [in_base]x r.
  result.by_pose.leftCols<3>() = -by_base;
  result.by_pose.rightCols<3>() = by_base * cross_matrix(in_base);
  result.by_point = by_base * map_from_base.linear().transpose();
  return result;
}

}  // namespace libmap
