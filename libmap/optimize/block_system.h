// Provides sparse normal equations of poses, one block of six unknowns per pose, and their solver.
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
  explicit BlockSystem(std::size_t blocks);  // number of poses; all entries are zero
  std::size_t size() const { return size_; }

  // Adds `block` at (row, column) and, off the diagonal, its transpose at (column, row).
  void add(std::size_t row, std::size_t column, const Matrix6d& block);
  void add_rhs(std::size_t row, const Vector6d& rhs);
  // Adds a residual with derivatives by the blocks a and b; `rhs` is -information * residual.
  void add_pair(std::size_t a, std::size_t b, const Matrix6d& by_a, const Matrix6d& by_b,
                const Matrix6d& information, const Vector6d& rhs);
  void add(const BlockSystem& other);                         // `other` has the same size
  Matrix6d block(std::size_t row, std::size_t column) const;  // zero if none was added
  const std::map<std::pair<std::size_t, std::size_t>, Matrix6d>& blocks() const { return blocks_; }
  const std::vector<Vector6d>& rhs() const { return rhs_; }
  void clear_rhs();

 private:
  std::size_t size_ = 0;
  std::map<std::pair<std::size_t, std::size_t>, Matrix6d> blocks_;  // row <= column
  std::vector<Vector6d> rhs_;
};

// Solves a BlockSystem by sparse LDL^T factorization in a fill-reducing order of the blocks.
class BlockSolver {
 public:
  // `damping` is added to the diagonal.
  explicit BlockSolver(const BlockSystem& system, double damping = 0.0);
  ~BlockSolver();
  BlockSolver(const BlockSolver&) = delete;
  BlockSolver& operator=(const BlockSolver&) = delete;

  bool valid() const;  // true if the system is positive definite; the methods below require it
  // Returns the solution for one right-hand side, by block.
  std::vector<Vector6d> solve(const std::vector<Vector6d>& rhs) const;
  // Returns the blocks of one column of the inverse, by row.
  std::vector<Matrix6d> inverse_column(std::size_t column) const;
  // Returns the blocks of the inverse at the positions of the blocks of `wanted`. Positions that
  // are also in the system cost about one factorization in total (Takahashi, Fagan and Chin 1973),
  // each other position one inverse_column.
  BlockSystem selected_inverse(const BlockSystem& wanted) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace libmap
