#include "tools/support/merge_tiles.h"

#include "libgtd/score/graspability_map.h"
#include "libgtd/score/tile_store.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/parallel.h"
#include "libmap/raster/dem_reader.h"
#include "tools/support/command_line.h"
#include "tools/support/raster_output.h"

using namespace graspmap_tools;

namespace {

libmap::Manifest manifest_of(const std::string& tile) {
  const auto manifest = libmap::read_manifest_of(tile);
  if (!manifest)
    throw libmap::Error("no manifest beside it: it is not a tile that `graspmap score` wrote",
                        {.file = tile});
  return *manifest;
}

// The first parameter of `one` that `other` does not have with the same value.
std::optional<std::string> differing_parameter(const libmap::Manifest& one,
                                               const libmap::Manifest& other) {
  for (const auto& [key, value] : one.parameters) {
    if (key == "tile") continue;
    const libmap::ManifestValue* found = other.find_parameter(key);
    if (found == nullptr || *found != value) return key;
  }
  return std::nullopt;
}

// What all shares of one map have in common.
void require_same_map(const libmap::Manifest& first, const libmap::Manifest& other,
                      const std::string& first_name, const std::string& name) {
  // Another version may score the same points otherwise.
  if (other.version != first.version)
    throw libmap::Error(
        "was scored by another version than " + first_name,
        {.file = name, .field = "version", .value = other.version, .bound = first.version});
  std::optional<std::string> key = differing_parameter(first, other);
  if (!key) key = differing_parameter(other, first);  // one that only the other has
  if (key) throw libmap::Error("differs from that of " + first_name, {.file = name, .field = *key});
  // The terrain and the gripper file.
  const auto same = [](const libmap::ManifestInput& a, const libmap::ManifestInput& b) {
    return a.sha256 == b.sha256;
  };
  if (first.inputs.empty() || !std::equal(first.inputs.begin(), first.inputs.end(),
                                          other.inputs.begin(), other.inputs.end(), same))
    throw libmap::Error("was scored from other inputs than " + first_name, {.file = name});
}

// "K/N"; empty if it is none.
std::string share_of(const libmap::Manifest& manifest) {
  const auto* share = std::get_if<std::string>(manifest.find_parameter("tile"));
  return share == nullptr ? std::string() : *share;
}

// One of several.
bool is_share(const libmap::Manifest& manifest) {
  const std::string share = share_of(manifest);
  return !share.empty() && !share.ends_with("/1");
}

// The shares K/N of the parts are 1 to N, each once.
void require_all_shares(const std::vector<libmap::Manifest>& manifests,
                        const std::vector<std::string>& names) {
  std::vector<std::string> shares;
  std::string count;
  for (std::size_t n = 0; n < manifests.size(); ++n) {
    const std::string share = share_of(manifests[n]);
    const std::string of = share.substr(std::min(share.find('/') + 1, share.size()));
    if (n > 0 && of != count)
      throw libmap::Error("is not a share of the same tiles",
                          {.file = names[n], .field = "tile", .value = share});
    count = of;
    for (const std::string& seen : shares)
      if (seen == share)
        throw libmap::Error("two files contain this share",
                            {.file = names[n], .field = "tile", .value = share});
    shares.push_back(share);
  }
  if (std::to_string(shares.size()) != count)
    throw libmap::Error(fmt::format("{} of {} shares are given", shares.size(), count),
                        {.field = "tile"});
}

void copy_common_facts(const libmap::Manifest& part, libmap::Manifest& whole) {
  for (const auto& parameter : part.parameters)
    if (parameter.first != "tile") whole.parameters.push_back(parameter);
  whole.frame = part.frame;
  whole.transforms = part.transforms;
  whole.georeference = part.georeference;
  for (const char* name : {"lattice_origin_m", "plane_rmse_m", "up_source", "input_points",
                           "occupied_voxels", "mask_side_voxels", "mask_layers", "normal_radius_m"})
    if (const libmap::ManifestValue* value = part.find_result(name))
      whole.results.emplace_back(name, *value);
}

// Single precision in some shares' files and double in others would meet in the whole.
void restore_full_precision(const libmap::Manifest& part, libmap::PointCloud& whole) {
  if (const auto index = index_of(part)) libgtd::restore_positions(*index, whole);
}

// Points whose flag is set.
std::int64_t count_of(const libmap::PointCloud& map, const char* flag) {
  const libmap::ScalarField* field = map.find_field(flag);
  return field == nullptr ? 0 : std::count(field->values.begin(), field->values.end(), 1.0);
}

// A share has slopes alone: obstacles are evaluated by the whole map.
void evaluate_obstacles(const libmap::Manifest& part, libmap::PointCloud& whole, Run& run) {
  if (whole.find_field("slope_deg") == nullptr) return;
  const auto number = [](const libmap::ManifestValue* value) {
    return libmap::number_of(value).value_or(0.0);
  };
  const auto parameter = [&](const char* name) { return number(part.find_parameter(name)); };
  const std::size_t count =
      libgtd::add_obstacles(whole, parameter("voxel_size_m"),
                            {.slope_deg = parameter("obstacle_slope_deg"),
                             .height_m = parameter("obstacle_height_m"),
                             .normal_radius_m = number(part.find_result("normal_radius_m"))});
  run.add_results({{"obstacle_voxels", count}});
  run.say("{} voxels are obstacles", count);
}

// The tiles of a store that share their i, one after the other: consecutive in the map's order.
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

libmap::PointCloud joined(const std::vector<libmap::PointCloud>& parts, const std::string& name) {
  return in_file(name, [&] { return libgtd::merge_map_clouds(parts); });
}

libmap::PointCloud load_row(const MapTiles& tiles, const std::string& store, const TileRow& row) {
  std::vector<libmap::PointCloud> parts(row.end - row.begin);
  libmap::parallel_each(parts.size(),
                        [&](std::size_t n) { parts[n] = tiles.load_checked(row.begin + n); });
  return joined(parts, store);
}

void merge_store(const std::string& store, const std::string& output, const MergeOptions& options,
                 Run& run) {
  const libmap::CloudWriteOptions& writing = options.writing;
  if (libmap::format_of(output) == ".pcd" && writing.encoding != libmap::FileEncoding::binary)
    throw libmap::Error("a tile store is written as binary .pcd",
                        {.file = output, .field = "--encoding"});
  const MapTiles tiles(store);
  const libgtd::TileStoreIndex& index = tiles.index();
  copy_common_facts(index.manifest, run.manifest());
  run.manifest().inputs = index.manifest.inputs;
  run.add_input(store_index_path(store));
  run.add_results({{"scored_voxels", index.voxels()},
                   {"border_voxels", index.border_voxels()},
                   {"graspable_voxels", index.graspable_voxels()}});
  const auto tell = [&] {
    run.say("{} scored voxels from {} tiles", index.voxels(), index.tiles.size());
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

}  // namespace

void graspmap_tools::write_merged(const MapTiles& tiles, const std::string& store,
                                  const std::filesystem::path& file,
                                  const libmap::CloudWriteOptions& writing, Run& run) {
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

bool graspmap_tools::is_part_of_map(const std::string& file) {
  if (is_tile_store(file)) return true;
  const auto manifest = libmap::read_manifest_of(file);
  return manifest && is_share(*manifest);
}

void graspmap_tools::merge_tiles(const std::vector<std::string>& tiles, const std::string& output,
                                 const MergeOptions& options, Run& run) {
  if (!libmap::is_dem_path(output)) libmap::require_cloud_format(output);
  run.claim_output(output, tiles);
  const auto store = std::find_if(tiles.begin(), tiles.end(), is_tile_store);
  if (store != tiles.end()) {
    if (tiles.size() > 1) throw libmap::Error("a tile store is merged by itself", {.file = *store});
    return merge_store(*store, output, options, run);
  }
  std::vector<libmap::Manifest> manifests;
  for (const std::string& tile : tiles) {
    manifests.push_back(manifest_of(tile));
    if (!is_share(manifests.back()))
      throw libmap::Error("is no share of a map, and only shares are merged", {.file = tile});
    require_same_map(manifests.front(), manifests.back(), tiles.front(), tile);
  }
  require_all_shares(manifests, tiles);
  std::vector<libmap::PointCloud> parts;
  parts.reserve(tiles.size());
  for (const std::string& tile : tiles) parts.push_back(libmap::read_cloud(tile).cloud);
  libmap::PointCloud whole = joined(parts, tiles.front());
  restore_full_precision(manifests.front(), whole);
  copy_common_facts(manifests.front(), run.manifest());
  // The terrain and the gripper that the parts were made from, then the parts.
  run.manifest().inputs = manifests.front().inputs;
  for (const std::string& tile : tiles) run.add_input(tile);
  run.add_results({{"scored_voxels", whole.size()},
                   {"border_voxels", count_of(whole, "border")},
                   {"graspable_voxels", count_of(whole, "graspable")}});
  run.say("{} scored voxels from {} files", whole.size(), parts.size());
  in_file(libmap::manifest_path(tiles.front()).string(),
          [&] { evaluate_obstacles(manifests.front(), whole, run); });
  if (libmap::is_dem_path(output)) {
    const auto visit_whole = [&](const auto& visit) { visit(whole); };
    write_raster(output, raster_of(visit_whole, manifests.front(), options.pixel_size_m), run);
    return;
  }
  run.write_output(output, [&](const auto& temporary) {
    libmap::write_cloud(temporary, whole, options.writing);
  });
}
