#include "libmap/tiles/tile_share.h"

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

TileShare parse_share(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto number = parse_integer(text.substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : parse_integer(text.substr(slash + 1));
  if (!number || !count || *count < 1 || *number < 1 || *number > *count || *count > 1000000)
    throw Error("not a share of the tiles",
                {.field = "--tile", .value = text, .bound = "K/N with 1 <= K <= N <= 1000000"});
  return {static_cast<int>(*number), static_cast<int>(*count)};
}

std::string to_text(const TileShare& share) {
  return std::to_string(share.number) + "/" + std::to_string(share.count);
}

std::pair<std::size_t, std::size_t> share_range(std::size_t tiles, const TileShare& share) {
  if (share.count < 1 || share.number < 1 || share.number > share.count)
    throw Error("not a share of the tiles",
                {.field = "tile", .value = to_text(share), .bound = "K/N with 1 <= K <= N"});
  const auto number = static_cast<std::size_t>(share.number);
  const auto count = static_cast<std::size_t>(share.count);
  return {tiles * (number - 1) / count, tiles * number / count};
}

}  // namespace libmap
