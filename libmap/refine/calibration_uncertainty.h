// How uncertain the calibration of a bundle adjustment is. Inner part of libmap/refine.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace libmap {

// Of normal equations.
struct FreeRows {
  std::vector<Eigen::Index> poses;    // the first of six each: of a step (rigid_motion.h)
  std::vector<Eigen::Index> numbers;  // of cameras and motions, whose uncertainty is asked for
};

// Changes of the numbers of one standard deviation in independent directions, poses being unknown
// (Schur complement): the `count` ones that move the positions of the poses most. Points are
// eliminated from the information already.
std::vector<Eigen::VectorXd> likely_changes(const Eigen::MatrixXd& information,
                                            const FreeRows& rows, std::size_t count);

}  // namespace libmap
