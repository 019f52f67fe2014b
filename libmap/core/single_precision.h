// Rounds numbers to single precision (float32), as files store them.
#pragma once

#include <Eigen/Core>

namespace libmap {

// Returns the nearest float32. Not an inline pair of casts: from -O2 on, GCC 12 replaces
// static_cast<double>(static_cast<float>(x)) by x when it vectorizes two such numbers.
double rounded_to_single(double value);
Eigen::Vector3d rounded_to_single(const Eigen::Vector3d& values);

}  // namespace libmap
