#include "tools/support/map_window.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "libgtd/score/graspability_map.h"
#include "libgtd/score/map_downsampling.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace graspmap_tools {

namespace {

// A tile that the window shows, and how much of its plan lies in it.
struct SeenTile {
  std::size_t tile = 0;
  double share = 1.0;
};

std::vector<SeenTile> seen_tiles(const MapTiles& tiles,
                                 const std::optional<Eigen::AlignedBox2d>& box) {
  std::vector<SeenTile> seen;
  for (std::size_t n = 0; n < tiles.index().tiles.size(); ++n) {
    if (!box) {
      seen.push_back({n, 1.0});
      continue;
    }
    const double half = 0.5 * tiles.index().lattice.voxel_size_m;
    const Eigen::AlignedBox3d around = tiles.box(n);
    const Eigen::AlignedBox2d plan(around.min().head<2>().array() - half,
                                   around.max().head<2>().array() + half);
    const Eigen::AlignedBox2d common = plan.intersection(*box);
    if (!common.isEmpty()) seen.push_back({n, common.volume() / plan.volume()});
  }
  return seen;
}

int columns_per_point(const MapTiles& tiles, const std::vector<SeenTile>& seen,
                      std::uint64_t max_points) {
  double points = 0.0;
  for (const SeenTile& one : seen)
    points += one.share * static_cast<double>(tiles.index().tiles[one.tile].voxels);
  const double columns = std::ceil(std::sqrt(points / static_cast<double>(max_points)));
  // The counts are the index's word; no map has more points than 2^40.
  return columns >= 1.0 ? static_cast<int>(std::min(columns, 0x1p20)) : 1;
}

}  // namespace

std::optional<Eigen::AlignedBox2d> parse_rectangle(const std::string& text) {
  if (text.empty()) return std::nullopt;
  std::vector<double> numbers;
  std::size_t begin = 0;
  while (begin <= text.size() && numbers.size() < 5) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const auto number = libmap::parse_double(text.substr(begin, comma - begin));
    if (!number || !std::isfinite(*number)) break;
    numbers.push_back(*number);
    begin = comma + 1;
  }
  if (numbers.size() != 4 || begin <= text.size() || !(numbers[0] < numbers[2]) ||
      !(numbers[1] < numbers[3]))
    throw libmap::Error(
        "not a rectangle",
        {.field = "--box", .value = text, .bound = "X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1"});
  return Eigen::AlignedBox2d(Eigen::Vector2d(numbers[0], numbers[1]),
                             Eigen::Vector2d(numbers[2], numbers[3]));
}

libmap::PointCloud points_in_box(const libmap::PointCloud& cloud, const Eigen::AlignedBox2d& box) {
  std::vector<std::size_t> inside;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (box.contains(cloud.positions[n].head<2>())) inside.push_back(n);
  return libmap::select_points(cloud, inside);
}

MapWindow read_window(const MapTiles& tiles, const std::optional<Eigen::AlignedBox2d>& box,
                      std::uint64_t max_points) {
  const std::vector<SeenTile> seen = seen_tiles(tiles, box);
  MapWindow window;
  window.columns_per_point = columns_per_point(tiles, seen, max_points);
  std::vector<libmap::PointCloud> parts(seen.size());
  libmap::parallel_for(seen.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      parts[n] = tiles.load(seen[n].tile);
      if (box) parts[n] = points_in_box(parts[n], *box);
      if (window.columns_per_point > 1)
        parts[n] = libgtd::downsample_map(parts[n], window.columns_per_point);
    }
  });
  if (!parts.empty()) window.cloud = libgtd::merge_map_clouds(parts);
  if (window.cloud.empty())
    throw libmap::Error("nothing of the map lies in it", {.field = "--box"});
  if (window.columns_per_point > 1) {
    window.cloud = libgtd::downsample_map(window.cloud, window.columns_per_point);
    libgtd::center_in_squares(tiles.index(), window.columns_per_point, window.cloud);
  }
  return window;
}

}  // namespace graspmap_tools
