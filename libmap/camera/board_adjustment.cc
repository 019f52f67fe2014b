#include "libmap/camera/board_adjustment.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <limits>

#include "libmap/geometry/symmetric_eigen.h"

namespace libmap {

namespace {

using PoseBlock = std::array<double, 6>;  // rotation vector, translation

PoseBlock block_of(const Pose& pose) {
  PoseBlock block{};
  const Eigen::Matrix3d rotation = pose.linear();
  ceres::RotationMatrixToAngleAxis(rotation.data(), block.data());
  std::copy_n(pose.translation().data(), 3, block.data() + 3);
  return block;
}

Pose pose_of(const double* block) {
  Eigen::Matrix3d rotation;
  ceres::AngleAxisToRotationMatrix(block, rotation.data());
  Pose pose = Pose::Identity();
  pose.linear() = rotation;
  pose.translation() << block[3], block[4], block[5];
  return pose;
}

Camera with_intrinsics(Camera camera, const double* values) {
  camera.fx = values[0];
  camera.fy = values[1];
  camera.cx = values[2];
  camera.cy = values[3];
  std::copy_n(values + 4, camera.distortion.size(), camera.distortion.begin());
  return camera;
}

// Residuals of all corners of an image: projected minus detected.
struct ImageResidual {
  const Camera& camera;
  const std::vector<Eigen::Vector3d>& in_board;
  const std::vector<Eigen::Vector2d>& in_image;

  bool operator()(const double* const* blocks, double* residuals) const {
    const Camera moved = with_intrinsics(camera, blocks[0]);
    const Pose pose = pose_of(blocks[1]);
    Eigen::Map<Eigen::Matrix2Xd> out(residuals, 2, static_cast<Eigen::Index>(in_board.size()));
    for (std::size_t n = 0; n < in_board.size(); ++n)
      out.col(static_cast<Eigen::Index>(n)) = board_pixel(moved, pose, in_board[n]) - in_image[n];
    return out.allFinite();
  }
};

struct BoardProblem {
  std::vector<double> intrinsics;
  std::vector<PoseBlock> poses;
  ceres::Problem problem;

  BoardProblem(const BoardFit& fit, const BoardCorners& corners)
      : intrinsics{fit.camera.fx, fit.camera.fy, fit.camera.cx, fit.camera.cy} {
    intrinsics.insert(intrinsics.end(), fit.camera.distortion.begin(), fit.camera.distortion.end());
    for (const Pose& pose : fit.camera_from_board) poses.push_back(block_of(pose));
    for (std::size_t n = 0; n < poses.size(); ++n) {
      auto* cost = new ceres::DynamicNumericDiffCostFunction<ImageResidual, ceres::CENTRAL>(
          new ImageResidual{fit.camera, corners.in_board, corners.in_images[n]});
      cost->AddParameterBlock(static_cast<int>(intrinsics.size()));
      cost->AddParameterBlock(static_cast<int>(poses[n].size()));
      cost->SetNumResiduals(static_cast<int>(2 * corners.in_board.size()));
      problem.AddResidualBlock(cost, nullptr, intrinsics.data(), poses[n].data());
    }
  }
};

}  // namespace

Eigen::Vector2d board_pixel(const Camera& camera, const Pose& camera_from_board,
                            const Eigen::Vector3d& corner) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return project_point(camera, camera_from_board * corner).value_or(Eigen::Vector2d(nan, nan));
}

double squared_error(const BoardFit& fit, const BoardCorners& corners) {
  double sum = 0.0;
  for (std::size_t image = 0; image < corners.in_images.size(); ++image)
    for (std::size_t n = 0; n < corners.in_board.size(); ++n)
      sum += (corners.in_images[image][n] -
              board_pixel(fit.camera, fit.camera_from_board[image], corners.in_board[n]))
                 .squaredNorm();
  return sum;
}

double adjust_boards(BoardFit& fit, const BoardCorners& corners) {
  BoardProblem boards(fit, corners);
  ceres::Solver::Options settings;
  settings.linear_solver_type = ceres::DENSE_SCHUR;
  settings.dense_linear_algebra_library_type = ceres::EIGEN;
  settings.num_threads = 1;
  settings.max_num_iterations = 200;
  settings.max_trust_region_radius = 1e8;  // less damping makes Cholesky fail with a warning
  settings.function_tolerance = 1e-12;
  settings.gradient_tolerance = 1e-14;
  settings.parameter_tolerance = 1e-12;
  settings.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(settings, &boards.problem, &summary);
  fit.camera = with_intrinsics(fit.camera, boards.intrinsics.data());
  for (std::size_t n = 0; n < boards.poses.size(); ++n)
    fit.camera_from_board[n] = pose_of(boards.poses[n].data());
  return squared_error(fit, corners);
}

Eigen::MatrixXd unit_covariance(const BoardFit& fit, const BoardCorners& corners) {
  BoardProblem boards(fit, corners);
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = {boards.intrinsics.data()};
  for (PoseBlock& pose : boards.poses) options.parameter_blocks.push_back(pose.data());
  ceres::CRSMatrix sparse;
  if (!boards.problem.Evaluate(options, nullptr, nullptr, nullptr, &sparse)) return {};
  const Eigen::MatrixXd jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      sparse.num_rows, sparse.num_cols, static_cast<Eigen::Index>(sparse.values.size()),
      sparse.rows.data(), sparse.cols.data(), sparse.values.data());
  const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
  if (!normal.allFinite() || (normal.diagonal().array() <= 0).any()) return {};
  // Scaled because pixels and distortion terms differ by orders of magnitude.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  const SymmetricEigen<Eigen::Dynamic> eigen =
      symmetric_eigen(Eigen::MatrixXd(scale.asDiagonal() * normal * scale.asDiagonal()));
  if (!(eigen.values.minCoeff() > 0)) return {};
  const auto size = static_cast<Eigen::Index>(boards.intrinsics.size());
  const Eigen::MatrixXd rows = scale.head(size).asDiagonal() * eigen.vectors.topRows(size);
  return rows * eigen.values.cwiseInverse().asDiagonal() * rows.transpose();
}

}  // namespace libmap
