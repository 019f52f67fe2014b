#include "libgtd/evaluate/tile_lookup.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "libgtd/terrain/voxel_fields.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

constexpr std::size_t points_at_once = std::size_t{1} << 16U;
// Files hold positions to 1e-5 m.
constexpr double rounding_m = 4e-5;
// Far more than any lattice, and no overflow.
constexpr double farthest_cell = 1e9;

Voxel voxel_near(const VoxelLattice& lattice, const Eigen::Vector3d& point_in_terrain) {
  const Eigen::Vector3d cell =
      lattice.cell_of(point_in_terrain).cwiseMax(-farthest_cell).cwiseMin(farthest_cell);
  return {floor_to<int>(cell.x()), floor_to<int>(cell.y()), floor_to<int>(cell.z())};
}

// A tile's points, found by their columns: they ascend by i, then j.
class TilePoints {
 public:
  explicit TilePoints(libmap::PointCloud tile)
      : tile_(std::move(tile)), voxels_(VoxelFields(tile_).all()) {
    if (tile_.empty()) throw libmap::Error("a tile has no points");
    rows_.push_back({voxel(0).i, 0});
    for (std::size_t n = 1; n < tile_.size(); ++n) {
      if (voxel(n) <= voxel(n - 1)) throw libmap::Error("a tile's points are not in order");
      if (voxel(n).i != voxel(n - 1).i) rows_.push_back({voxel(n).i, n});
    }
  }

  TilePoints(const TilePoints&) = delete;
  TilePoints& operator=(const TilePoints&) = delete;

  const libmap::PointCloud& cloud() const { return tile_; }
  const Voxel& voxel(std::size_t n) const { return voxels_[n]; }
  std::vector<double> values(std::size_t n) const {
    std::vector<double> values;
    for (const libmap::ScalarField& field : tile_.fields) values.push_back(field.values[n]);
    return values;
  }

  // Visits the points of the columns up to `reach` columns from that of `middle`, ascending.
  // Returns whether these are all points.
  template <typename Visit>
  bool visit_around(const Voxel& middle, std::int64_t reach, const Visit& visit) const {
    std::size_t visited = 0;
    const auto first = std::lower_bound(rows_.begin(), rows_.end(), middle.i - reach,
                                        [](const Row& row, std::int64_t i) { return row.i < i; });
    for (auto row = first; row != rows_.end() && row->i <= middle.i + reach; ++row) {
      const bool is_last = row + 1 == rows_.end();
      const auto begin = voxels_.begin() + static_cast<std::ptrdiff_t>(row->begin);
      const auto end =
          is_last ? voxels_.end() : voxels_.begin() + static_cast<std::ptrdiff_t>((row + 1)->begin);
      auto at = std::lower_bound(begin, end, middle.j - reach,
                                 [](const Voxel& voxel, std::int64_t j) { return voxel.j < j; });
      for (; at != end && at->j <= middle.j + reach; ++at) {
        visit(static_cast<std::size_t>(at - voxels_.begin()));
        ++visited;
      }
    }
    return visited == tile_.size();
  }

 private:
  // The points of one i. Of those i alone that have any: two points may lie far apart.
  struct Row {
    int i = 0;
    std::size_t begin = 0;
  };

  libmap::PointCloud tile_;
  std::vector<Voxel> voxels_;
  std::vector<Row> rows_;  // ascending
};

struct Place {
  Eigen::Vector3d in_map;
  Eigen::Vector3d in_terrain;
};

// What one tile, or all so far, say of a point.
struct Finding {
  double squared = HUGE_VAL;  // to the nearest map point
  Voxel voxel;
  std::size_t map_point = 0;
  std::vector<double> values;  // of the nearest, or of the best
  std::size_t members = 0;     // within the radius
  std::tuple<double, double, Voxel> best_rank{HUGE_VAL, HUGE_VAL, {}};
  std::size_t best = 0;
  std::vector<std::pair<Voxel, std::vector<double>>> all;  // of the members, for their mean
};

