#include "libmap/scan/board_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "libmap/core/symmetric_eigen.h"

namespace libmap {

namespace {

constexpr int max_steps = 200;
constexpr double least_gain = 1e-12;  // of the error
constexpr double max_damping = 1e10;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

Camera with_intrinsics(Camera camera, const Eigen::VectorXd& values) {
  camera.fx = values(0);
  camera.fy = values(1);
  camera.cx = values(2);
  camera.cy = values(3);
  for (std::size_t n = 0; n < camera.distortion.size(); ++n)
    camera.distortion[n] = values(4 + static_cast<Eigen::Index>(n));
  return camera;
}

// Translation, then a turn in the camera's frame.
Pose moved(const Pose& pose, const Vector6d& step) {
  Pose result = pose;
  const Eigen::Vector3d turn = step.tail<3>();
  if (turn.norm() > 0)
    result.linear() =
        Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * pose.linear();
  result.translation() += step.head<3>();
  return result;
}

// Derivatives of one corner's pixel by central differences.
Eigen::MatrixXd by_intrinsics(const Camera& camera, const Pose& pose,
                              const Eigen::Vector3d& corner) {
  const Eigen::VectorXd values = intrinsics_of(camera);
  Eigen::MatrixXd derivative(2, values.size());
  for (Eigen::Index n = 0; n < values.size(); ++n) {
    const double step = 1e-6 * std::max(1.0, std::abs(values(n)));
    Eigen::VectorXd above = values;
    Eigen::VectorXd below = values;
    above(n) += step;
    below(n) -= step;
    derivative.col(n) = (board_pixel(with_intrinsics(camera, above), pose, corner) -
                         board_pixel(with_intrinsics(camera, below), pose, corner)) /
                        (above(n) - below(n));
  }
  return derivative;
}

Eigen::Matrix<double, 2, 6> by_pose(const Camera& camera, const Pose& pose,
                                    const Eigen::Vector3d& corner) {
  constexpr double step = 1e-6;
  Eigen::Matrix<double, 2, 6> derivative;
  for (Eigen::Index n = 0; n < 6; ++n)
    derivative.col(n) = (board_pixel(camera, moved(pose, step * Vector6d::Unit(n)), corner) -
                         board_pixel(camera, moved(pose, -step * Vector6d::Unit(n)), corner)) /
                        (2 * step);
  return derivative;
}

// Normal equations, one block a picture.
struct Normal {
  Eigen::MatrixXd camera;
  Eigen::VectorXd camera_side;
  std::vector<Eigen::MatrixXd> mixed;  // camera x pose
  std::vector<Matrix6d> pose;
  std::vector<Vector6d> pose_side;
};

Normal normal_equations(const BoardFit& fit, const BoardCorners& corners) {
  const Eigen::Index size = intrinsics_of(fit.camera).size();
  Normal normal{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), {}, {}, {}};
  for (std::size_t picture = 0; picture < corners.in_images.size(); ++picture) {
    const Pose& pose = fit.camera_from_board[picture];
    Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(size, 6);
    Matrix6d of_pose = Matrix6d::Zero();
    Vector6d pose_side = Vector6d::Zero();
    for (std::size_t n = 0; n < corners.in_board.size(); ++n) {
      const Eigen::Vector3d& corner = corners.in_board[n];
      const Eigen::MatrixXd a = by_intrinsics(fit.camera, pose, corner);
      const Eigen::Matrix<double, 2, 6> b = by_pose(fit.camera, pose, corner);
      const Eigen::Vector2d miss =
          corners.in_images[picture][n] - board_pixel(fit.camera, pose, corner);
      normal.camera += a.transpose() * a;
      normal.camera_side += a.transpose() * miss;
      mixed += a.transpose() * b;
      of_pose += b.transpose() * b;
      pose_side += b.transpose() * miss;
    }
    normal.mixed.push_back(mixed);
    normal.pose.push_back(of_pose);
    normal.pose_side.push_back(pose_side);
  }
  return normal;
}

// One damped step; the poses are eliminated (Schur complement).
BoardFit stepped(const BoardFit& fit, const Normal& normal, double damping) {
  Eigen::MatrixXd reduced = normal.camera;
  reduced.diagonal() *= 1 + damping;
  Eigen::VectorXd side = normal.camera_side;
  std::vector<Eigen::LDLT<Matrix6d>> poses;
  for (std::size_t n = 0; n < normal.pose.size(); ++n) {
    Matrix6d damped = normal.pose[n];
    damped.diagonal() *= 1 + damping;
    poses.emplace_back(damped);
    reduced -= normal.mixed[n] * poses.back().solve(normal.mixed[n].transpose());
    side -= normal.mixed[n] * poses.back().solve(normal.pose_side[n]);
  }
  const Eigen::VectorXd step = reduced.ldlt().solve(side);
  BoardFit next{with_intrinsics(fit.camera, intrinsics_of(fit.camera) + step), {}};
  for (std::size_t n = 0; n < normal.pose.size(); ++n)
    next.camera_from_board.push_back(
        moved(fit.camera_from_board[n],
              poses[n].solve(normal.pose_side[n] - normal.mixed[n].transpose() * step)));
  return next;
}

}  // namespace

