#include "libmap/tiles/xy_tile.h"

#include <cmath>

#include "libmap/core/text.h"

namespace libmap {

namespace fs = std::filesystem;

XyTile xy_tile_at(const Eigen::Vector2d& position, double tile_m) {
  return {static_cast<std::int64_t>(std::floor(position.x() / tile_m)),
          static_cast<std::int64_t>(std::floor(position.y() / tile_m))};
}

std::string tile_file_name(const XyTile& tile, const std::string& extension) {
  return "piece_" + to_text(tile.i) + "_" + to_text(tile.j) + extension;
}

bool is_tile_file_name(const std::string& name) {
  const std::string start = "piece_";
  const std::size_t between = name.find('_', start.size());
  const std::size_t dot = name.find('.');
  if (name.rfind(start, 0) != 0 || between == std::string::npos || dot == std::string::npos ||
      dot < between || dot != name.rfind('.'))
    return false;
  const auto i = parse_integer(name.substr(start.size(), between - start.size()));
  const auto j = parse_integer(name.substr(between + 1, dot - between - 1));
  return i && j && name == tile_file_name({*i, *j}, name.substr(dot));
}

std::vector<std::string> tile_file_names(const fs::path& folder) {
  std::vector<std::string> names;
  if (!fs::is_directory(folder)) return names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (is_tile_file_name(name)) names.push_back(name);
  }
  return names;
}

}  // namespace libmap
