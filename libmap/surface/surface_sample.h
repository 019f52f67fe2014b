// What a surface is reconstructed from.
#pragma once

#include <Eigen/Core>

namespace libmap {

struct SurfaceSample {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m, about the samples' middle
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // unit, outwards
  float weight = 1.0F;                                 // > 0
  float spacing_m = 0.0F;                              // local distance between samples
};

}  // namespace libmap
