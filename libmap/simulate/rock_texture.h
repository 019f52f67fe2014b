// Colors of rock, soil and climbing walls as functions of space, so that every surface that is
// drawn through them has them: no images, no seams. Marks of 1 to 10 cm give image features
// something to hold on to.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Weathered rock at a point, meters: tones, grain, cracks, lichen and crystals. A seed is a stone.
Color rock_color(const Eigen::Vector3d& point, std::uint64_t seed);

// Dry soil with gravel.
Color soil_color(const Eigen::Vector3d& point, std::uint64_t seed);

// A painted wooden panel with scuff marks; `point` in the panel's frame, z out of the wall.
Color panel_color(const Eigen::Vector3d& point, std::uint64_t seed);

// A climbing hold of cast resin, speckled; the seed chooses its color.
Color hold_color(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
