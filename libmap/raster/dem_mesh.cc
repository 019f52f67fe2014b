#include "libmap/raster/dem_mesh.h"

#include <cmath>
#include <cstdint>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/raster/dem_reader.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();
// A vertex, its number and two triangles.
constexpr std::uint64_t bytes_per_pixel = sizeof(Eigen::Vector3d) + 7 * sizeof(std::uint32_t);

using Corners = std::array<std::uint32_t, 4>;  // around a cell

// The triangles of a cell whose corners are given counter-clockwise from above.
void add_cell(const Corners& corners, TriangleMesh& mesh) {
  const auto height = [&](std::size_t corner) { return mesh.vertices[corners[corner]].z(); };
  int missing = -1;
  for (int n = 0; n < 4; ++n) {
    if (corners[static_cast<std::size_t>(n)] != no_vertex) continue;
    if (missing >= 0) return;
    missing = n;
  }
  const auto add = [&](int first) {  // and the two after it
    const auto at = [&](int n) { return corners[static_cast<std::size_t>((first + n) % 4)]; };
    mesh.triangles.push_back({at(0), at(1), at(2)});
  };
  if (missing >= 0) return add(missing + 1);
  const int begin = std::abs(height(0) - height(2)) <= std::abs(height(1) - height(3)) ? 0 : 1;
  add(begin);
  add(begin + 2);
}

}  // namespace

TriangleMesh read_dem_mesh(const std::filesystem::path& path) {
  DemReader reader(path);
  const DemInfo& info = reader.info();
  if (info.pixels() >= no_vertex || info.pixels() > machine_memory() / 2 / bytes_per_pixel)
    throw Error("too many for a mesh in memory: cut the raster (gdal_translate -srcwin)",
                {.file = path.string(), .field = "pixels", .value = std::to_string(info.pixels())});
  std::vector<double> heights_m(info.pixels(), std::numeric_limits<double>::quiet_NaN());
  DemBlock block;
  while (reader.next(block))
    for (std::size_t n = 0; n < block.heights_m.size(); ++n) {
      const auto row = block.row + static_cast<std::int64_t>(n) / block.columns;
      const auto column = block.column + static_cast<std::int64_t>(n) % block.columns;
      heights_m[static_cast<std::size_t>(row * info.columns + column)] = block.heights_m[n];
    }
  const DemBlock whole{
      .columns = info.columns, .rows = info.rows, .heights_m = std::move(heights_m)};
  TriangleMesh mesh;
  std::vector<std::uint32_t> vertex_of(info.pixels(), no_vertex);
  for (std::size_t n = 0; n < vertex_of.size(); ++n) {
    if (std::isnan(whole.heights_m[n])) continue;
    vertex_of[n] = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(point_of(info, whole, n));
  }
  const bool is_mirrored = info.local_from_pixel.leftCols<2>().determinant() < 0.0;
  const auto width = static_cast<std::size_t>(info.columns);
  for (std::size_t row = 0; row + 1 < static_cast<std::size_t>(info.rows); ++row)
    for (std::size_t n = row * width; n + 1 < (row + 1) * width; ++n) {
      // Rows lead south where the raster is not mirrored: its determinant is negative.
      const Corners around = {vertex_of[n], vertex_of[n + width], vertex_of[n + width + 1],
                              vertex_of[n + 1]};
      add_cell(is_mirrored ? around : Corners{around[0], around[3], around[2], around[1]}, mesh);
    }
  return mesh;
}

}  // namespace libmap
