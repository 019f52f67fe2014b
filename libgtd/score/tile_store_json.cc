#include "libgtd/score/tile_store_json.h"

#include <cmath>
#include <cstdint>

#include "libmap/core/json_input.h"

namespace libgtd {

namespace {

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

// Far more than memory holds, and sums over tiles do not overflow.
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

}  // namespace

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
  // Stores of earlier versions call it edge_voxels.
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
  // 64 bits: the numbers may be anything.
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
        "is not of this format",
        {.field = "format", .value = json.at("format").dump(), .bound = format_name});
  if (json.at("version") != format_version)
    throw libmap::Error("is of a version that this graspmap does not read",
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
      throw libmap::Error("tiles do not ascend", {.field = "tiles", .value = tile.file});
    index.tiles.push_back(tile);
  }
  return index;
}

}  // namespace libgtd
