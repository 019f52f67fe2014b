// How uncertain the calibration of a bundle adjustment is. Inner part of libmap/refine.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace ceres {
class Problem;
}

namespace libmap {

// Blocks of a problem at its optimum that are free there.
struct FreeBlocks {
  std::vector<double*> points;   // three numbers each; no residual is of two of them
  std::vector<double*> poses;    // PoseBlocks
  std::vector<double*> cameras;  // whose uncertainty is asked for
};

// Changes of the cameras' numbers, one after the other, of one standard deviation in independent
// directions, poses and points being unknown (Schur complement): the `count` ones that move the
// positions of the poses most.
std::vector<Eigen::VectorXd> likely_changes(ceres::Problem& problem, const FreeBlocks& blocks,
                                            std::size_t count);

}  // namespace libmap
