#include "libmap/core/single_precision.h"

namespace libmap {

[[gnu::noinline]] double rounded_to_single(double value) {
  return static_cast<double>(static_cast<float>(value));
}

Eigen::Vector3d rounded_to_single(const Eigen::Vector3d& values) {
  return {rounded_to_single(values.x()), rounded_to_single(values.y()),
          rounded_to_single(values.z())};
}

}  // namespace libmap
