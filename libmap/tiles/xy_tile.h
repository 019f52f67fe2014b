// Tiles of the x-y plane, indexed from the origin.
#pragma once

#include <Eigen/Core>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace libmap {

// Index of a tile: x and y of its lower left corner in units of the tile side.
struct XyTile {
  std::int64_t i = 0;
  std::int64_t j = 0;

  auto operator<=>(const XyTile&) const = default;
};

// Returns the tile of side `tile_m` that contains a position, m.
XyTile xy_tile_at(const Eigen::Vector2d& position, double tile_m);

std::string tile_file_name(const XyTile& tile, const std::string& extension);  // "piece_3_0.pcd"
bool is_tile_file_name(const std::string& name);  // true for "piece_I_J.EXT", any extension

// Returns the names of the tile files in `folder`, unsorted; none if there is no such folder.
std::vector<std::string> tile_file_names(const std::filesystem::path& folder);

}  // namespace libmap
