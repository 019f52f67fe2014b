// Visible surface of a scene from above in closed form, the oracle for samples and meshes.
#pragma once

#include <optional>

#include "libmap/scenes/scene_geometry.h"

namespace graspmap_test {

// Topmost surface at (x, y); nullopt if there is none.
std::optional<libmap::SurfaceTruth> from_above(const libmap::SceneGeometry& geometry, double x,
                                               double y);

// Signed distance to the union of all solids; negative inside.
double distance_to_scene(const libmap::SceneGeometry& geometry, const Eigen::Vector3d& point);

}  // namespace graspmap_test
