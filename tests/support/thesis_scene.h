#pragma once

#include <array>

#include "libmap/scenes/primitive_scene.h"

namespace graspmap_test {

// Scenario 1 of the thesis: a plane of 3 x 3 m at z = 0, centered on the origin, with rows of five
// shapes that do not touch. From the smallest to the largest shape of a row, x is 1, 0.5, 0, -0.5,
// -1.
// - y = -1: hemispheres with radius 0.05 to 0.25 m.
// - y = 0: half-capsules along y, 0.1 x 0.2 to 0.3 x 0.6 m.
// - y = 1: cones with base radius 0.15 m and height 0.05 to 0.2 m.
inline libmap::PrimitiveScene thesis_primitive_scene() {
  using namespace libmap;
  constexpr std::array<double, 5> columns_m = {1.0, 0.5, 0.0, -0.5, -1.0};
  constexpr std::array<double, 5> sphere_radii_m = {0.05, 0.10, 0.15, 0.20, 0.25};
  constexpr std::array<double, 5> capsule_radii_m = {0.05, 0.075, 0.10, 0.125, 0.15};
  constexpr std::array<double, 5> capsule_lengths_m = {0.2, 0.3, 0.4, 0.5, 0.6};
  constexpr std::array<double, 5> cone_heights_m = {0.05, 0.0875, 0.125, 0.1625, 0.2};
  PrimitiveScene scene;
  scene.shapes.push_back({Plane{3.0, 3.0}, {}, "ground"});
  for (std::size_t i = 0; i < columns_m.size(); ++i)
    scene.shapes.push_back(
        {Sphere{sphere_radii_m[i]}, {.x_m = columns_m[i], .y_m = -1.0}, "hemisphere"});
  for (std::size_t i = 0; i < columns_m.size(); ++i)
    scene.shapes.push_back({Capsule{capsule_radii_m[i], capsule_lengths_m[i]},
                            {.x_m = columns_m[i], .yaw_deg = 90.0},
                            "half-capsule"});
  for (std::size_t i = 0; i < columns_m.size(); ++i)
    scene.shapes.push_back(
        {Cone{0.15, cone_heights_m[i]}, {.x_m = columns_m[i], .y_m = 1.0}, "cone"});
  return scene;
}

}  // namespace graspmap_test
