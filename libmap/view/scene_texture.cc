#include "libmap/view/scene_texture.h"

#include <algorithm>
#include <cstddef>

namespace libmap {

namespace {

// The corners of a triangle, each for itself: texture coordinates differ along the charts' edges.
void add_corners(const TexturedMesh& model, std::size_t t, const Pose& terrain_from_scene,
                 const std::vector<Eigen::Vector3f>& normals, PreparedLayer& layer) {
  const auto first = static_cast<std::uint32_t>(layer.positions.size());
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t corner = model.mesh.triangles[t][k];
    layer.positions.push_back(terrain_from_scene * model.mesh.vertices[corner]);
    if (!normals.empty())
      layer.normals.push_back(terrain_from_scene.linear().cast<float>() * normals[corner]);
    layer.colors.push_back(layer.texture == nullptr ? untextured_color : Color{255, 255, 255});
    if (layer.texture != nullptr) layer.coordinates.push_back(model.texture_coordinates[t][k]);
  }
  layer.triangles.push_back({first, first + 1, first + 2});
}

}  // namespace

std::vector<PreparedLayer> prepare_textured(const TexturedMesh& model, const SceneLayer& layer,
                                            const Pose& terrain_from_scene) {
  model.check();
  const bool shaded = layer.shading == Shading::full;
  const std::vector<Eigen::Vector3f> normals =
      shaded ? estimate_vertex_normals(model.mesh) : std::vector<Eigen::Vector3f>();
  // The last is that of triangles without a page.
  std::vector<PreparedLayer> parts(model.pages.size() + 1);
  for (std::size_t page = 0; page < parts.size(); ++page) {
    parts[page].is_mesh = true;
    parts[page].shaded = shaded;
    parts[page].texture = page < model.pages.size() ? &model.pages[page] : nullptr;
  }
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t) {
    const Triangle& triangle = model.mesh.triangles[t];
    if (!std::all_of(triangle.begin(), triangle.end(), [&model](std::uint32_t corner) {
          return model.mesh.vertices[corner].allFinite();
        }))
      continue;
    const std::int32_t page = model.page_of_triangle[t];
    add_corners(model, t, terrain_from_scene, normals,
                page == no_page ? parts.back() : parts[static_cast<std::size_t>(page)]);
  }
  std::erase_if(parts, [](const PreparedLayer& part) { return part.positions.empty(); });
  return parts;
}

}  // namespace libmap
