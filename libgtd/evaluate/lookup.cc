#include "libgtd/evaluate/lookup.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/spatial_index.h"

namespace libgtd {

namespace {

constexpr std::size_t points_at_once = std::size_t{1} << 16U;
// Tolerance of tile boxes; files contain positions to 1e-5 m.
constexpr double rounding_m = 4e-5;
// Limit of cell indices, larger than any lattice and without overflow.
constexpr double farthest_cell = 1e9;

// Order of the points of a map: by voxel across tiles, by index within a cloud.
using MapOrder = std::pair<Voxel, std::size_t>;

// Map or tile with a search tree. The cloud must outlive it.
class MapPart {
 public:
  // `voxels` are the voxels of a tile's points, in the same order; empty for a whole map.
  explicit MapPart(const libmap::PointCloud& cloud, std::vector<Voxel> voxels = {})
      : cloud_(cloud), voxels_(std::move(voxels)), tree_(cloud.positions) {}

  const libmap::PointCloud& cloud() const { return cloud_; }
  const libmap::PointTree& tree() const { return tree_; }
  MapOrder order_of(std::size_t n) const { return {voxels_.empty() ? Voxel{} : voxels_[n], n}; }
  std::vector<double> values(std::size_t n) const {
    std::vector<double> values;
    values.reserve(cloud_.fields.size());
    for (const libmap::ScalarField& field : cloud_.fields) values.push_back(field.values[n]);
    return values;
  }

 private:
  const libmap::PointCloud& cloud_;
  std::vector<Voxel> voxels_;
  libmap::PointTree tree_;
};

std::vector<Voxel> voxels_of_tile(const libmap::PointCloud& tile) {
  std::vector<Voxel> voxels = VoxelFields(tile).all();
  if (voxels.empty()) throw libmap::no_elements("points of a tile");
  const auto is_not_before = [](const Voxel& a, const Voxel& b) { return !(a < b); };
  if (std::adjacent_find(voxels.begin(), voxels.end(), is_not_before) != voxels.end())
    throw libmap::Error("not in ascending order of i, j, k", {.field = "points of a tile"});
  return voxels;
}

struct Query {
  Eigen::Vector3d in_map;
  Eigen::Vector3d in_terrain;
};

// Points found near a position, in one part of the map or in all parts so far.
struct Finding {
  std::pair<double, MapOrder> nearest{HUGE_VAL, {}};                  // squared distance
  std::tuple<double, double, MapOrder> best{HUGE_VAL, HUGE_VAL, {}};  // -score, squared distance
  std::vector<double> values;                                 // values of the nearest or best point
  std::size_t members = 0;                                    // number within the radius
  std::vector<std::pair<MapOrder, std::vector<double>>> all;  // members, for their mean
};

Finding ask(const MapPart& part, const Eigen::Vector3d& at, const LookupOptions& options) {
  Finding finding;
  const libmap::NeighborPoint nearest = part.tree().first_of_nearest(at);
  finding.nearest = {nearest.square_m2, part.order_of(nearest.index)};
  if (options.mode == LookupMode::nearest) {
    finding.values = part.values(nearest.index);
    return finding;
  }
  const std::vector<double>* scores =
      options.mode == LookupMode::maximum ? &values_of(part.cloud(), "score") : nullptr;
  for (const libmap::NeighborPoint& near : part.tree().within(at, options.radius_m)) {
    ++finding.members;
    if (scores == nullptr)
      finding.all.emplace_back(part.order_of(near.index), part.values(near.index));
    else
      finding.best = std::min(finding.best,
                              {-(*scores)[near.index], near.square_m2, part.order_of(near.index)});
  }
  if (options.mode == LookupMode::maximum && finding.members > 0)
    finding.values = part.values(std::get<2>(finding.best).second);
  return finding;
}

void join(Finding& sum, Finding&& other, LookupMode mode) {
  const bool is_nearer = other.nearest < sum.nearest;
  const bool is_better = other.best < sum.best;
  if (is_nearer) sum.nearest = other.nearest;
  if (is_better) sum.best = other.best;
  if (mode == LookupMode::nearest ? is_nearer : is_better) sum.values = std::move(other.values);
  sum.members += other.members;
  std::move(other.all.begin(), other.all.end(), std::back_inserter(sum.all));
}

// Mean of each field, summed in the order of the map.
std::vector<double> mean_of(std::vector<std::pair<MapOrder, std::vector<double>>> all) {
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<double> sums(all.front().second.size(), 0.0);
  for (const auto& [order, values] : all)
    for (std::size_t f = 0; f < sums.size(); ++f) sums[f] += values[f];
  for (double& sum : sums) sum /= static_cast<double>(all.size());
  return sums;
}

LookupAnswer answer_of(Finding&& finding, const LookupOptions& options) {
  LookupAnswer answer;
  answer.distance_m = std::sqrt(finding.nearest.first);
  answer.map_point = finding.nearest.second.second;
  if (options.mode == LookupMode::nearest) {
    answer.found = answer.distance_m <= options.max_distance_m;
    answer.map_points = answer.found ? 1 : 0;
  } else {
    answer.found = finding.members > 0;
    answer.map_points = finding.members;
  }
  if (!answer.found) return answer;
  if (options.mode == LookupMode::maximum) answer.map_point = std::get<2>(finding.best).second;
  answer.values = options.mode == LookupMode::mean ? mean_of(std::move(finding.all))
                                                   : std::move(finding.values);
  return answer;
}

Voxel voxel_near(const VoxelLattice& lattice, const Eigen::Vector3d& point_in_terrain) {
  const Eigen::Vector3d cell =
      lattice.cell_of(point_in_terrain).cwiseMax(-farthest_cell).cwiseMin(farthest_cell);
  return {floor_to<int>(cell.x()), floor_to<int>(cell.y()), floor_to<int>(cell.z())};
}

// Finds the tiles within a distance of a point.
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