// The nearest point of a tile: windows of columns grow until none beyond can be nearer.
void find_nearest(const TilePoints& tile, const Place& place, const VoxelLattice& lattice,
                  Finding& finding) {
  const Voxel middle = voxel_near(lattice, place.in_terrain);
  for (std::int64_t reach = 1;;) {
    const bool all = tile.visit_around(middle, reach, [&](std::size_t n) {
      const double squared = squared_distance(tile.cloud().positions[n], place.in_map);
      // Ascending: of equals the first stays.
      if (squared < finding.squared || (squared == finding.squared && n < finding.map_point))
        std::tie(finding.squared, finding.map_point) = std::pair(squared, n);
    });
    const double covered = (static_cast<double>(reach) + 0.5) * lattice.voxel_size_m - rounding_m;
    if (all || finding.squared < covered * covered) break;
    const double need = std::isfinite(finding.squared)
                            ? std::sqrt(finding.squared) / lattice.voxel_size_m + 1.0
                            : 0.0;
    reach = std::max(4 * reach, static_cast<std::int64_t>(std::min(need, 4 * farthest_cell)));
  }
  finding.voxel = tile.voxel(finding.map_point);
}

void find_members(const TilePoints& tile, const Place& place, const VoxelLattice& lattice,
                  const LookupOptions& options, Finding& finding) {
  const double squared_radius = options.radius_m * options.radius_m;
  const auto reach = static_cast<std::int64_t>(
      std::min(options.radius_m / lattice.voxel_size_m + 2.0, 4 * farthest_cell));
  const std::vector<double>* scores =
      options.mode == LookupMode::maximum ? &values_of(tile.cloud(), "score") : nullptr;
  tile.visit_around(voxel_near(lattice, place.in_terrain), reach, [&](std::size_t n) {
    const double squared = squared_distance(tile.cloud().positions[n], place.in_map);
    if (squared > squared_radius) return;
    ++finding.members;
    if (scores == nullptr) {
      finding.all.emplace_back(tile.voxel(n), tile.values(n));
      return;
    }
    const auto rank = std::tuple(-(*scores)[n], squared, tile.voxel(n));
    if (rank < finding.best_rank) std::tie(finding.best_rank, finding.best) = std::pair(rank, n);
  });
}

Finding ask_tile(const TilePoints& tile, const Place& place, const VoxelLattice& lattice,
                 const LookupOptions& options) {
  Finding finding;
  find_nearest(tile, place, lattice, finding);
  if (options.mode == LookupMode::nearest) {
    finding.values = tile.values(finding.map_point);
    return finding;
  }
  find_members(tile, place, lattice, options, finding);
  if (options.mode == LookupMode::maximum && finding.members > 0)
    finding.values = tile.values(finding.best);
  return finding;
}

void join(Finding& sum, Finding&& other, LookupMode mode) {
  const bool is_nearer = std::pair(other.squared, other.voxel) < std::pair(sum.squared, sum.voxel);
  const bool is_better = other.best_rank < sum.best_rank;
  if (is_nearer)
    std::tie(sum.squared, sum.voxel, sum.map_point) =
        std::tuple(other.squared, other.voxel, other.map_point);
  if (is_better) std::tie(sum.best_rank, sum.best) = std::pair(other.best_rank, other.best);
  if (mode == LookupMode::nearest ? is_nearer : is_better) sum.values = std::move(other.values);
  sum.members += other.members;
  std::move(other.all.begin(), other.all.end(), std::back_inserter(sum.all));
}

// The mean of each field, summed in the map's order.
std::vector<double> mean_of(std::vector<std::pair<Voxel, std::vector<double>>> all) {
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<double> sums(all.front().second.size(), 0.0);
  for (const auto& [voxel, values] : all)
    for (std::size_t f = 0; f < sums.size(); ++f) sums[f] += values[f];
  for (double& sum : sums) sum /= static_cast<double>(all.size());
  return sums;
}

