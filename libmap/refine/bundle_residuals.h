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
#include "libmap/refine/features.h"
#include "libmap/refine/pose_residuals.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

// x, y in the picture and depth, in standard deviations. The intrinsics are steps away from those
// by which the feature's ray was made: of fx and fy in parts, of cx and cy in pixels.
class ObservationResidual {
 public:
  ObservationResidual(const Feature& feature, const Camera& camera)
      : camera_from_base_(Eigen::Quaterniond(camera.base_from_camera.linear()).conjugate()),
        origin_(camera.base_from_camera.inverse().translation()),
        ray_(feature.ray.cast<double>()),
        depth_(static_cast<double>(feature.depth_m)),
        fx_(camera.fx),
        fy_(camera.fy),
        pixel_noise_(static_cast<double>(feature.pixel_noise_px)),
        depth_noise_(static_cast<double>(feature.depth_noise_m)) {}

  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    const std::array<T, 4> none = {T(0), T(0), T(0), T(0)};
    return (*this)(pose, point, none.data(), residual);
  }

  // What a turn and a shift of depth against color add to the depth: linear, since both are small.
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* intrinsics, const T* s0, const T* s1,
                  const T* s2, const T* s3, const T* radial, const T* registration,
                  T* residual) const {
    if (!(*this)(pose, point, intrinsics, s0, s1, s2, s3, radial, residual)) return false;
    for (std::size_t n = 0; n < 6; ++n)
      residual[2] -= registration[n] * T(by_registration_[n]) / T(depth_noise_);
    return true;
  }

  // s0 to s3 are those numbers of the depth correction's spline that the depth takes part in.
  template <typename T>
  bool operator()(const T* pose, const T* point, const T* intrinsics, const T* s0, const T* s1,
                  const T* s2, const T* s3, const T* radial, T* residual) const {
    if (!(*this)(pose, point, intrinsics, residual)) return false;
    T added = s0[0] * T(terms_.spline[0]) + s1[0] * T(terms_.spline[1]) +
              s2[0] * T(terms_.spline[2]) + s3[0] * T(terms_.spline[3]);
    for (std::size_t n = 0; n < 3; ++n) added += radial[n] * T(terms_.radial[n]);
    residual[2] -= added / T(depth_noise_);
    return true;
  }
  void set_terms(const DepthCorrection::Terms& terms) { terms_ = terms; }
  void set_registration(const std::array<double, 6>& derivatives) {
    by_registration_ = derivatives;
  }

  template <typename T>
  bool operator()(const T* pose, const T* point, const T* intrinsics, T* residual) const {
    const PoseView<T> base(pose);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> in_map(point);
    const Eigen::Matrix<T, 3, 1> in_base =
        base.rotation.conjugate() * Eigen::Matrix<T, 3, 1>(in_map - base.translation);
    const Eigen::Matrix<T, 3, 1> in_camera =
        camera_from_base_.cast<T>() * in_base + origin_.template cast<T>();
    if (in_camera.z() < T(1e-3)) return false;
    const T x = in_camera.x() / in_camera.z();
    const T y = in_camera.y() / in_camera.z();
    residual[0] =
        (T(fx_) * ((T(1) + intrinsics[0]) * x - T(ray_.x())) + intrinsics[2]) / T(pixel_noise_);
    residual[1] =
        (T(fy_) * ((T(1) + intrinsics[1]) * y - T(ray_.y())) + intrinsics[3]) / T(pixel_noise_);
    residual[2] = (in_camera.z() - T(depth_)) / T(depth_noise_);
    return true;
  }

 private:
  Eigen::Quaterniond camera_from_base_;
  Eigen::Vector3d origin_;
  Eigen::Vector2d ray_;
  double depth_;
  double fx_;
  double fy_;
  double pixel_noise_;
  double depth_noise_;
  DepthCorrection::Terms terms_{};
  std::array<double, 6> by_registration_{};
};

// Each number of a block is small.
class SmallResidual {
 public:
  SmallResidual(double shift_m, double turn_rad) : shift_m_(shift_m), turn_rad_(turn_rad) {}
  template <typename T>
  bool operator()(const T* step, T* residual) const {
    for (int n = 0; n < 6; ++n) residual[n] = step[n] / T(n < 3 ? shift_m_ : turn_rad_);
    return true;
  }

 private:
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
