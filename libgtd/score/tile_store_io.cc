#include "libgtd/score/tile_store_io.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/json_input.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* format_name = "graspmap tile store";
constexpr int format_version = 1;

Voxel voxel_from(const Json& json) {
  const auto at = [&](std::size_t axis) {
    return libmap::integer_of<int>(json.at(axis), "a voxel's index");
  };
  return {at(0), at(1), at(2)};
}

void require(bool holds, const std::string& field, const std::string& value,
             const std::string& bound) {
  if (!holds) throw libmap::Error("out of range", {.field = field, .value = value, .bound = bound});
}

void require_room(const Voxel& voxel, const char* field) {
  for (const int index : {voxel.i, voxel.j, voxel.k})
    require(std::abs(static_cast<double>(index)) <= 0x1p29, field, std::to_string(index),
            "within +-2^29");
}

// Rejects counts larger than any memory, so that sums over tiles do not overflow.
std::uint64_t voxel_count_at(const Json& json, const char* key) {
  const auto count = libmap::integer_at<std::uint64_t>(json, key);
  require(count <= std::uint64_t{1} << 36U, key, std::to_string(count), "<= 2^36");
  return count;
}

void require_within(const TileNumber& tile, const TileStoreIndex& index) {
  const TileNumber low = tile_of(index.min, index.tile_voxels);
  const TileNumber high = tile_of(index.max, index.tile_voxels);
  require(tile.i >= low.i && tile.i <= high.i && tile.j >= low.j && tile.j <= high.j,
          "number of a tile", std::to_string(tile.i) + ", " + std::to_string(tile.j),
          "within min and max of the map");
}

Json json_of(const Voxel& voxel) { return {voxel.i, voxel.j, voxel.k}; }

