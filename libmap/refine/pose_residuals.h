// Poses as a solver's unknowns, seven numbers each: a unit quaternion x y z w and a translation x y
// z; and their residuals with automatic derivatives: T is double or a dual number.
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/core/symmetric_eigen.h"

namespace libmap {

// The poses of a graph in one piece of memory, by ascending node: Ceres orders unknowns by where
// they lie, and its sums must be the same on every run.
class PoseBlocks {
 public:
  // `more` numbers follow the poses.
  explicit PoseBlocks(const std::map<int, Pose>& poses, std::size_t more = 0)
      : values_(7 * poses.size() + more, 0.0) {
    double* block = values_.data();
    for (const auto& [node, pose] : poses) {
      const Eigen::Quaterniond q(pose.linear());
      const Eigen::Vector3d t = pose.translation();
      const std::array<double, 7> numbers = {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
      std::copy(numbers.begin(), numbers.end(), block);
      place_[node] = block;
      block += 7;
    }
    rest_ = block;
  }
  PoseBlocks(const PoseBlocks&) = delete;
  PoseBlocks& operator=(const PoseBlocks&) = delete;

  bool contains(int node) const { return place_.contains(node); }
  double* at(int node) const { return place_.at(node); }
  double* rest() const { return rest_; }
  const double* end() const { return values_.data() + values_.size(); }
  const std::map<int, double*>& all() const { return place_; }
  Pose pose(int node) const {
    const double* block = place_.at(node);
    return make_pose({block[4], block[5], block[6]},
                     Eigen::Quaterniond(block[3], block[0], block[1], block[2]));
  }

 private:
  std::vector<double> values_;
  std::map<int, double*> place_;
  double* rest_ = nullptr;
};

template <typename T>
struct PoseView {
  explicit PoseView(const T* block) : rotation(block), translation(block + 4) {}
  Eigen::Map<const Eigen::Quaternion<T>> rotation;
  Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation;
};

// The rotation as axis times angle, the shorter way; differentiable at no rotation too.
template <typename T>
Eigen::Matrix<T, 3, 1> rotation_vector(const Eigen::Quaternion<T>& q) {
  using std::atan2;
  using std::sqrt;
  const Eigen::Matrix<T, 3, 1> vector = q.w() < T(0) ? Eigen::Matrix<T, 3, 1>(-q.vec()) : q.vec();
  const T cosine = q.w() < T(0) ? T(-q.w()) : q.w();
  const T square = vector.squaredNorm();
  if (square < T(1e-18)) return T(2) * vector;
  const T sine = sqrt(square);
  return (T(2) * atan2(sine, cosine) / sine) * vector;
}

// L^T of information = L L^T: carries residuals to unit variance.
inline Matrix6d whitening(const Matrix6d& information) {
  const Eigen::LLT<Matrix6d> root(information);
  if (root.info() == Eigen::Success) return root.matrixL().transpose();
  // Of a matrix that is only semidefinite.
  const SymmetricEigen<6> eigen = symmetric_eigen(information);
  return eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
}

// The step (rigid_motion.h) from the measured a_from_b to that of two poses, whitened.
class LinkResidual {
 public:
  LinkResidual(const Pose& measured_a_from_b, const Matrix6d& information)
      : b_from_a_(Eigen::Quaterniond(measured_a_from_b.linear()).conjugate()),
        translation_(measured_a_from_b.translation()),
        whitening_(whitening(information)) {}

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const PoseView<T> pose_a(a);
    const PoseView<T> pose_b(b);
    const Eigen::Quaternion<T> back = pose_a.rotation.conjugate();
    const Eigen::Matrix<T, 3, 1> apart = pose_b.translation - pose_a.translation;
    Eigen::Matrix<T, 6, 1> step;
    step.template head<3>() =
        b_from_a_.cast<T>() * (back * apart - translation_.template cast<T>());
    step.template tail<3>() = rotation_vector<T>(b_from_a_.cast<T>() * (back * pose_b.rotation));
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residual);
    out = whitening_.template cast<T>() * step;
    return true;
  }

 private:
  Eigen::Quaterniond b_from_a_;
  Eigen::Vector3d translation_;
  Matrix6d whitening_;
};

// A pose measured in the map's frame.
class PriorResidual {
 public:
  PriorResidual(const Pose& measured, const Matrix6d& information) : link_(measured, information) {}
  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    const std::array<T, 7> origin = {T(0), T(0), T(0), T(1), T(0), T(0), T(0)};
    return link_(origin.data(), pose, residual);
  }

 private:
  LinkResidual link_;
};

// The map's z axis as the node has felt it.
class GravityResidual {
 public:
  // `information` is of the angle about each axis.
  GravityResidual(const Pose& measured, double information)
      : up_in_base_(measured.linear().transpose() * Eigen::Vector3d::UnitZ()),
        weight_(std::sqrt(information)) {}
  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    const PoseView<T> view(pose);
    const Eigen::Matrix<T, 3, 1> up =
        view.rotation.conjugate() * Eigen::Matrix<T, 3, 1>(T(0), T(0), T(1));
    Eigen::Map<Eigen::Matrix<T, 3, 1>> out(residual);
    out = T(weight_) * up_in_base_.cast<T>().cross(up);
    return true;
  }

 private:
  Eigen::Vector3d up_in_base_;
  double weight_;
};

// Holds the place of a node and its turn about the map's z axis, which gravity leaves open.
class YawGaugeResidual {
 public:
  explicit YawGaugeResidual(const Pose& held) : held_(held) {}
  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    const PoseView<T> view(pose);
    const Eigen::Quaternion<T> held = Eigen::Quaterniond(held_.linear()).cast<T>();
    const Eigen::Matrix<T, 3, 1> turn = rotation_vector<T>(view.rotation * held.conjugate());
    const T weight(1e3);
    for (int n = 0; n < 3; ++n)
      residual[n] = weight * (view.translation[n] - T(held_.translation()[n]));
    residual[3] = weight * turn.z();
    return true;
  }

 private:
  Pose held_;
};

// Adds the residual of a link, which the problem takes over with `loss` (or nullptr).
inline void add_link(ceres::Problem& problem, const PoseBlocks& blocks, const PoseLink& link,
                     const Matrix6d& information, ceres::LossFunction* loss) {
  double* from = blocks.at(link.from);
  if (link.type == LinkType::gravity)
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<GravityResidual, 3, 7>(
                                 new GravityResidual(link.from_from_to, information(3, 3))),
                             loss, from);
  else if (link.type == LinkType::pose_prior)
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorResidual, 6, 7>(
                                 new PriorResidual(link.from_from_to, information)),
                             loss, from);
  else
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LinkResidual, 6, 7, 7>(
                                 new LinkResidual(link.from_from_to, information)),
                             loss, from, blocks.at(link.to));
}

inline void set_pose_manifolds(ceres::Problem& problem, const PoseBlocks& blocks) {
  for (const auto& [node, block] : blocks.all())
    if (problem.HasParameterBlock(block))
      problem.SetManifold(block, new ceres::ProductManifold<ceres::EigenQuaternionManifold,
                                                            ceres::EuclideanManifold<3>>());
}

// Of the poses that the problem was free to move.
inline void take_poses(const ceres::Problem& problem, const PoseBlocks& blocks,
                       std::map<int, Pose>& poses) {
  for (auto& [node, pose] : poses)
    if (problem.HasParameterBlock(blocks.at(node)) &&
        !problem.IsParameterBlockConstant(blocks.at(node)))
      pose = blocks.pose(node);
}

}  // namespace libmap
