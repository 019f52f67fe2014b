// Sparse normal equations in blocks of six: one block of unknowns per pose.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "libmap/geometry/rigid_motion.h"

namespace libmap {

class BlockSystem {
 public:
  explicit BlockSystem(std::size_t blocks);  // all zero
  std::size_t size() const { return size_; }

  // The information matrix's block (row, column) and its mirror image.
  void add(std::size_t row, std::size_t column, const Matrix6d& block);
  void add_rhs(std::size_t row, const Vector6d& rhs);
  // A residual that is linear in two blocks of unknowns, with its own information and right-hand
  // side.
  void add_pair(std::size_t a, std::size_t b, const Matrix6d& by_a, const Matrix6d& by_b,
                const Matrix6d& information, const Vector6d& rhs);
  void add(const BlockSystem& other);
  Matrix6d block(std::size_t row, std::size_t column) const;  // zero where none was added
  const std::map<std::pair<std::size_t, std::size_t>, Matrix6d>& blocks() const { return blocks_; }
  const std::vector<Vector6d>& rhs() const { return rhs_; }
  void clear_rhs();

 private:
  std::size_t size_ = 0;
  std::map<std::pair<std::size_t, std::size_t>, Matrix6d> blocks_;  // row <= column
  std::vector<Vector6d> rhs_;
};

// The factored system. Sparse LDL^T with a fill-reducing order of the blocks: the same bytes on
// every run.
class BlockSolver {
 public:
  // `damping` is added to the diagonal.
  explicit BlockSolver(const BlockSystem& system, double damping = 0.0);
  ~BlockSolver();
  BlockSolver(const BlockSolver&) = delete;
  BlockSolver& operator=(const BlockSolver&) = delete;

  bool valid() const;  // positive definite
  // The unknowns for one right-hand side; only where valid().
  std::vector<Vector6d> solve(const std::vector<Vector6d>& rhs) const;
  // Blocks (row, column) of the inverse for each row, of one column.
  std::vector<Matrix6d> inverse_column(std::size_t column) const;
  // The blocks of the inverse where `wanted` has blocks. Those that the factored system has too, be
  // they zero, take about the time of the factorization together (Takahashi, Fagan and Chin 1973);
  // others take a column each.
  BlockSystem selected_inverse(const BlockSystem& wanted) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace libmap
