#include "libmap/refine/calibration_uncertainty.h"

#include <Eigen/Cholesky>

#include "libmap/core/symmetric_eigen.h"

namespace libmap {

namespace {

constexpr Eigen::Index steps_of_pose = 6;
// Keeps a pose that nothing binds from making the system singular.
constexpr double pose_damping = 1e-6;

}  // namespace

std::vector<Eigen::VectorXd> likely_changes(const Eigen::MatrixXd& information,
                                            const FreeRows& rows, std::size_t count) {
  if (rows.numbers.empty()) return {};
  std::vector<Eigen::Index> steps;
  for (const Eigen::Index first : rows.poses)
    for (Eigen::Index n = 0; n < steps_of_pose; ++n) steps.push_back(first + n);
  Eigen::MatrixXd of_poses = information(steps, steps);
  of_poses.diagonal().array() += pose_damping;
  // How poses follow the cameras.
  const Eigen::MatrixXd mixed = information(steps, rows.numbers);
  const Eigen::MatrixXd follow = -of_poses.ldlt().solve(mixed);
  const Eigen::MatrixXd of_numbers =
      information(rows.numbers, rows.numbers) + mixed.transpose() * follow;
  const Eigen::LLT<Eigen::MatrixXd> root(of_numbers);
  if (root.info() != Eigen::Success) return {};
  const Eigen::Index numbers = of_numbers.rows();
  const Eigen::MatrixXd deviations =
      root.matrixU().solve(Eigen::MatrixXd::Identity(numbers, numbers));
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(numbers, numbers);
  for (Eigen::Index pose = 0; pose < follow.rows(); pose += steps_of_pose) {
    const Eigen::MatrixXd moves = follow.middleRows<3>(pose) * deviations;
    squares += moves.transpose() * moves;
  }
  const SymmetricEigen<Eigen::Dynamic> effects = symmetric_eigen<Eigen::Dynamic>(squares);
  std::vector<Eigen::VectorXd> changes;
  for (Eigen::Index n = numbers - 1; n >= 0 && changes.size() < count; --n)
    changes.emplace_back(deviations * effects.vectors.col(n));
  return changes;
}

}  // namespace libmap
