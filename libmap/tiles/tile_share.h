// Shares of the tiles: each of several runs makes one.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace libmap {

// Share `number` of `count`, from 1 on. All shares together are all tiles.
struct TileShare {
  int number = 1;
  int count = 1;
};

// "K/N". parse_share throws Error naming --tile.
TileShare parse_share(const std::string& text);
std::string to_text(const TileShare& share);

// The share's first tile, and the one after its last. Throws Error naming `tile`.
std::pair<std::size_t, std::size_t> share_range(std::size_t tiles, const TileShare& share);

// A run of neighbors in the order of `tiles`. Throws as share_range.
template <typename Tile>
std::vector<Tile> share_of(const std::vector<Tile>& tiles, const TileShare& share) {
  const auto [begin, end] = share_range(tiles.size(), share);
  return {tiles.begin() + static_cast<std::ptrdiff_t>(begin),
          tiles.begin() + static_cast<std::ptrdiff_t>(end)};
}

}  // namespace libmap
