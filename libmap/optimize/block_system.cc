#include "libmap/optimize/block_system.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>

namespace libmap {

namespace {

using Sparse = Eigen::SparseMatrix<double>;

Eigen::Index row_of(std::size_t block) { return 6 * static_cast<Eigen::Index>(block); }

// Order for little fill-in: approximate minimum degree (Amestoy, Davis and Duff 1996).
std::vector<std::size_t> fill_reducing_positions(const BlockSystem& system) {
  const auto size = static_cast<Eigen::Index>(system.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (const auto& [key, block] : system.blocks())
    entries.emplace_back(static_cast<int>(key.second), static_cast<int>(key.first), 1.0);
  for (Eigen::Index n = 0; n < size; ++n)
    entries.emplace_back(static_cast<int>(n), static_cast<int>(n), 1.0);
  Sparse pattern(size, size);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  if (size > 0) Eigen::AMDOrdering<int>()(pattern.selfadjointView<Eigen::Lower>(), order);
  std::vector<std::size_t> positions(system.size());
  for (std::size_t n = 0; n < positions.size(); ++n)
    positions[static_cast<std::size_t>(order.indices()(static_cast<Eigen::Index>(n)))] = n;
  return positions;
}

}  // namespace

BlockSystem::BlockSystem(std::size_t blocks) : size_(blocks), rhs_(blocks, Vector6d::Zero()) {}

void BlockSystem::add(std::size_t row, std::size_t column, const Matrix6d& block) {
  const bool upper = row <= column;
  const auto key = upper ? std::pair(row, column) : std::pair(column, row);
  const auto [entry, fresh] = blocks_.try_emplace(key, Matrix6d::Zero());
  if (upper)
    entry->second += block;
  else
    entry->second += block.transpose();
}

void BlockSystem::add_rhs(std::size_t row, const Vector6d& rhs) { rhs_[row] += rhs; }

void BlockSystem::add_pair(std::size_t a, std::size_t b, const Matrix6d& by_a, const Matrix6d& by_b,
                           const Matrix6d& information, const Vector6d& rhs) {
  add(a, a, by_a.transpose() * information * by_a);
  add(a, b, by_a.transpose() * information * by_b);
  add(b, b, by_b.transpose() * information * by_b);
  add_rhs(a, by_a.transpose() * rhs);
  add_rhs(b, by_b.transpose() * rhs);
}

void BlockSystem::add(const BlockSystem& other) {
  for (const auto& [key, block] : other.blocks_) add(key.first, key.second, block);
  for (std::size_t n = 0; n < size_; ++n) rhs_[n] += other.rhs_[n];
}

Matrix6d BlockSystem::block(std::size_t row, std::size_t column) const {
  const auto found = blocks_.find(row <= column ? std::pair(row, column) : std::pair(column, row));
  if (found == blocks_.end()) return Matrix6d::Zero();
  return row <= column ? found->second : Matrix6d(found->second.transpose());
}

void BlockSystem::clear_rhs() {
  for (Vector6d& rhs : rhs_) rhs.setZero();
}

struct BlockSolver::Parts {
  Eigen::Index size = 0;
  std::vector<std::size_t> positions;  // positions of the blocks in the factored matrix
  // All entries of a block are stored, so that the factor consists of complete blocks as well.
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower, Eigen::NaturalOrdering<int>> solver;
  bool valid = false;