LookupAnswer answer_of(Finding&& finding, const LookupOptions& options) {
  LookupAnswer answer;
  answer.distance_m = std::sqrt(finding.squared);
  answer.map_point = finding.map_point;
  if (options.mode == LookupMode::nearest) {
    answer.found = answer.distance_m <= options.max_distance_m;
    answer.map_points = answer.found ? 1 : 0;
  } else {
    answer.found = finding.members > 0;
    answer.map_points = finding.members;
  }
  if (!answer.found) return answer;
  if (options.mode == LookupMode::maximum) answer.map_point = finding.best;
  answer.values = options.mode == LookupMode::mean ? mean_of(std::move(finding.all))
                                                   : std::move(finding.values);
  return answer;
}

// Which tiles lie within a distance of a point.
class TileFinder {
 public:
  explicit TileFinder(const TileStoreIndex& index) : index_(index) {
    for (const StoredTile& tile : index.tiles) {
      const Eigen::Vector3d margin = Eigen::Vector3d::Constant(rounding_m);
      boxes_.emplace_back(index.lattice.center_of(tile.min) - margin,
                          index.lattice.center_of(tile.max) + margin);
    }
    low_ = tile_of(index.min, index.tile_voxels);
    high_ = tile_of(index.max, index.tile_voxels);
  }

  double distance(std::size_t tile, const Eigen::Vector3d& point_in_terrain) const {
    return boxes_[tile].exteriorDistance(point_in_terrain);
  }

  // Any tile, a near one where that is easy.
  std::size_t guess(const Eigen::Vector3d& point_in_terrain) const {
    const TileNumber own = number_of(point_in_terrain);
    if (const StoredTile* tile =
            index_.find({std::clamp(own.i, low_.i, high_.i), std::clamp(own.j, low_.j, high_.j)}))
      return position_of(*tile);
    std::size_t nearest = 0;
    for (std::size_t n = 1; n < boxes_.size(); ++n)
      if (distance(n, point_in_terrain) < distance(nearest, point_in_terrain)) nearest = n;
    return nearest;
  }

  // Ascending.
  std::vector<std::size_t> within(const Eigen::Vector3d& point_in_terrain, double reach_m) const {
    std::vector<std::size_t> tiles;
    const auto add = [&](std::size_t tile) {
      if (distance(tile, point_in_terrain) <= reach_m) tiles.push_back(tile);
    };
    const Eigen::Vector3d reach(reach_m + rounding_m, reach_m + rounding_m, 0.0);
    TileNumber first = number_of(point_in_terrain - reach);
    TileNumber last = number_of(point_in_terrain + reach);
    first = {std::max(first.i, low_.i), std::max(first.j, low_.j)};
    last = {std::min(last.i, high_.i), std::min(last.j, high_.j)};
    if (first.i > last.i || first.j > last.j) return tiles;
    const double numbers = (1.0 + last.i - first.i) * (1.0 + last.j - first.j);
    if (numbers > static_cast<double>(boxes_.size())) {
      for (std::size_t n = 0; n < boxes_.size(); ++n) add(n);
      return tiles;
    }
    for (int i = first.i; i <= last.i; ++i)
      for (int j = first.j; j <= last.j; ++j)
        if (const StoredTile* tile = index_.find({i, j})) add(position_of(*tile));
    return tiles;
  }

  TileNumber number_of(const Eigen::Vector3d& point_in_terrain) const {
    return tile_of(voxel_near(index_.lattice, point_in_terrain), index_.tile_voxels);
  }

 private:
  std::size_t position_of(const StoredTile& tile) const {
    return static_cast<std::size_t>(&tile - index_.tiles.data());
  }

  const TileStoreIndex& index_;
  std::vector<Eigen::AlignedBox3d> boxes_;  // in the terrain frame
  TileNumber low_;
  TileNumber high_;
};

class TileLookup {
 public:
  TileLookup(const TileStoreIndex& index, const TileLoader& load, const LookupOptions& options)
      : index_(index), load_(load), options_(options), finder_(index) {
    reach_m_ = index.lattice.voxel_size_m;
    if (options.mode != LookupMode::nearest) reach_m_ = std::max(reach_m_, options.radius_m);
  }

