// Squares of the x-y plane that count from the origin on: the pieces of what is too large for one
// file.
#pragma once

#include <Eigen/Core>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace libmap {

// Where a square is, in squares from the origin.
struct PlanTile {
  std::int64_t i = 0;
  std::int64_t j = 0;

  auto operator<=>(const PlanTile&) const = default;
};

// The square of side `tile_m` that the place is in.
PlanTile plan_tile_at(const Eigen::Vector2d& place, double tile_m);

std::string piece_file_name(const PlanTile& tile, const std::string& extension);  // "piece_3_0.pcd"
bool is_piece_file_name(const std::string& name);                                 // any extension

// The files in `folder` that are pieces by their names; none if there is no such folder.
std::vector<std::string> piece_file_names(const std::filesystem::path& folder);

}  // namespace libmap