Eigen::VectorXd intrinsics_of(const Camera& camera) {
  Eigen::VectorXd values(4 + static_cast<Eigen::Index>(camera.distortion.size()));
  values.head<4>() << camera.fx, camera.fy, camera.cx, camera.cy;
  for (std::size_t n = 0; n < camera.distortion.size(); ++n)
    values(4 + static_cast<Eigen::Index>(n)) = camera.distortion[n];
  return values;
}

Eigen::Vector2d board_pixel(const Camera& camera, const Pose& camera_from_board,
                            const Eigen::Vector3d& corner) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return project_point(camera, camera_from_board * corner).value_or(Eigen::Vector2d(nan, nan));
}

double squared_error(const BoardFit& fit, const BoardCorners& corners) {
  double sum = 0.0;
  for (std::size_t picture = 0; picture < corners.in_images.size(); ++picture)
    for (std::size_t n = 0; n < corners.in_board.size(); ++n)
      sum += (corners.in_images[picture][n] -
              board_pixel(fit.camera, fit.camera_from_board[picture], corners.in_board[n]))
                 .squaredNorm();
  return sum;
}

double adjust_boards(BoardFit& fit, const BoardCorners& corners) {
  double error = squared_error(fit, corners);
  double damping = 1e-3;
  for (int step = 0; step < max_steps && damping < max_damping; ++step) {
    const Normal normal = normal_equations(fit, corners);
    double gain = 0.0;
    while (damping < max_damping) {
      BoardFit next = stepped(fit, normal, damping);
      const double next_error = squared_error(next, corners);
      if (next_error < error) {
        gain = error - next_error;
        fit = std::move(next);
        error = next_error;
        damping = std::max(damping * 0.1, 1e-12);
        break;
      }
      damping *= 10;
    }
    if (gain <= least_gain * error) break;
  }
  return error;
}

Eigen::MatrixXd unit_covariance(const BoardFit& fit, const BoardCorners& corners) {
  const Normal normal = normal_equations(fit, corners);
  Eigen::MatrixXd reduced = normal.camera;
  for (std::size_t n = 0; n < normal.pose.size(); ++n)
    reduced -= normal.mixed[n] * normal.pose[n].ldlt().solve(normal.mixed[n].transpose());
  if (!reduced.allFinite() || (reduced.diagonal().array() <= 0).any()) return {};
  // Pixels and lens terms differ by many orders of magnitude.
  const Eigen::VectorXd scale = reduced.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * reduced * scale.asDiagonal();
  const SymmetricEigen<Eigen::Dynamic> eigen = symmetric_eigen(scaled);
  if (!(eigen.values.minCoeff() > 0)) return {};
  const Eigen::MatrixXd inverse =
      eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace libmap
