#include "libmap/io/tile_index.h"

#include <algorithm>

#include "libmap/core/error.h"
#include "libmap/io/cloud_io.h"

namespace libmap {

namespace {

constexpr std::size_t max_kept_points = 4'000'000;

}  // namespace

TileIndex::TileIndex(std::vector<std::filesystem::path> tiles, const Visit& visit) {
  for (std::filesystem::path& path : tiles) {
    CloudReadResult read = read_cloud(path);
    dropped_ += read.dropped_points;
    const PointCloud& cloud = read.cloud;
    if (cloud.empty()) continue;
    if (tiles_.empty()) {
      has_normals_ = cloud.has_normals();
    } else if (cloud.has_normals() != has_normals_) {
      const std::string first = tiles_.front().path.string();
      throw Error(has_normals_ ? "has no normals, but " + first + " has"
                               : "has normals, but " + first + " has none",
                  {.file = path.string()});
    }
    points_ += cloud.size();
    visit(cloud);
    tiles_.push_back({std::move(path), bounds_of(cloud.positions)});
  }
}

const PointCloud& TileIndex::cloud_of(const Tile& tile) {
  const auto kept = std::find_if(kept_.begin(), kept_.end(),
                                 [&](const auto& one) { return one.first == &tile; });
  if (kept != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, kept);
    return kept_.front().second;
  }
  kept_.emplace_front(&tile, read_cloud(tile.path).cloud);
  std::size_t points = 0;
  for (auto one = kept_.begin(); one != kept_.end();) {
    points += one->second.size();
    one = points > max_kept_points && one != kept_.begin() ? kept_.erase(one) : std::next(one);
  }
  return kept_.front().second;
}

PointCloud TileIndex::points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  PointCloud found;
  for (const Tile& tile : tiles_) {
    if ((tile.box.max.head<2>().array() < low.array()).any() ||
        (tile.box.min.head<2>().array() >= high.array()).any())
      continue;
    const PointCloud& cloud = cloud_of(tile);
    std::vector<std::size_t> inside;
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      const auto position = cloud.positions[n].head<2>().array();
      if ((position >= low.array()).all() && (position < high.array()).all()) inside.push_back(n);
    }
    append_cloud(select_points(cloud, inside), found);
  }
  return found;
}

}  // namespace libmap
