#include "tools/report_map.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "libgtd/score/map_thinning.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/table.h"
#include "tools/map_frame.h"
#include "tools/map_tiles.h"
#include "tools/map_window.h"

namespace graspmap_tools {

namespace {

namespace fs = std::filesystem;

struct ThinnedMap {
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

void set_zero_plane(const std::optional<libmap::Manifest>& manifest, ThinnedMap& map) {
  const libmap::ManifestValue* value =
      manifest ? manifest->find_parameter("zero_plane_m") : nullptr;
  if (value == nullptr) return;
  if (const auto* number = std::get_if<double>(value))
    map.options.zero_plane_m = *number;
  else if (const auto* whole = std::get_if<std::int64_t>(value))
    map.options.zero_plane_m = static_cast<double>(*whole);
  else
    return;
  map.options.has_zero_plane = true;
}

ThinnedMap read_cloud_map(const fs::path& path, std::size_t max_cells) {
  const auto manifest = libmap::read_manifest_of(path);
  const libmap::PointCloud whole =
      libmap::transform_cloud(libmap::read_cloud(path).cloud, terrain_from_map(manifest));
  ThinnedMap map;
  map.voxels = whole.size();
  if (!whole.empty()) map.options.lattice = libmap::lattice_of(whole);
  const double share = static_cast<double>(whole.size()) / static_cast<double>(max_cells);
  int& width = map.options.voxels_a_cell;
  width = std::max(1, static_cast<int>(std::sqrt(share)));
  do {
    map.points = width == 1 ? whole : libgtd::thin_map_in_cubes(whole, width);
  } while (map.points.size() > max_cells && ++width > 0);
  set_zero_plane(manifest, map);
  return map;
}

// Of a store only columns are thinned: it is never whole in memory.
ThinnedMap read_store_map(const fs::path& path, std::size_t max_cells) {
  const MapTiles tiles(path.string());
  MapWindow window = read_window(tiles, std::nullopt, max_cells);
  ThinnedMap map;
  const auto& index = tiles.index();
  for (const auto& tile : index.tiles) map.voxels += tile.voxels;
  const std::optional<libmap::Manifest> manifest = index.manifest;
  map.points = libmap::transform_cloud(window.cloud, terrain_from_map(manifest));
  map.options.voxels_a_cell = window.columns_a_point;
  map.options.lattice = {index.lattice.voxel_size_m, index.lattice.origin_m};
  set_zero_plane(manifest, map);
  return map;
}

}  // namespace

libmap::MapView load_map_view(const fs::path& path, const std::optional<fs::path>& lookup,
                              std::size_t max_cells, Run& run) {
  const bool store = is_tile_store(path.string());
  const ThinnedMap map = store ? read_store_map(path, max_cells) : read_cloud_map(path, max_cells);
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
