#include "libmap/mesh/mesh_tile_index.h"

#include <algorithm>
#include <cstdint>

#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::size_t max_kept_triangles = 1'000'000;

bool is_before(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
}

// Vertices within a box, sorted by position, then by index.
std::vector<std::uint32_t> sorted_vertices(const TriangleMesh& mesh,
                                           const Eigen::AlignedBox3d& box) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v)
    if (box.contains(mesh.vertices[v])) order.push_back(v);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return is_before(mesh.vertices[a], mesh.vertices[b]);
  });
  return order;
}

}  // namespace

void append_part_within(const TriangleMesh& other, const Eigen::AlignedBox2d& box,
                        TriangleMesh& mesh) {
  std::vector<bool> is_near(other.triangles.size());
  for (std::size_t t = 0; t < is_near.size(); ++t)
    is_near[t] =
        std::any_of(other.triangles[t].begin(), other.triangles[t].end(),
                    [&](std::uint32_t v) { return box.contains(other.vertices[v].head<2>()); });
  const TriangleMesh part = select_triangles(other, is_near);
  Eigen::AlignedBox3d around_part;
  for (const Eigen::Vector3d& vertex : part.vertices) around_part.extend(vertex);
  const std::vector<std::uint32_t> order = sorted_vertices(mesh, around_part);
  const std::size_t first_vertex = mesh.vertices.size();
  const std::size_t first_triangle = mesh.triangles.size();
  append_mesh(part, mesh);
  std::vector<std::uint32_t> same(part.vertices.size());
  for (std::size_t v = 0; v < same.size(); ++v) {
    const Eigen::Vector3d& position = part.vertices[v];
    const auto found = std::lower_bound(
        order.begin(), order.end(), position,
        [&](std::uint32_t a, const Eigen::Vector3d& p) { return is_before(mesh.vertices[a], p); });
    const bool is_there = found != order.end() && mesh.vertices[*found] == position;
    same[v] = is_there ? *found : static_cast<std::uint32_t>(first_vertex + v);
  }
  for (std::size_t t = first_triangle; t < mesh.triangles.size(); ++t)
    for (std::uint32_t& corner : mesh.triangles[t]) corner = same[corner - first_vertex];
}

MeshTileIndex::MeshTileIndex(std::vector<std::filesystem::path> tiles) {
  for (std::filesystem::path& path : tiles) {
    const TriangleMesh mesh = read_mesh(path).mesh;
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex.head<2>());
    tiles_.push_back({std::move(path), box});
  }
}

const TriangleMesh& MeshTileIndex::mesh_of(const Tile& tile) {
  const auto found = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const auto& one) { return one.first == &tile; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return kept_.front().second;
  }
  kept_.emplace_front(&tile, read_mesh(tile.path).mesh);
  std::size_t triangles = 0;
  for (auto one = kept_.begin(); one != kept_.end();) {
    triangles += one->second.triangles.size();
    one =
        triangles > max_kept_triangles && one != kept_.begin() ? kept_.erase(one) : std::next(one);
  }
  return kept_.front().second;
}

MeshWithMargin MeshTileIndex::with_margin(std::size_t tile, double margin_m) {
  MeshWithMargin joined{mesh_of(tiles_[tile]), 0};
  joined.triangles = joined.mesh.triangles.size();
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_m);
  const Eigen::AlignedBox2d& own = tiles_[tile].box;
  const Eigen::AlignedBox2d box(own.min() - margin, own.max() + margin);
  for (std::size_t n = 0; n < tiles_.size(); ++n)
    if (n != tile && box.intersects(tiles_[n].box))
      append_part_within(mesh_of(tiles_[n]), box, joined.mesh);
  return joined;
}

}  // namespace libmap