  // Returns any tile, preferably a near one.
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

  // Returns tiles within a distance, ascending.
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
  std::vector<Eigen::AlignedBox3d> boxes_;  // boxes in the terrain frame
  TileNumber low_;
  TileNumber high_;
};

class TileLookup {
 public:
  TileLookup(const TileStoreIndex& index, const TileLoader& load, const LookupOptions& options)
      : load_(load), options_(options), finder_(index) {
    reach_m_ = index.lattice.voxel_size_m;
    if (options.mode != LookupMode::nearest) reach_m_ = std::max(reach_m_, options.radius_m);
  }

  // Searches the tiles within the reach first, then tiles that may contain nearer points.
  std::vector<Finding> find(const std::vector<Query>& queries) const {
    std::vector<Finding> findings(queries.size());
    std::vector<Visit> visits;
    for (std::size_t p = 0; p < queries.size(); ++p)
      for (const std::size_t tile : first_tiles(queries[p])) visits.push_back({tile, p});
    make(std::move(visits), queries, findings);
    std::vector<Visit> more;
    for (std::size_t p = 0; p < queries.size(); ++p) {
      const double reach = std::sqrt(findings[p].nearest.first);
      if (reach <= reach_m_) continue;
      const std::vector<std::size_t> asked = first_tiles(queries[p]);
      for (const std::size_t tile : finder_.within(queries[p].in_terrain, reach))
        if (!std::binary_search(asked.begin(), asked.end(), tile)) more.push_back({tile, p});
    }
    make(std::move(more), queries, findings);
    return findings;
  }

  TileNumber number_of(const Query& query) const { return finder_.number_of(query.in_terrain); }

 private:
  struct Visit {
    std::size_t tile = 0;
    std::size_t query = 0;
    auto operator<=>(const Visit&) const = default;
  };

  std::vector<std::size_t> first_tiles(const Query& query) const {
    std::vector<std::size_t> tiles = finder_.within(query.in_terrain, reach_m_);
    if (tiles.empty()) tiles.push_back(finder_.guess(query.in_terrain));
    return tiles;
  }

