// One solid of a scene as triangles, and its cut by another. Inner part of scene_mesh.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/scene_geometry.h"
#include "libmap/simulate/scene_mesh.h"

namespace libmap {

struct TriangleSoup {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;  // counter-clockwise from outside
};

// What counts as lying on a surface, meters.
inline constexpr double on_surface_m = 1e-9;

// The whole surface of a solid, closed but for a plane's outline.
TriangleSoup tessellate(const SceneGeometry& geometry, const SceneSolid& solid,
                        const SceneMeshOptions& options);

// About how many triangles tessellate() makes.
double estimated_triangles(const SceneSolid& solid, const SceneMeshOptions& options);

// `soup`, the surface of `solid`, without what `other` hides. New vertices lie on both surfaces,
// and triangles that share an edge share the vertex that cuts it.
TriangleSoup cut_by(const SceneGeometry& geometry, const TriangleSoup& soup,
                    const SceneSolid& solid, const SceneSolid& other);

}  // namespace libmap