  Eigen::Index at(std::size_t block) const { return row_of(positions[block]); }
};

BlockSolver::BlockSolver(const BlockSystem& system, double damping)
    : parts_(std::make_unique<Parts>()) {
  parts_->size = row_of(system.size());
  parts_->positions = fill_reducing_positions(system);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(36 * system.blocks().size() + 36 * system.size());
  const auto add = [&](Eigen::Index row, Eigen::Index column, double value) {
    if (row >= column) entries.emplace_back(static_cast<int>(row), static_cast<int>(column), value);
  };
  for (const auto& [key, block] : system.blocks())
    for (Eigen::Index r = 0; r < 6; ++r)
      for (Eigen::Index c = 0; c < 6; ++c) {
        add(parts_->at(key.first) + r, parts_->at(key.second) + c, block(r, c));
        if (key.first != key.second)
          add(parts_->at(key.second) + c, parts_->at(key.first) + r, block(r, c));
      }
  for (std::size_t n = 0; n < system.size(); ++n)
    for (Eigen::Index r = 0; r < 6; ++r)
      for (Eigen::Index c = 0; c <= r; ++c)
        add(row_of(n) + r, row_of(n) + c, r == c ? damping : 0.0);
  Sparse matrix(parts_->size, parts_->size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  parts_->solver.compute(matrix);
  parts_->valid = parts_->solver.info() == Eigen::Success && parts_->solver.vectorD().allFinite() &&
                  (parts_->size == 0 || parts_->solver.vectorD().minCoeff() > 0.0);
}

BlockSolver::~BlockSolver() = default;

bool BlockSolver::valid() const { return parts_->valid; }

std::vector<Vector6d> BlockSolver::solve(const std::vector<Vector6d>& rhs) const {
  Eigen::VectorXd right(parts_->size);
  for (std::size_t n = 0; n < rhs.size(); ++n) right.segment<6>(parts_->at(n)) = rhs[n];
  const Eigen::VectorXd left = parts_->solver.solve(right);
  std::vector<Vector6d> result(rhs.size());
  for (std::size_t n = 0; n < rhs.size(); ++n) result[n] = left.segment<6>(parts_->at(n));
  return result;
}

std::vector<Matrix6d> BlockSolver::inverse_column(std::size_t column) const {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(parts_->size, 6);
  right.block<6, 6>(parts_->at(column), 0).setIdentity();
  const Eigen::MatrixXd left = parts_->solver.solve(right);
  std::vector<Matrix6d> result(parts_->positions.size());
  for (std::size_t n = 0; n < result.size(); ++n) result[n] = left.block<6, 6>(parts_->at(n), 0);
  return result;
}

namespace {

// The factor in blocks: L_bb D_b L_bb^T on the diagonal, and below it L_ib L_bb^-1 for each column
// b. The matrix is the product of block-unit-triangular and block-diagonal matrices.
struct BlockFactor {
  std::vector<std::size_t> begin{0};  // first index in `rows` by column; one more than columns
  std::vector<std::size_t> rows;      // below the diagonal, ascending
  std::vector<Matrix6d> below;
  std::vector<Matrix6d> inverse_diagonal;

  BlockFactor(const Sparse& lower, const Eigen::VectorXd& diagonal);
};

BlockFactor::BlockFactor(const Sparse& lower, const Eigen::VectorXd& diagonal) {
  for (Eigen::Index first = 0; first < lower.cols(); first += 6) {
    Matrix6d corner = Matrix6d::Identity();
    const std::size_t before = below.size();
    for (Eigen::Index c = 0; c < 6; ++c) {
      std::size_t block = before;
      for (Sparse::InnerIterator entry(lower, first + c); entry; ++entry) {
        if (entry.row() <= first + c) continue;
        if (entry.row() < first + 6) {
          corner(entry.row() - first, c) = entry.value();
          continue;
        }
        const auto row = static_cast<std::size_t>(entry.row() / 6);
        if (c == 0 && (rows.size() == before || rows.back() != row)) {
          rows.push_back(row);
          below.emplace_back(Matrix6d::Zero());
        }
        while (rows[block] != row) ++block;
        below[block](entry.row() % 6, c) = entry.value();
      }
    }
    const Matrix6d back =
        corner.triangularView<Eigen::UnitLower>().solve(Matrix6d(Matrix6d::Identity()));
    for (std::size_t n = before; n < below.size(); ++n) below[n] *= back;
    inverse_diagonal.emplace_back(back.transpose() *
                                  diagonal.segment<6>(first).cwiseInverse().asDiagonal() * back);
    begin.push_back(rows.size());
  }
}

// Computes the blocks of the inverse Z at the positions of the factor's blocks, from the last
// column to the first: Z_ib = -sum_k Z_ik L_kb, Z_bb = D_b^-1 - sum_k L_kb^T Z_kb.
struct FactorInverse {
  std::vector<Matrix6d> below;
  std::vector<Matrix6d> diagonal;

  explicit FactorInverse(const BlockFactor& factor);
};

FactorInverse::FactorInverse(const BlockFactor& factor)
    : below(factor.below.size(), Matrix6d::Zero()), diagonal(factor.inverse_diagonal) {
  const std::size_t none = factor.below.size();
  std::vector<std::size_t> entry_of(diagonal.size(), none);  // of the current column
  for (std::size_t column = diagonal.size(); column-- > 0;) {
    const std::size_t begin = factor.begin[column];
    const std::size_t end = factor.begin[column + 1];
    for (std::size_t n = begin; n < end; ++n) entry_of[factor.rows[n]] = n;
    for (std::size_t n = begin; n < end; ++n) {
      const std::size_t k = factor.rows[n];
      below[n].noalias() -= diagonal[k] * factor.below[n];
      for (std::size_t m = factor.begin[k]; m < factor.begin[k + 1]; ++m) {
        const std::size_t other = entry_of[factor.rows[m]];
        if (other == none) continue;
        below[other].noalias() -= below[m] * factor.below[n];
        below[n].noalias() -= below[m].transpose() * factor.below[other];
      }
    }
    for (std::size_t n = begin; n < end; ++n) {
      diagonal[column].noalias() -= factor.below[n].transpose() * below[n];
      entry_of[factor.rows[n]] = none;
    }
  }
}

}  // namespace

BlockSystem BlockSolver::selected_inverse(const BlockSystem& wanted) const {
  const BlockFactor factor(parts_->solver.matrixL().nestedExpression(), parts_->solver.vectorD());
  const FactorInverse inverse(factor);
  BlockSystem result(wanted.size());
  for (const auto& [key, unused] : wanted.blocks()) {
    const std::size_t a = parts_->positions[key.first];
    const std::size_t b = parts_->positions[key.second];
    if (a == b) {
      result.add(key.first, key.second, inverse.diagonal[a]);
      continue;
    }
    const auto [low, high] = std::minmax(a, b);
    const auto rows = factor.rows.begin();
    const auto last = rows + static_cast<std::ptrdiff_t>(factor.begin[low + 1]);
    const auto found =
        std::lower_bound(rows + static_cast<std::ptrdiff_t>(factor.begin[low]), last, high);
    if (found == last || *found != high) {
      result.add(key.first, key.second, inverse_column(key.second)[key.first]);
      continue;
    }
    const Matrix6d& block = inverse.below[static_cast<std::size_t>(found - rows)];
    result.add(key.first, key.second, a > b ? block : Matrix6d(block.transpose()));
  }
  return result;
}

}  // namespace libmap