  void make(std::vector<Visit> visits, const std::vector<Query>& queries,
            std::vector<Finding>& findings) const {
    std::sort(visits.begin(), visits.end());
    std::vector<std::size_t> starts;  // first visit of each tile
    for (std::size_t v = 0; v < visits.size(); ++v)
      if (v == 0 || visits[v].tile != visits[v - 1].tile) starts.push_back(v);
    starts.push_back(visits.size());
    std::vector<Finding> found(visits.size());
    libmap::parallel_each(starts.size() - 1, [&](std::size_t s) {
      const libmap::PointCloud cloud = load_(visits[starts[s]].tile);
      const MapPart tile(cloud, voxels_of_tile(cloud));
      for (std::size_t v = starts[s]; v < starts[s + 1]; ++v)
        found[v] = ask(tile, queries[visits[v].query].in_map, options_);
    });
    for (std::size_t v = 0; v < visits.size(); ++v)
      join(findings[visits[v].query], std::move(found[v]), options_.mode);
  }

  const TileLoader& load_;
  const LookupOptions& options_;
  TileFinder finder_;
  double reach_m_ = 0.0;
};

}  // namespace

std::vector<std::pair<std::string, LookupMode>> lookup_mode_names() {
  return {{"nearest", LookupMode::nearest},
          {"maximum", LookupMode::maximum},
          {"mean", LookupMode::mean}};
}

void bind(libmap::ParameterTable& table, LookupOptions& options) {
  table.add("mode", options.mode, lookup_mode_names(),
            "map points whose values a location gets; nearest: closest point; maximum: point with "
            "the highest score within --radius; mean: mean of the points within --radius");
  table.add("radius_m", options.radius_m, libmap::positive,
            "radius around a location for modes maximum and mean, m");
  table.add("max_distance_m", options.max_distance_m, libmap::positive,
            "maximum distance of the map point from the location in mode nearest, m");
}

std::vector<LookupAnswer> look_up(const libmap::PointCloud& map,
                                  const std::vector<Eigen::Vector3d>& points,
                                  const LookupOptions& options) {
  libmap::check_parameters(options);
  if (map.empty()) throw libmap::no_elements("points of the map");
  if (options.mode == LookupMode::maximum) values_of(map, "score");
  const MapPart whole(map);
  std::vector<LookupAnswer> answers(points.size());
  libmap::parallel_each(points.size(), 256, [&](std::size_t n) {
    answers[n] =
        answer_of(points[n].allFinite() ? ask(whole, points[n], options) : Finding{}, options);
  });
  return answers;
}

std::vector<LookupAnswer> look_up_tiles(const TileStoreIndex& index, const TileLoader& load,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const LookupOptions& options, libmap::Progress& progress) {
  libmap::check_parameters(options);
  if (index.tiles.empty()) throw libmap::no_elements("points of the map");
  const libmap::Pose terrain_from_map = index.frame == MapFrame::input
                                            ? index.terrain_from_input()
                                            : libmap::Pose(libmap::Pose::Identity());
  const TileLookup lookup(index, load, options);
  std::vector<LookupAnswer> answers(points.size());
  std::vector<std::pair<TileNumber, std::size_t>> order;  // points, by tile
  for (std::size_t n = 0; n < points.size(); ++n) {
    answers[n].distance_m = HUGE_VAL;
    const Query query{points[n], terrain_from_map * points[n]};
    if (query.in_map.allFinite() && query.in_terrain.allFinite())
      order.emplace_back(lookup.number_of(query), n);
  }
  std::sort(order.begin(), order.end());
  progress.begin("look-up", order.size());
  for (std::size_t first = 0; first < order.size(); first += points_at_once) {
    const std::size_t last = std::min(order.size(), first + points_at_once);
    std::vector<Query> queries;
    for (std::size_t n = first; n < last; ++n) {
      const Eigen::Vector3d& point = points[order[n].second];
      queries.push_back({point, terrain_from_map * point});
    }
    std::vector<Finding> findings = lookup.find(queries);
    for (std::size_t n = first; n < last; ++n)
      answers[order[n].second] = answer_of(std::move(findings[n - first]), options);
    progress.advance(last - first);
  }
  progress.end();
  return answers;
}

}  // namespace libgtd
