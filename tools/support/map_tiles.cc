#include "tools/support/map_tiles.h"

#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/tile_detection.h"
#include "libmap/core/file_output.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/raster/dem_reader.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

bool is_tile_store(const std::string& path) { return libgtd::is_tile_store_name(path); }

std::filesystem::path store_index_path(const std::string& store) {
  return std::filesystem::path(store) / "index.json";
}

std::optional<libgtd::TileStoreIndex> index_of(const libmap::Manifest& manifest) {
  const auto lattice = libgtd::map_info(manifest).lattice;
  if (!lattice) return std::nullopt;
  libgtd::TileStoreIndex index;
  index.lattice = *lattice;
  // The thesis's program computes in single precision, including the voxel size.
  const libmap::ManifestValue* value = manifest.find_parameter("method");
  for (const auto& [known, method] : libgtd::method_names())
    if (value != nullptr && *value == libmap::ManifestValue(known) &&
        libgtd::follows_thesis(method))
      index.lattice.voxel_size_m = static_cast<float>(index.lattice.voxel_size_m);
  index.frame = manifest.frame == "input" ? libgtd::MapFrame::input : libgtd::MapFrame::terrain;
  index.manifest = manifest;
  return index;
}

void write_tile(const std::filesystem::path& store, const libmap::PointCloud& points,
                libgtd::StoredTile& tile) {
  tile.file = libgtd::tile_file_of(tile.number);
  libmap::OutputFile file(store / tile.file);
  libmap::write_named(
      file.temporary_path(), file.final_path(),
      [&](const std::filesystem::path& temporary) { libmap::write_cloud(temporary, points); });
  tile.bytes = std::filesystem::file_size(file.temporary_path());
  tile.sha256 = libmap::sha256_of_file(file.temporary_path());
  file.commit();
}

void require_no_index(const libgtd::MapTileStore& store) {
  if (std::filesystem::exists(store.index_path()))
    throw libmap::Error("has no folder `progress`, so it cannot be resumed; --force replaces it",
                        {.file = store.folder().string()});
}

MapTiles::MapTiles(const std::string& store)
    : MapTiles(without_trailing_slash(store),
               libgtd::finish_tile_store(without_trailing_slash(store))) {}

MapTiles::MapTiles(std::filesystem::path store, libgtd::TileStoreIndex index)
    : store_(std::move(store)), index_(std::move(index)) {
  if (index_.tiles.empty()) throw libmap::no_elements("points of the map", store_);
  float64_positions_ = need_float64();
}

Eigen::AlignedBox3d MapTiles::box(std::size_t tile) const {
  const Eigen::AlignedBox3d box(index_.lattice.center_of(index_.tiles[tile].min),
                                index_.lattice.center_of(index_.tiles[tile].max));
  return index_.frame == libgtd::MapFrame::input
             ? box.transformed(index_.terrain_from_input().inverse())
             : box;
}

