#include "libmap/surface/mesh_components.h"

#include <algorithm>
#include <cstdint>

#include "libmap/core/disjoint_sets.h"

namespace libmap {

MeshComponents components_of(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite) {
  const auto is_manifold = [](HalfEdge other) { return is_joined(other) || other == open_edge; };
  if (!std::all_of(opposite.begin(), opposite.end(), is_manifold))
    return connected_components(mesh);
  DisjointSets<std::uint32_t> sets(mesh.triangles.size());
  for (HalfEdge h = 0; h < opposite.size(); ++h)
    if (is_joined(opposite[h]) && opposite[h] < h) sets.join(opposite[h] / 3, h / 3);
  MeshComponents components;
  components.of_triangle.resize(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t first = sets.find(t);
    if (first == t) {
      components.of_triangle[t] = static_cast<std::uint32_t>(components.areas_m2.size());
      components.areas_m2.push_back(0.0);
    } else {
      components.of_triangle[t] = components.of_triangle[first];
    }
    components.areas_m2[components.of_triangle[t]] +=
        area_normal(mesh, mesh.triangles[t]).norm() / 2.0;
  }
  return components;
}

}  // namespace libmap
