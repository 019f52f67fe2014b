// Textured meshes as they are drawn: one layer per page.
#pragma once

#include <vector>

#include "libmap/core/pose.h"
#include "libmap/core/textured_mesh.h"
#include "libmap/view/scene_geometry.h"
#include "libmap/view/scene_view.h"

namespace libmap {

// Layers that refer to the pages of `model`, which must outlive them. Triangles without a page are
// of the color of untextured_color. Triangles with corners that are not finite are left out.
// Throws what TexturedMesh::check throws.
std::vector<PreparedLayer> prepare_textured(const TexturedMesh& model, const SceneLayer& layer,
                                            const Pose& terrain_from_scene);

inline constexpr Color untextured_color{128, 128, 128};

}  // namespace libmap