  // Tiles that hold what is near first; then those that may hold something nearer.
  std::vector<Finding> find(const std::vector<Place>& places) const {
    std::vector<Finding> findings(places.size());
    std::vector<Visit> visits;
    for (std::size_t p = 0; p < places.size(); ++p)
      for (const std::size_t tile : first_tiles(places[p])) visits.push_back({tile, p});
    make(std::move(visits), places, findings);
    std::vector<Visit> more;
    for (std::size_t p = 0; p < places.size(); ++p) {
      const double reach = std::sqrt(findings[p].squared);
      if (reach <= reach_m_) continue;
      const std::vector<std::size_t> asked = first_tiles(places[p]);
      for (const std::size_t tile : finder_.within(places[p].in_terrain, reach))
        if (!std::binary_search(asked.begin(), asked.end(), tile)) more.push_back({tile, p});
    }
    make(std::move(more), places, findings);
    return findings;
  }

  TileNumber number_of(const Place& place) const { return finder_.number_of(place.in_terrain); }

 private:
  struct Visit {
    std::size_t tile = 0;
    std::size_t place = 0;
    auto operator<=>(const Visit&) const = default;
  };

  std::vector<std::size_t> first_tiles(const Place& place) const {
    std::vector<std::size_t> tiles = finder_.within(place.in_terrain, reach_m_);
    if (tiles.empty()) tiles.push_back(finder_.guess(place.in_terrain));
    return tiles;
  }

  void make(std::vector<Visit> visits, const std::vector<Place>& places,
            std::vector<Finding>& findings) const {
    std::sort(visits.begin(), visits.end());
    std::vector<std::size_t> starts;  // of each tile's visits
    for (std::size_t v = 0; v < visits.size(); ++v)
      if (v == 0 || visits[v].tile != visits[v - 1].tile) starts.push_back(v);
    starts.push_back(visits.size());
    std::vector<Finding> found(visits.size());
    libmap::parallel_for(starts.size() - 1, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) {
        const TilePoints tile(load_(visits[starts[s]].tile));
        for (std::size_t v = starts[s]; v < starts[s + 1]; ++v)
          found[v] = ask_tile(tile, places[visits[v].place], index_.lattice, options_);
      }
    });
    for (std::size_t v = 0; v < visits.size(); ++v)
      join(findings[visits[v].place], std::move(found[v]), options_.mode);
  }

  const TileStoreIndex& index_;
  const TileLoader& load_;
  const LookupOptions& options_;
  TileFinder finder_;
  double reach_m_ = 0.0;
};

}  // namespace

std::vector<LookupAnswer> look_up_tiles(const TileStoreIndex& index, const TileLoader& load,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const LookupOptions& options, libmap::Progress& progress) {
  libmap::check_parameters(options);
  if (index.tiles.empty()) throw libmap::Error("the map has no points");
  const libmap::Pose terrain_from_map = index.frame == MapFrame::input
                                            ? index.terrain_from_input()
                                            : libmap::Pose(libmap::Pose::Identity());
  const TileLookup lookup(index, load, options);
  std::vector<LookupAnswer> answers(points.size());
  std::vector<std::pair<TileNumber, std::size_t>> order;  // of the points, by their tiles
  for (std::size_t n = 0; n < points.size(); ++n) {
    answers[n].distance_m = HUGE_VAL;
    const Place place{points[n], terrain_from_map * points[n]};
    if (place.in_map.allFinite() && place.in_terrain.allFinite())
      order.emplace_back(lookup.number_of(place), n);
  }
  std::sort(order.begin(), order.end());
  progress.begin("look-up", order.size());
  for (std::size_t first = 0; first < order.size(); first += points_at_once) {
    const std::size_t last = std::min(order.size(), first + points_at_once);
    std::vector<Place> places;
    for (std::size_t n = first; n < last; ++n) {
      const Eigen::Vector3d& point = points[order[n].second];
      places.push_back({point, terrain_from_map * point});
    }
    std::vector<Finding> findings = lookup.find(places);
    for (std::size_t n = first; n < last; ++n)
      answers[order[n].second] = answer_of(std::move(findings[n - first]), options);
    progress.advance(last - first);
  }
  progress.end();
  return answers;
}

}  // namespace libgtd
