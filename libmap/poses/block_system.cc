#include "libmap/poses/block_system.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cmath>

namespace libmap {

namespace {

Eigen::Index place(std::size_t block) { return 6 * static_cast<Eigen::Index>(block); }

}  // namespace

BlockSystem::BlockSystem(std::size_t blocks) : size_(blocks), side_(blocks, Vector6d::Zero()) {}

void BlockSystem::add(std::size_t row, std::size_t column, const Matrix6d& block) {
  const bool upper = row <= column;
  const auto key = upper ? std::pair(row, column) : std::pair(column, row);
  const auto [entry, fresh] = blocks_.try_emplace(key, Matrix6d::Zero());
  if (upper)
    entry->second += block;
  else
    entry->second += block.transpose();
}

void BlockSystem::add_side(std::size_t row, const Vector6d& side) { side_[row] += side; }

void BlockSystem::add(const BlockSystem& other) {
  for (const auto& [key, block] : other.blocks_) add(key.first, key.second, block);
  for (std::size_t n = 0; n < size_; ++n) side_[n] += other.side_[n];
}

Matrix6d BlockSystem::block(std::size_t row, std::size_t column) const {
  const auto found = blocks_.find(row <= column ? std::pair(row, column) : std::pair(column, row));
  if (found == blocks_.end()) return Matrix6d::Zero();
  return row <= column ? found->second : Matrix6d(found->second.transpose());
}

void BlockSystem::clear_side() {
  for (Vector6d& side : side_) side.setZero();
}

struct BlockSolver::Parts {
  Eigen::Index size = 0;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver;
  bool valid = false;
};

BlockSolver::BlockSolver(const BlockSystem& system, double damping)
    : parts_(std::make_unique<Parts>()) {
  parts_->size = place(system.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (const auto& [key, block] : system.blocks()) {
    for (Eigen::Index r = 0; r < 6; ++r)
      for (Eigen::Index c = 0; c < 6; ++c) {
        // The lower triangle: block (column, row) is the transpose.
        const Eigen::Index row = place(key.second) + c;
        const Eigen::Index column = place(key.first) + r;
        if (row >= column) entries.emplace_back(row, column, block(r, c));
      }
  }
  for (Eigen::Index n = 0; n < parts_->size; ++n) entries.emplace_back(n, n, damping);
  Eigen::SparseMatrix<double> matrix(parts_->size, parts_->size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  parts_->solver.compute(matrix);
  parts_->valid = parts_->solver.info() == Eigen::Success && parts_->solver.vectorD().allFinite() &&
                  (parts_->size == 0 || parts_->solver.vectorD().minCoeff() > 0.0);
}

BlockSolver::~BlockSolver() = default;

bool BlockSolver::valid() const { return parts_->valid; }

std::vector<Vector6d> BlockSolver::solve(const std::vector<Vector6d>& side) const {
  Eigen::VectorXd right(parts_->size);
  for (std::size_t n = 0; n < side.size(); ++n) right.segment<6>(place(n)) = side[n];
  const Eigen::VectorXd left = parts_->solver.solve(right);
  std::vector<Vector6d> result(side.size());
  for (std::size_t n = 0; n < side.size(); ++n) result[n] = left.segment<6>(place(n));
  return result;
}

std::vector<Matrix6d> BlockSolver::inverse_column(std::size_t column) const {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(parts_->size, 6);
  right.block<6, 6>(place(column), 0).setIdentity();
  const Eigen::MatrixXd left = parts_->solver.solve(right);
  std::vector<Matrix6d> result(static_cast<std::size_t>(parts_->size / 6));
  for (std::size_t n = 0; n < result.size(); ++n) result[n] = left.block<6, 6>(place(n), 0);
  return result;
}

}  // namespace libmap
