// What is seen of a scene straight from above, in closed form: the oracle of samples and meshes.
#pragma once

#include <optional>

#include "libmap/scenes/scene_geometry.h"

namespace graspmap_test {

// The topmost surface at (x, y); nothing where there is none.
std::optional<libmap::SurfaceTruth> from_above(const libmap::SceneGeometry& geometry, double x,
                                               double y);

// To the surface of all solids together: negative inside.
double distance_to_scene(const libmap::SceneGeometry& geometry, const Eigen::Vector3d& point);

}  // namespace graspmap_test
