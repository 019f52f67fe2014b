#include "tools/support/report_map.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/score/graspability_map.h"
#include "libgtd/score/map_downsampling.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/table.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

namespace graspmap_tools {

namespace {

namespace fs = std::filesystem;

struct DownsampledMap {
  libmap::PointCloud points;  // in the terrain frame
  std::uint64_t voxels = 0;   // of the whole map
  libmap::MapViewOptions options;
};

libmap::Pose terrain_from_map(const std::optional<libmap::Manifest>& manifest) {
  const libmap::Pose* terrain_from_input = manifest && manifest->frame == "input"
                                               ? manifest->find_transform("terrain_from_input")
                                               : nullptr;
  return terrain_from_input == nullptr ? libmap::Pose(libmap::Pose::Identity())
                                       : *terrain_from_input;
}

void set_zero_plane(const std::optional<libmap::Manifest>& manifest, DownsampledMap& map) {
  const std::optional<double> height =
      manifest ? libmap::number_of(manifest->find_parameter("zero_plane_m")) : std::nullopt;
  if (!height) return;
  map.options.zero_plane_m = *height;
  map.options.has_zero_plane = true;
}

// Of cubes, for a map of that many voxels if it is even ground.
int first_width(std::uint64_t voxels, std::size_t max_cells) {
  return std::max(
      1, static_cast<int>(std::sqrt(static_cast<double>(voxels) / static_cast<double>(max_cells))));
}

DownsampledMap read_cloud_map(const fs::path& path, std::size_t max_cells) {
  const auto manifest = libmap::read_manifest_of(path);
  const libmap::PointCloud whole =
      libmap::transform_cloud(libmap::read_cloud(path).cloud, terrain_from_map(manifest));
  DownsampledMap map;
  map.voxels = whole.size();
  const auto lattice = manifest ? libgtd::facts_of(*manifest).lattice : std::nullopt;
  if (lattice)
    map.options.lattice = {lattice->voxel_size_m, lattice->origin_m};
  else if (!whole.empty())
    map.options.lattice = libmap::lattice_of(whole);
  int& width = map.options.voxels_a_cell;
  width = first_width(map.voxels, max_cells);
  do {
    map.points = width == 1 ? whole : libgtd::thin_map_in_cubes(whole, width);
  } while (map.points.size() > max_cells && ++width > 0);
  set_zero_plane(manifest, map);
  return map;
}

// The tiles' points that stay at that width.
libmap::PointCloud thin_tiles(const MapTiles& tiles, int width) {
  std::vector<libmap::PointCloud> parts(tiles.index().tiles.size());
  libmap::parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      parts[n] = libgtd::thin_map_in_cubes(tiles.load(n), width);
  });
  // Cubes that two tiles share have a point of each.
  return libgtd::thin_map_in_cubes(libgtd::merge_map_clouds(parts), width);
}

// The same cells, but downsampled tile by tile: a store is never whole in memory.
DownsampledMap read_store_map(const fs::path& path, std::size_t max_cells) {
  const MapTiles tiles(path.string());
  DownsampledMap map;
  const auto& index = tiles.index();
  map.voxels = index.voxels();
  const std::optional<libmap::Manifest> manifest = index.manifest;
  int& width = map.options.voxels_a_cell;
  width = first_width(map.voxels, max_cells);
  do {
    map.points = thin_tiles(tiles, width);
  } while (map.points.size() > max_cells && ++width > 0);
  map.points = libmap::transform_cloud(map.points, terrain_from_map(manifest));
  map.options.lattice = {index.lattice.voxel_size_m, index.lattice.origin_m};
  set_zero_plane(manifest, map);
  return map;
}

}  // namespace

libmap::MapView load_map_view(const fs::path& path, const std::optional<fs::path>& lookup,
                              std::size_t max_cells, Run& run) {
  const bool store = is_tile_store(path.string());
  const DownsampledMap map =
      store ? read_store_map(path, max_cells) : read_cloud_map(path, max_cells);
  libmap::MapView view = libmap::make_map_view(map.points, map.options);
  view.voxels = map.voxels;
  if (!lookup) return view;
  const auto manifest = libmap::read_manifest_of(path);
  const PointFrame frame =
      frame_of_points(lookup->string(), PointFrame::automatic, path.string(), run);
  const libmap::Pose terrain_from_points =
      terrain_from_map(manifest) * map_from_points(path.string(), frame, run);
  for (const Eigen::Vector3d& point : positions_of(libmap::read_csv(*lookup)))
    view.markers.push_back({.label = {}, .point_in_terrain = terrain_from_points * point});
  return view;
}

}  // namespace graspmap_tools
