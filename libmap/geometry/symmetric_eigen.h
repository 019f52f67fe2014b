// Eigenvalues and eigenvectors of symmetric matrices by Eigen's Householder tridiagonalization and
// implicit QR, compiled once, because the solver takes one to three seconds to compile per file.
#pragma once

#include <Eigen/Core>

namespace libmap {

template <int Size>
struct SymmetricEigen {
  Eigen::Matrix<double, Size, 1> values;      // ascending
  Eigen::Matrix<double, Size, Size> vectors;  // columns of unit length, one for each value
};

// Decomposes the lower triangle of `matrix`, which must be finite; Size is 3, 6 or Eigen::Dynamic.
template <int Size>
SymmetricEigen<Size> symmetric_eigen(const Eigen::Matrix<double, Size, Size>& matrix);

}  // namespace libmap
