// Procedural colors of rock, soil and climbing walls as functions of position and seed, without
// images or seams. Marks of 1 to 10 cm serve as image features.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Weathered rock at a point (m): tones, grain, cracks, lichen and crystals. One seed per stone.
Color rock_color(const Eigen::Vector3d& point, std::uint64_t seed);

// Dry soil with gravel.
Color soil_color(const Eigen::Vector3d& point, std::uint64_t seed);

// A painted wooden panel with scuff marks; `point` in the panel's frame, z out of the wall.
Color panel_color(const Eigen::Vector3d& point, std::uint64_t seed);

// A speckled climbing hold of cast resin; the seed determines the color.
Color hold_color(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