// Files have single precision if its rounding is at most 1e-5 m. Below 256 m it is at most 7.7e-6
// m; beyond, the whole map needs double precision if any tile does.
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
    throw libmap::Error("the number of points differs from the store's index",
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

namespace {

// Copies parameters, frame, transforms, and those results of a store that its merged map also has.
void copy_common_entries(const libmap::Manifest& store, libmap::Manifest& whole) {
  for (const auto& parameter : store.parameters)
    if (parameter.first != "tile") whole.parameters.push_back(parameter);
  whole.frame = store.frame;
  whole.transforms = store.transforms;
  whole.georeference = store.georeference;
  for (const char* name : {"lattice_origin_m", "plane_rmse_m", "up_source", "input_points",
                           "occupied_voxels", "mask_side_voxels", "mask_layers", "normal_radius_m"})
    if (const libmap::ManifestValue* value = store.find_result(name))
      whole.results.emplace_back(name, *value);
}

// Range of tiles with the same i, which are consecutive in the map's order.
struct TileRow {
  std::size_t begin = 0;
  std::size_t end = 0;
};
std::vector<TileRow> rows_of(const libgtd::TileStoreIndex& index) {
  std::vector<TileRow> rows;
  for (std::size_t n = 0; n < index.tiles.size(); ++n) {
    if (n == 0 || index.tiles[n].number.i != index.tiles[n - 1].number.i) rows.push_back({n, n});
    rows.back().end = n + 1;
  }
  return rows;
}

libmap::PointCloud load_row(const MapTiles& tiles, const std::string& store, const TileRow& row) {
  std::vector<libmap::PointCloud> parts(row.end - row.begin);
  libmap::parallel_each(parts.size(),
                        [&](std::size_t n) { parts[n] = tiles.load_checked(row.begin + n); });
  return in_file(store, [&] { return libgtd::merge_map_clouds(parts); });
}

}  // namespace

void write_merged(const MapTiles& tiles, const std::string& store,
                  const std::filesystem::path& file, const libmap::GeometryWriteOptions& writing,
                  Run& run) {
  const std::vector<TileRow> rows = rows_of(tiles.index());
  run.progress().begin("merge", rows.size());
  if (libmap::format_of(file) == ".pcd") {
    libmap::PcdPartsWriter writer(
        file, {.points = tiles.index().voxels(), .float64_positions = tiles.float64_positions()});
    for (const TileRow& row : rows) {
      writer.append(load_row(tiles, store, row));
      run.progress().advance(1);
    }
    writer.finish();
  } else {
    libmap::write_cloud(file, load_row(tiles, store, {0, tiles.index().tiles.size()}), writing);
  }
  run.progress().end();
}

void merge_store(const std::string& store, const std::string& output, const MergeOptions& options,
                 Run& run) {
  if (!libmap::is_dem_path(output)) libmap::require_cloud_format(output);
  run.claim_output(output, {store});
  const libmap::GeometryWriteOptions& writing = options.writing;
  if (libmap::format_of(output) == ".pcd" && writing.encoding != libmap::FileEncoding::binary)
    throw libmap::Error("a tile store can be merged only as binary .pcd",
                        {.file = output, .field = "--encoding"});
  const MapTiles tiles(store);
  const libgtd::TileStoreIndex& index = tiles.index();
  copy_common_entries(index.manifest, run.manifest());
  run.manifest().inputs = index.manifest.inputs;
  run.add_input(store_index_path(store));
  run.add_results({{"scored_voxels", index.voxels()},
                   {"border_voxels", index.border_voxels()},
                   {"graspable_voxels", index.graspable_voxels()}});
  const auto tell = [&] {
    run.info("{} scored voxels from {} tiles", index.voxels(), index.tiles.size());
  };
  if (libmap::is_dem_path(output)) {
    const auto visit_rows = [&](const auto& visit) {
      for (const TileRow& row : rows_of(index)) visit(load_row(tiles, store, row));
    };
    write_raster(output, raster_of(visit_rows, index.manifest, options.pixel_size_m), run);
    return tell();
  }
  run.write_output(
      output, [&](const auto& temporary) { write_merged(tiles, store, temporary, writing, run); });
  tell();
}

namespace {

// Direction of columns: the lattice's x or y axis, whichever is nearer to horizontal.
Eigen::Vector2d column_axis_of(const Eigen::Matrix3d& frame_from_lattice) {
  const Eigen::Vector2d x = frame_from_lattice.col(0).head<2>();
  const Eigen::Vector2d y = frame_from_lattice.col(1).head<2>();
  return x.norm() >= y.norm() ? x.normalized() : Eigen::Vector2d(y.y(), -y.x()).normalized();
}

}  // namespace

libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m) {
  libmap::RasterGrid grid;
  grid.pixel_size_m = pixel_size_m;
  if (manifest.georeference)
    grid.frame_from_points =
        site_from_map_of(manifest).value_or(libmap::Pose::Identity()).inverse();
  if (const auto index = index_of(manifest)) {
    if (pixel_size_m == 0.0) grid.pixel_size_m = index->lattice.voxel_size_m;
    const libmap::Pose frame_from_lattice =
        grid.frame_from_points * terrain_from_map(manifest).inverse();
    grid.column_axis = column_axis_of(frame_from_lattice.linear());
    grid.corner_m = (frame_from_lattice * index->lattice.origin_m).head<2>();
  }
  if (grid.pixel_size_m == 0.0)
    throw libmap::Error("is required, because the manifest of the input has no voxel size",
                        {.field = "--pixel-size"});
  libmap::MapRaster raster = libmap::make_map_raster(parts, grid);
  if (manifest.georeference) raster.georeference = *manifest.georeference;
  return raster;
}

void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run) {
  libmap::Manifest& manifest = run.manifest();
  if (manifest.georeference) {
    manifest.frame = "input";
    manifest.transforms.clear();
  }
  run.add_results({{"columns", raster.columns}, {"rows", raster.rows}});
  run.info("{} x {} pixels, {} bands", raster.columns, raster.rows, 1 + raster.bands.size());
  run.write_output(output,
                   [&](const auto& temporary) { libmap::write_map_raster(temporary, raster); });
}

}  // namespace graspmap_tools
