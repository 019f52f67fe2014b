// Numbers as single precision keeps them.
#pragma once

#include <Eigen/Core>

namespace libmap {

// The nearest float32. A function of its own, not a pair of casts: GCC 12 from -O2 on takes
// static_cast<double>(static_cast<float>(x)) for x where it makes vectors of two such numbers.
double rounded_to_single(double value);
Eigen::Vector3d rounded_to_single(const Eigen::Vector3d& values);

}  // namespace libmap