Json json_of(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

Eigen::Vector3d vector_from(const Json& json) {
  const auto numbers = json.get<std::array<double, 3>>();
  return {numbers[0], numbers[1], numbers[2]};
}

Json json_of(const StoredTile& tile) {
  Json json;
  json["i"] = tile.number.i;
  json["j"] = tile.number.j;
  json["min"] = json_of(tile.min);
  json["max"] = json_of(tile.max);
  json["voxels"] = tile.voxels;
  json["occupied_voxels"] = tile.occupied_voxels;
  json["border_voxels"] = tile.border_voxels;
  json["graspable_voxels"] = tile.graspable_voxels;
  json["file"] = tile.file;
  json["bytes"] = tile.bytes;
  json["sha256"] = tile.sha256;
  return json;
}

StoredTile tile_from(const Json& json, const TileStoreIndex& index) {
  const int tile_voxels = index.tile_voxels;
  StoredTile tile;
  tile.number = {libmap::integer_at<int>(json, "i"), libmap::integer_at<int>(json, "j")};
  tile.min = voxel_from(json.at("min"));
  tile.max = voxel_from(json.at("max"));
  tile.voxels = voxel_count_at(json, "voxels");
  tile.occupied_voxels = voxel_count_at(json, "occupied_voxels");
  // The key is called edge_voxels in stores of earlier versions.
  tile.border_voxels =
      voxel_count_at(json, json.contains("edge_voxels") ? "edge_voxels" : "border_voxels");
  tile.graspable_voxels = voxel_count_at(json, "graspable_voxels");
  tile.file = json.at("file").get<std::string>();
  tile.bytes = libmap::integer_at<std::uint64_t>(json, "bytes");
  tile.sha256 = json.at("sha256").get<std::string>();
  for (const int number : {tile.number.i, tile.number.j})
    require(std::abs(static_cast<double>(number) * tile_voxels) <= 0x1p30, "number of a tile",
            std::to_string(number), "columns within +-2^30");
  require_within(tile.number, index);
  const std::string name = std::to_string(tile.number.i) + ", " + std::to_string(tile.number.j);
  if (tile.voxels == 0) {
    require(tile.file.empty(), "file of tile " + name, tile.file, "empty: it has no voxels");
    return tile;
  }
  // 64 bits, because the numbers are not checked yet.
  const auto is_between = [&](std::int64_t first, std::int64_t low, std::int64_t high) {
    return low >= first * tile_voxels && high < (first + 1) * tile_voxels && low <= high;
  };
  require(is_between(tile.number.i, tile.min.i, tile.max.i) &&
              is_between(tile.number.j, tile.min.j, tile.max.j) && tile.min.k <= tile.max.k,
          "min and max of tile " + name, Json(json.at("min")).dump(), "within the tile");
  require(tile.file == tile_file_of(tile.number), "file of tile " + name, tile.file,
          tile_file_of(tile.number));
  return tile;
}

Json json_of(const TileStoreIndex& index) {
  Json json;
  json["format"] = format_name;
  json["version"] = format_version;
  json["key"] = index.key;
  json["lattice"] = {{"origin_m", json_of(index.lattice.origin_m)},
                     {"voxel_size_m", index.lattice.voxel_size_m}};
  json["tile_voxels"] = index.tile_voxels;
  json["min"] = json_of(index.min);
  json["max"] = json_of(index.max);
  json["map"] = Json::parse(libmap::to_json(index.manifest));
  json["map"].erase("run");
  json["tiles"] = Json::array();
  for (const StoredTile& tile : index.tiles) json["tiles"].push_back(json_of(tile));
  return json;
}

TileStoreIndex index_from(const Json& json, const std::string& file) {
  if (json.at("format") != format_name)
    throw libmap::Error(
        "not the format of a tile store",
        {.field = "format", .value = json.at("format").dump(), .bound = format_name});
  if (json.at("version") != format_version)
    throw libmap::Error("unsupported version of a tile store",
                        {.field = "version",
                         .value = json.at("version").dump(),
                         .bound = std::to_string(format_version)});
  TileStoreIndex index;
  index.key = json.at("key").get<std::string>();
  index.lattice.origin_m = vector_from(json.at("lattice").at("origin_m"));
  index.lattice.voxel_size_m = json.at("lattice").at("voxel_size_m").get<double>();
  require(index.lattice.voxel_size_m > 0.0, "voxel_size_m",
          libmap::to_text(index.lattice.voxel_size_m), "> 0");
  index.tile_voxels = libmap::integer_at<int>(json, "tile_voxels");
  require(index.tile_voxels >= 1 && index.tile_voxels <= 1 << 20, "tile_voxels",
          std::to_string(index.tile_voxels), "1 to 2^20");
  index.min = voxel_from(json.at("min"));
  index.max = voxel_from(json.at("max"));
  require_room(index.min, "min");
  require_room(index.max, "max");
  require(index.min.i <= index.max.i && index.min.j <= index.max.j && index.min.k <= index.max.k,
          "min", Json(json.at("min")).dump(), "<= max, " + Json(json.at("max")).dump());
  index.manifest = libmap::parse_manifest(json.at("map").dump(), file);
  index.frame = index.manifest.frame == "input" ? MapFrame::input : MapFrame::terrain;
  for (const Json& one : json.at("tiles")) {
    const StoredTile tile = tile_from(one, index);
    if (!index.tiles.empty() && !(index.tiles.back().number < tile.number))
      throw libmap::Error("not in ascending order of i and j",
                          {.field = "tiles", .value = tile.file});
    index.tiles.push_back(tile);
  }
  return index;
}

// Parses `text` and calls read(json); converts all errors to Error naming `file`.
template <typename Read>
auto read_json(const std::string& text, const std::string& file, const char* what,
               const Read& read) {
  try {
    return read(libmap::parse_json<Json>(text));
  } catch (const nlohmann::json::exception& error) {
    // Format: "[json.exception.KIND.NUMBER] REASON"
    const std::string reason = error.what();
    throw libmap::Error(
        std::string("is not a valid ") + what + ": " + reason.substr(reason.find("] ") + 2),
        {.file = file});
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
}

constexpr const char* plan_format = "graspmap tile store progress";
constexpr int plan_version = 1;
constexpr std::uint64_t max_index_bytes = std::uint64_t{1} << 33;

fs::path require_store(const fs::path& store) {
  if (!fs::exists(store)) throw libmap::Error("no such tile store", {.file = store.string()});
  if (!fs::is_directory(store))
    throw libmap::Error("is a file, not a tile store", {.file = store.string()});
  return store / "index.json";
}

// Error with the progress of an unfinished run.
libmap::Error not_complete(const fs::path& folder) {
  const MapTileStore store(folder);
  const auto plan = store.plan();
  if (!plan) return libmap::Error("is not a tile store: no index.json", {.file = folder.string()});
  const MapTileStore::Completion completion = store.complete(*plan);
  if (completion.index)
    return libmap::Error("has all tiles but no index.json; score again to write it",
                         {.file = folder.string()});
  return libmap::Error("is not complete: " + std::to_string(completion.done) + " of " +
                           std::to_string(completion.tiles) +
                           " tiles are done; score again to add the others",
                       {.file = folder.string()});
}

// Removes tiles without voxels, which have no file: a plan lists them, an index does not.
TileStoreIndex listed(TileStoreIndex index) {
  for (const StoredTile& tile : index.tiles)
    if (tile.voxels == 0)
      throw libmap::Error(
          "contains a tile without voxels",
          {.field = "tiles",
           .value = std::to_string(tile.number.i) + ", " + std::to_string(tile.number.j)});
  return index;
}

Json json_of(const TerrainFile& file) {
  Json json;
  json["path"] = file.input.path;
  json["sha256"] = file.input.sha256;
  json["bytes"] = file.input.bytes;
  json["modified_ns"] = file.modified_ns;
  json["points"] = file.points;
  json["dropped_points"] = file.dropped_points;
  json["min"] = json_of(file.box.min);
  json["max"] = json_of(file.box.max);
  return json;
}

TerrainFile terrain_file_from(const Json& json) {
  TerrainFile file;
  file.input.path = json.at("path").get<std::string>();
  file.input.sha256 = json.at("sha256").get<std::string>();
  file.input.bytes = libmap::integer_at<std::uint64_t>(json, "bytes");
  file.modified_ns = libmap::integer_at<std::int64_t>(json, "modified_ns");
  file.points = libmap::integer_at<std::uint64_t>(json, "points");
  file.dropped_points = libmap::integer_at<std::uint64_t>(json, "dropped_points");
  file.box.min = vector_from(json.at("min"));
  file.box.max = vector_from(json.at("max"));
  if (file.points > 0 && !(file.box.min.array() <= file.box.max.array()).all())
    throw libmap::Error("not a box",
                        {.field = "min, max of cloud " + file.input.path,
                         .value = Json(json.at("min")).dump() + ", " + Json(json.at("max")).dump(),
                         .bound = "min <= max"});
  return file;
}

TilePlan plan_from(const Json& json, const std::string& file) {
  if (json.at("format") != plan_format || json.at("version") != plan_version)
    throw libmap::Error("unsupported tile store plan",
                        {.field = "format, version",
                         .value = json.at("format").dump() + ", " + json.at("version").dump(),
                         .bound = Json(plan_format).dump() + ", " + std::to_string(plan_version)});
  TilePlan plan;
  plan.index = index_from(json.at("index"), file);
  plan.key = plan.index.key;
  plan.has_plane = json.contains("plane_centroid_m");
  if (plan.has_plane) plan.centroid = vector_from(json.at("plane_centroid_m"));
  for (const Json& one : json.at("pieces")) plan.terrain.push_back(terrain_file_from(one));
  plan.kept = std::exchange(plan.index.tiles, {});
  return plan;
}

std::size_t count_tiles(const TileStoreIndex& index) {
  const TileNumber first = tile_of(index.min, index.tile_voxels);
  const TileNumber last = tile_of(index.max, index.tile_voxels);
  return static_cast<std::size_t>(1 + last.i - first.i) *
         static_cast<std::size_t>(1 + last.j - first.j);
}

// Adds the counts of all tiles, including those without a scored voxel. Results that are already
// set are kept.
void add_totals(const std::map<TileNumber, StoredTile>& tiles, TileStoreIndex& index) {
  std::uint64_t occupied = 0, border = 0, graspable = 0;
  for (const auto& [number, tile] : tiles) {
    occupied += tile.occupied_voxels;
    border += tile.border_voxels;
    graspable += tile.graspable_voxels;
  }
  auto& results = index.manifest.results;
  const auto add = [&](const char* name, std::uint64_t count) {
    if (index.manifest.find_result(name) == nullptr)
      results.emplace_back(name, static_cast<std::int64_t>(count));
  };
  add("occupied_voxels", occupied);
  add("scored_voxels", index.voxels());
  add("border_voxels", border);
  add("graspable_voxels", graspable);
}

libmap::Error not_the_tile(const fs::path& path, libmap::ErrorContext context) {
  context.file = path.string();
  return libmap::Error("differs from the tile in the index; score again to replace it",
                       std::move(context));
}

}  // namespace

bool is_tile_store_name(const fs::path& path) {
  const fs::path name = path.has_filename() ? path.filename() : path.parent_path().filename();
  return name.extension() == ".tiles";
}

TileStoreIndex read_tile_store(const fs::path& store) {
  const fs::path path = require_store(store);
  if (!fs::exists(path)) throw not_complete(store);
  const std::string text = libmap::read_whole_file(path, max_index_bytes);
  return read_json(text, path.string(), "index of a tile store",
                   [&](const Json& json) { return listed(index_from(json, path.string())); });
}

TileStoreIndex finish_tile_store(const fs::path& folder) {
  const fs::path path = require_store(folder);
  if (fs::exists(path)) return read_tile_store(folder);
  const MapTileStore store(folder);
  if (!store.plan()) throw not_complete(folder);
  const libmap::FileLock lock = store.lock();
  if (const auto plan = store.plan()) {
    const MapTileStore::Completion completion = store.complete(*plan);
    if (completion.index) store.write_index(*completion.index);
  }
  return read_tile_store(folder);
}

fs::path tile_path(const fs::path& store, const StoredTile& tile) {
  fs::path path = store / tile.file;
  libmap::require_readable_file(path);
  const std::uint64_t bytes = fs::file_size(path);
  if (bytes != tile.bytes)
    throw not_the_tile(path, {.field = "size",
                              .value = std::to_string(bytes) + " bytes",
                              .bound = std::to_string(tile.bytes)});
  return path;
}

fs::path checked_tile_path(const fs::path& store, const StoredTile& tile) {
  fs::path path = tile_path(store, tile);
  if (libmap::sha256_of_file(path) != tile.sha256) throw not_the_tile(path, {.field = "SHA-256"});
  return path;
}

std::optional<TilePlan> MapTileStore::plan() const {
  const auto text = plan_text();
  if (!text) return std::nullopt;
  const std::string file = plan_path().string();
  return read_json(*text, file, "plan of a tile store",
                   [&](const Json& json) { return plan_from(json, file); });
}

void MapTileStore::set_plan(const TilePlan& plan) const {
  TileStoreIndex index = plan.index;
  index.key = plan.key;
  index.tiles = plan.kept;
  Json json;
  json["format"] = plan_format;
  json["version"] = plan_version;
  if (plan.has_plane) json["plane_centroid_m"] = json_of(plan.centroid);
  json["pieces"] = Json::array();
  for (const TerrainFile& file : plan.terrain) json["pieces"].push_back(json_of(file));
  json["index"] = json_of(index);
  write_plan(json.dump(1) + "\n");
}

std::map<TileNumber, StoredTile> MapTileStore::done(const TilePlan& plan) const {
  std::map<TileNumber, StoredTile> done;
  for (const StoredTile& tile : plan.kept) done[tile.number] = tile;
  each_line([&](const std::string& text, const Line&) {
    try {
      const auto json = libmap::parse_json<Json>(text);
      if (json.at("key") != plan.key) return;
      const StoredTile tile = tile_from(json, plan.index);
      done[tile.number] = tile;
    } catch (const nlohmann::json::exception&) {
      return;
    } catch (const libmap::Error&) {
      return;
    }
  });
  return done;
}

std::vector<TileNumber> MapTileStore::missing(const TilePlan& plan,
                                              const std::vector<TileNumber>& tiles) const {
  const std::map<TileNumber, StoredTile> finished = done(plan);
  std::vector<std::uint8_t> is_there(tiles.size(), 0);
  libmap::parallel_each(tiles.size(), 16, [&](std::size_t n) {
    const auto found = finished.find(tiles[n]);
    if (found == finished.end()) return;
    try {
      if (found->second.voxels > 0) checked_tile_path(folder(), found->second);
      is_there[n] = 1;
    } catch (const libmap::Error&) {
      return;
    }
  });
  std::vector<TileNumber> missing;
  for (std::size_t n = 0; n < tiles.size(); ++n)
    if (is_there[n] == 0) missing.push_back(tiles[n]);
  return missing;
}

MapTileStore::Completion MapTileStore::complete(const TilePlan& plan) const {
  const std::map<TileNumber, StoredTile> tiles = done(plan);
  Completion completion{
      .index = std::nullopt, .done = tiles.size(), .tiles = count_tiles(plan.index)};
  if (completion.done < completion.tiles) return completion;
  completion.index = plan.index;
  completion.index->key = plan.key;
  for (const auto& [number, tile] : tiles)
    if (tile.voxels > 0) completion.index->tiles.push_back(tile);
  add_totals(tiles, *completion.index);
  return completion;
}

void MapTileStore::write_index(const TileStoreIndex& index, const libmap::Manifest& run) const {
  if (fs::exists(index_path())) return;
  libmap::Manifest manifest = index.manifest;
  manifest.timings_s = run.timings_s;
  manifest.threads = run.threads;
  libmap::write_whole_file(libmap::manifest_path(folder()), libmap::to_json(manifest));
  libmap::write_whole_file(index_path(), json_of(index).dump(1) + "\n");
}

void add_tiles(const std::vector<StoredTile>& tiles, const std::string& key,
               libmap::TileJournal& journal) {
  std::vector<std::string> lines;
  for (const StoredTile& tile : tiles) {
    Json json = json_of(tile);
    json["key"] = key;
    lines.push_back(json.dump());
  }
  journal.add(lines);
}

}  // namespace libgtd
