#include "libmap/geometry/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace libmap {

template <int Size>
SymmetricEigen<Size> symmetric_eigen(const Eigen::Matrix<double, Size, Size>& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, Size, Size>> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

template SymmetricEigen<3> symmetric_eigen(const Eigen::Matrix3d&);
template SymmetricEigen<6> symmetric_eigen(const Eigen::Matrix<double, 6, 6>&);
template SymmetricEigen<Eigen::Dynamic> symmetric_eigen(const Eigen::MatrixXd&);

}  // namespace libmap
