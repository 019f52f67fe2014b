// Procedural colors of rock, soil and climbing walls as functions of position and seed, without
// images or seams. Marks of 1 to 10 cm serve as image features.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Color of weathered rock at a point (m): tones, grain, cracks, lichen. Use one seed per stone.
Color rock_color(const Eigen::Vector3d& point, std::uint64_t seed);
// Color of dry soil with gravel at a point (m).
Color soil_color(const Eigen::Vector3d& point, std::uint64_t seed);
// Color of a painted wooden panel with scuffs; `point` (m) in the panel's frame, z out of the wall.
Color panel_color(const Eigen::Vector3d& point, std::uint64_t seed);
// Color of a speckled climbing hold of resin at a point (m); the seed determines the base color.
Color hold_color(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
