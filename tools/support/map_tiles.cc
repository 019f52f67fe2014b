#include "tools/support/map_tiles.h"

#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/tile_detection.h"
#include "libmap/cloud/cloud_io.h"
#include "tools/support/run.h"

namespace graspmap_tools {

bool is_tile_store(const std::string& path) { return libgtd::is_tile_store_name(path); }

std::filesystem::path store_index_path(const std::string& store) {
  return std::filesystem::path(store) / "index.json";
}

std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest) {
  const auto lattice = libgtd::facts_of(manifest).lattice;
  if (!lattice) return std::nullopt;
  libgtd::TileStoreIndex index;
  index.lattice = *lattice;
  // The thesis's program counts in single precision, its voxels' size included.
  const libmap::ManifestValue* value = manifest.find_parameter("method");
  for (const auto& [known, method] : libgtd::method_names())
    if (value != nullptr && *value == libmap::ManifestValue(known) &&
        libgtd::follows_thesis(method))
      index.lattice.voxel_size_m = static_cast<float>(index.lattice.voxel_size_m);
  index.frame = manifest.frame == "input" ? libgtd::MapFrame::input : libgtd::MapFrame::terrain;
  index.manifest = manifest;
  return index;
}

MapTiles::MapTiles(const std::string& store)
    : MapTiles(without_trailing_slash(store),
               libgtd::finish_tile_store(without_trailing_slash(store))) {}

MapTiles::MapTiles(std::filesystem::path store, libgtd::TileStoreIndex index)
    : store_(std::move(store)), index_(std::move(index)) {
  if (index_.tiles.empty()) throw libmap::Error("the map has no points", {.file = store_.string()});
  float64_positions_ = need_float64();
}

Eigen::AlignedBox3d MapTiles::box(std::size_t tile) const {
  const Eigen::AlignedBox3d box(index_.lattice.center_of(index_.tiles[tile].min),
                                index_.lattice.center_of(index_.tiles[tile].max));
  return index_.frame == libgtd::MapFrame::input
             ? box.transformed(index_.terrain_from_input().inverse())
             : box;
}

// Files hold single precision where that moves no coordinate by more than 1e-5 m. Below 256 m it
// moves none by more than 7.7e-6 m; beyond, the whole map needs double precision if any tile does.
bool MapTiles::need_float64() const {
  Eigen::AlignedBox3d whole;
  for (std::size_t n = 0; n < index_.tiles.size(); ++n) whole.extend(box(n));
  if (std::max(whole.min().cwiseAbs().maxCoeff(), whole.max().cwiseAbs().maxCoeff()) < 256.0)
    return false;
  return std::any_of(index_.tiles.begin(), index_.tiles.end(), [&](const auto& tile) {
    const auto info = libmap::read_cloud_info(libgtd::tile_path(store_, tile));
    return !info.fields.empty() && info.fields.front().type == libmap::ScalarType::float64;
  });
}

libmap::PointCloud MapTiles::read(const std::filesystem::path& file,
                                  const libgtd::StoredTile& tile) const {
  libmap::PointCloud cloud = libmap::read_cloud(file).cloud;
  if (cloud.size() != tile.voxels)
    throw libmap::Error("contains other points than the store's index says",
                        {.file = file.string(),
                         .field = "points",
                         .value = std::to_string(cloud.size()),
                         .bound = std::to_string(tile.voxels)});
  in_file(file.string(), [&] {
    if (float64_positions_) libgtd::restore_positions(index_, cloud);
  });
  return cloud;
}

libmap::PointCloud MapTiles::load(std::size_t tile) const {
  return read(libgtd::tile_path(store_, index_.tiles[tile]), index_.tiles[tile]);
}

libmap::PointCloud MapTiles::load_checked(std::size_t tile) const {
  return read(libgtd::checked_tile_path(store_, index_.tiles[tile]), index_.tiles[tile]);
}

}  // namespace graspmap_tools
