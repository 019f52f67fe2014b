#include "libmap/refine/calibration_uncertainty.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/symmetric_eigen.h"

namespace libmap {

namespace {

constexpr Eigen::Index numbers_of_point = 3;
constexpr Eigen::Index steps_of_pose = 6;  // three of its quaternion, then three of its position
// Keeps a pose that nothing binds from making the system singular.
constexpr double pose_damping = 1e-6;

// Normal equations of poses and cameras, the points eliminated. Rows of the Jacobian have few
// columns.
class Reduced {
 public:
  Reduced(const ceres::CRSMatrix& jacobian, std::size_t points)
      : jacobian_(jacobian), first_(numbers_of_point * static_cast<Eigen::Index>(points)) {
    information = Eigen::MatrixXd::Zero(jacobian.num_cols - first_, jacobian.num_cols - first_);
    std::vector<std::vector<int>> rows(points);
    for (int row = 0; row < jacobian.num_rows; ++row) {
      const int point = point_of(row);
      if (point < 0)
        add({row});
      else
        rows[static_cast<std::size_t>(point)].push_back(row);
    }
    for (const std::vector<int>& of_point : rows)
      if (!of_point.empty()) add(of_point);
  }

  Eigen::MatrixXd information;

 private:
  std::size_t begin(int row) const {
    return static_cast<std::size_t>(jacobian_.rows[static_cast<std::size_t>(row)]);
  }
  // Columns are in the order of the blocks: those of a point first.
  int point_of(int row) const {
    if (begin(row) == begin(row + 1)) return -1;
    const Eigen::Index column = jacobian_.cols[begin(row)];
    return column < first_ ? static_cast<int>(column / numbers_of_point) : -1;
  }
  void add(const std::vector<int>& rows);

  const ceres::CRSMatrix& jacobian_;
  Eigen::Index first_;  // column after those of points
};

void Reduced::add(const std::vector<int>& rows) {
  std::vector<int> columns;
  for (const int row : rows)
    for (std::size_t n = begin(row); n < begin(row + 1); ++n)
      if (jacobian_.cols[n] >= first_) columns.push_back(jacobian_.cols[n]);
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  const auto height = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd by_others =
      Eigen::MatrixXd::Zero(height, static_cast<Eigen::Index>(columns.size()));
  Eigen::Matrix<double, Eigen::Dynamic, numbers_of_point> by_point =
      Eigen::Matrix<double, Eigen::Dynamic, numbers_of_point>::Zero(height, numbers_of_point);
  for (Eigen::Index r = 0; r < height; ++r) {
    const int row = rows[static_cast<std::size_t>(r)];
    for (std::size_t n = begin(row); n < begin(row + 1); ++n) {
      const int column = jacobian_.cols[n];
      if (column < first_)
        by_point(r, column % numbers_of_point) = jacobian_.values[n];
      else
        by_others(r, std::lower_bound(columns.begin(), columns.end(), column) - columns.begin()) =
            jacobian_.values[n];
    }
  }
  Eigen::MatrixXd local = by_others.transpose() * by_others;
  const Eigen::Matrix3d of_point = by_point.transpose() * by_point;
  if (of_point.trace() > 0.0) {
    const Eigen::MatrixXd mixed = by_point.transpose() * by_others;
    local -= mixed.transpose() * of_point.ldlt().solve(mixed);
  }
  for (std::size_t a = 0; a < columns.size(); ++a)
    for (std::size_t b = 0; b < columns.size(); ++b)
      information(columns[a] - first_, columns[b] - first_) +=
          local(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
}

}  // namespace

std::vector<Eigen::VectorXd> likely_changes(ceres::Problem& problem, const FreeBlocks& blocks,
                                            std::size_t count) {
  ceres::Problem::EvaluateOptions options;
  for (const auto* some : {&blocks.points, &blocks.poses, &blocks.cameras})
    options.parameter_blocks.insert(options.parameter_blocks.end(), some->begin(), some->end());
  ceres::CRSMatrix jacobian;
  if (blocks.cameras.empty() || !problem.Evaluate(options, nullptr, nullptr, nullptr, &jacobian))
    return {};
  const Eigen::MatrixXd all = Reduced(jacobian, blocks.points.size()).information;
  const Eigen::Index poses = steps_of_pose * static_cast<Eigen::Index>(blocks.poses.size());
  const Eigen::Index numbers = all.rows() - poses;
  Eigen::MatrixXd of_poses = all.topLeftCorner(poses, poses);
  of_poses.diagonal().array() += pose_damping;
  // How poses follow the cameras.
  const Eigen::MatrixXd follow = -of_poses.ldlt().solve(all.topRightCorner(poses, numbers));
  const Eigen::MatrixXd information =
      all.bottomRightCorner(numbers, numbers) + all.bottomLeftCorner(numbers, poses) * follow;
  const Eigen::LLT<Eigen::MatrixXd> root(information);
  if (root.info() != Eigen::Success) return {};
  const Eigen::MatrixXd deviations =
      root.matrixU().solve(Eigen::MatrixXd::Identity(numbers, numbers));
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(numbers, numbers);
  for (Eigen::Index pose = 0; pose < poses; pose += steps_of_pose) {
    const Eigen::MatrixXd moves = follow.middleRows<3>(pose + 3) * deviations;
    squares += moves.transpose() * moves;
  }
  const SymmetricEigen<Eigen::Dynamic> effects = symmetric_eigen<Eigen::Dynamic>(squares);
  std::vector<Eigen::VectorXd> changes;
  for (Eigen::Index n = numbers - 1; n >= 0 && changes.size() < count; --n)
    changes.emplace_back(deviations * effects.vectors.col(n));
  return changes;
}

}  // namespace libmap
