// Divides the tiles of a terrain into shares, which several runs or machines can compute.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace libmap {

// Share number 1, 2, ... of `count` shares, which are disjoint and together contain all tiles.
struct TileShare {
  int number = 1;
  int count = 1;
};

// Parses "K/N": share K of N, 1 <= K <= N <= 10^6. Throws Error naming --tile for other text.
TileShare parse_share(const std::string& text);
std::string to_text(const TileShare& share);  // returns "K/N"

// Returns the range [begin, end) of a share's tile indices. Throws Error if `share` is invalid.
std::pair<std::size_t, std::size_t> share_range(std::size_t tiles, const TileShare& share);

// Returns the consecutive tiles of a share. Throws as share_range does.
template <typename Tile>
std::vector<Tile> share_of(const std::vector<Tile>& tiles, const TileShare& share) {
  const auto [begin, end] = share_range(tiles.size(), share);
  return {tiles.begin() + static_cast<std::ptrdiff_t>(begin),
          tiles.begin() + static_cast<std::ptrdiff_t>(end)};
}

}  // namespace libmap
