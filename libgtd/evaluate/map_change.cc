#include "libgtd/evaluate/map_change.h"

#include <algorithm>
#include <boost/math/statistics/bivariate_statistics.hpp>
#include <cmath>
#include <limits>

#include "libgtd/evaluate/map_analysis.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/spatial_index.h"

namespace libgtd {

namespace {

constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
constexpr double lattice_tolerance_voxels = 0.01;
constexpr std::size_t points_per_chunk = 1 << 14;

// Offset from the voxel indices of OTHER to those of MAP, if the lattices coincide.
std::optional<Voxel> lattice_offset(const VoxelMap& map, const VoxelMap& other,
                                    const libmap::Pose& map_from_other) {
  Eigen::Vector3d low = other.center_in_terrain(0);
  Eigen::Vector3d high = low;
  for (std::size_t n = 0; n < other.size(); ++n) {
    low = low.cwiseMin(other.center_in_terrain(n));
    high = high.cwiseMax(other.center_in_terrain(n));
  }
  std::optional<Voxel> offset;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d point((corner & 1) != 0 ? high.x() : low.x(),
                                (corner & 2) != 0 ? high.y() : low.y(),
                                (corner & 4) != 0 ? high.z() : low.z());
    const Eigen::Vector3d cell = map.lattice.cell_of(map_from_other * point);
    if (!(cell.cwiseAbs().array() < 0x1p30).all()) return std::nullopt;
    const Voxel here = map.lattice.voxel_of(map_from_other * point);
    const Voxel there = other.lattice.voxel_of(point);
    const Eigen::Vector3d off_center =
        cell - Eigen::Vector3d(here.i + 0.5, here.j + 0.5, here.k + 0.5);
    if (!(off_center.cwiseAbs().array() <= lattice_tolerance_voxels).all()) return std::nullopt;
    const Voxel step{here.i - there.i, here.j - there.j, here.k - there.k};
    if (offset && *offset != step) return std::nullopt;
    offset = step;
  }
  return offset;
}

std::vector<VoxelPair> pairs_by_index(const VoxelMap& map, const VoxelMap& other,
                                      const Voxel& offset) {
  std::vector<VoxelPair> pairs;
  std::uint32_t b = 0;
  for (std::uint32_t a = 0; a < map.size(); ++a) {
    const Voxel& voxel = map.voxels[a];
    const Voxel there{voxel.i - offset.i, voxel.j - offset.j, voxel.k - offset.k};
    while (b < other.size() && other.voxels[b] < there) ++b;
    if (b < other.size() && other.voxels[b] == there) pairs.push_back({a, b});
  }
  return pairs;
}

// Returns for each center the nearest point within `reach_m` (first of equally near), or `none`.
std::vector<std::uint32_t> nearest_points(const std::vector<Eigen::Vector3d>& points,
                                          const std::vector<Eigen::Vector3d>& centers,
                                          double reach_m) {
  const libmap::PointTree tree(points);
  std::vector<std::uint32_t> nearest(centers.size(), none);
  libmap::parallel_each(centers.size(), points_per_chunk, [&](std::size_t n) {
    const libmap::NeighborPoint near = tree.first_of_nearest(centers[n]);
    if (near.square_m2 <= reach_m * reach_m) nearest[n] = static_cast<std::uint32_t>(near.index);
  });
  return nearest;
}

std::vector<VoxelPair> pairs_by_distance(const VoxelMap& map, const VoxelMap& other,
                                         const libmap::Pose& map_from_other, double reach_m) {
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> other_centers;
  for (std::size_t n = 0; n < map.size(); ++n) centers.push_back(map.center_in_terrain(n));
  for (std::size_t n = 0; n < other.size(); ++n)
    other_centers.push_back(map_from_other * other.center_in_terrain(n));
  const std::vector<std::uint32_t> there = nearest_points(other_centers, centers, reach_m);
  const std::vector<std::uint32_t> here = nearest_points(centers, other_centers, reach_m);
  std::vector<VoxelPair> pairs;
  for (std::uint32_t a = 0; a < map.size(); ++a)
    if (there[a] != none && here[there[a]] == a) pairs.push_back({a, there[a]});
  return pairs;
}

ScoreDifference difference_of(const VoxelMap& map, const VoxelMap& other,
                              const std::vector<VoxelPair>& pairs) {
  ScoreDifference result;
  std::vector<double> differences;
  std::vector<double> first, second;
  for (const VoxelPair& pair : pairs) {
    const double a = static_cast<double>(map.scores[pair.map]);
    const double b = static_cast<double>(other.scores[pair.other]);
    if (std::isnan(a) || std::isnan(b)) continue;
    differences.push_back(b - a);
    result.mean += b - a;
    result.mean_absolute += std::abs(b - a);
    result.rms += (b - a) * (b - a);
    first.push_back(a);
    second.push_back(b);
  }
  result.count = differences.size();
  if (differences.empty()) return result;
  const double n = static_cast<double>(differences.size());
  result.mean /= n;
  result.mean_absolute /= n;
  result.rms = std::sqrt(result.rms / n);
  std::sort(differences.begin(), differences.end());
  // Exchanging the maps negates the percentiles and exchanges low_5 and high_95.
  const std::size_t last = result.count - 1;
  result.low_5 = differences[nearest_rank(result.count, 0.05)];
  result.median = (differences[last / 2] + differences[result.count / 2]) / 2.0;
  result.high_95 = differences[last - nearest_rank(result.count, 1.0 - 0.95)];
  result.min = differences.front();
  result.max = differences.back();
  const auto varies = [](const std::vector<double>& scores) {
    return std::any_of(scores.begin(), scores.end(),
                       [&](double score) { return score != scores.front(); });
  };
  if (varies(first) && varies(second))
    result.correlation = boost::math::statistics::correlation_coefficient(first, second);
  return result;
}

ChangeSummary summarize(const VoxelMap& map, const MapSurface& surface, const VoxelMap& other,
                        const std::vector<VoxelPair>& pairs) {
  ChangeSummary summary;
  for (const VoxelPair& pair : pairs) {
    summary.graspable.add(other.graspable[pair.other] != 0, map.graspable[pair.map] != 0);
    const auto area_m2 = static_cast<double>(surface.area_m2[pair.map]);
    const ChangeClass change = class_of(map, other, pair);
    summary.both_area_m2 += change == ChangeClass::both ? area_m2 : 0.0;
    summary.gained_area_m2 += change == ChangeClass::gained ? area_m2 : 0.0;
    summary.lost_area_m2 += change == ChangeClass::lost ? area_m2 : 0.0;
  }
  summary.kappa = cohens_kappa(summary.graspable);
  summary.difference = difference_of(map, other, pairs);
  return summary;
}

// Statistics of pairs in bins of `value` of the voxel of MAP; pairs with NaN are skipped.
template <typename Value>
std::vector<ChangeSummary> summarize_bins(const VoxelMap& map, const MapSurface& surface,
                                          const VoxelMap& other,
                                          const std::vector<VoxelPair>& pairs,
                                          const ValueBins& bins, const Value& value) {
  std::vector<std::vector<VoxelPair>> members(bins.count);
  for (const VoxelPair& pair : pairs)
    if (const double here = value(pair.map); !std::isnan(here))
      members[bins.bin_of(here)].push_back(pair);
  std::vector<ChangeSummary> summaries;
  for (std::size_t b = 0; b < bins.count; ++b) {
    ChangeSummary& summary = summaries.emplace_back(summarize(map, surface, other, members[b]));
    summary.low = bins.low(b);
    summary.high = bins.high(b);
  }
  return summaries;
}

void summarize_evaluated(const VoxelMap& map, const MapSurface& surface, const VoxelMap& other,
                         const MapChangeOptions& options, MapChange& change) {
  std::vector<VoxelPair> pairs;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const VoxelPair& pair : change.pairs) {
    if (!map.evaluated(pair.map, options.border) || !other.evaluated(pair.other, options.border))
      continue;
    pairs.push_back(pair);
    low = std::min(low, map.center_in_terrain(pair.map).z());
    high = std::max(high, map.center_in_terrain(pair.map).z());
  }
  change.evaluated = summarize(map, surface, other, pairs);
  if (pairs.empty()) return;
  change.by_height = summarize_bins(map, surface, other, pairs,
                                    bins_over(low, high, options.height_bin_m, "height_bin_m"),
                                    [&](std::uint32_t n) { return map.center_in_terrain(n).z(); });
  change.by_slope = summarize_bins(
      map, surface, other, pairs, bins_over(0.0, 90.0, options.slope_bin_deg, "slope_bin_deg"),
      [&](std::uint32_t n) { return static_cast<double>(surface.slope_deg[n]); });
}

void find_unpaired(const VoxelMap& map, const VoxelMap& other, MapChange& change) {
  std::vector<std::uint8_t> in_map(map.size(), 0);
  std::vector<std::uint8_t> in_other(other.size(), 0);
  for (const VoxelPair& pair : change.pairs) in_map[pair.map] = in_other[pair.other] = 1;
  for (std::uint32_t n = 0; n < map.size(); ++n)
    if (in_map[n] == 0) {
      change.only_map.push_back(n);
      change.only_map_graspable += map.graspable[n];
    }
  for (std::uint32_t n = 0; n < other.size(); ++n)
    if (in_other[n] == 0) {
      change.only_other.push_back(n);
      change.only_other_graspable += other.graspable[n];
    }
}

}  // namespace

void bind(libmap::ParameterTable& table, MapChangeOptions& options) {
  table.add("match_distance_voxels", options.match_distance_voxels,
            libmap::Range{0.0, 10.0, true, false},
            "with --against, if the voxel lattices differ: maximum distance of corresponding "
            "voxels, in edge lengths of the larger voxel");
}

std::string_view to_text(VoxelMatching matching) {
  return matching == VoxelMatching::lattice ? "lattice" : "nearest";
}

ChangeClass class_of(const VoxelMap& map, const VoxelMap& other, const VoxelPair& pair) {
  const bool in_other = other.graspable[pair.other] != 0;
  if (map.graspable[pair.map] != 0) return in_other ? ChangeClass::both : ChangeClass::lost;
  return in_other ? ChangeClass::gained : ChangeClass::neither;
}

MapChange compare_maps(const VoxelMap& map, const MapSurface& surface, const VoxelMap& other,
                       const libmap::Pose& map_terrain_from_other_terrain,
                       const MapChangeOptions& options) {
  libmap::check_parameters(options);
  if (surface.area_m2.size() != map.size())
    throw libmap::Error("not one value per voxel of the map", {.field = "area_m2"});
  MapChange change;
  const double size_m = std::max(map.lattice.voxel_size_m, other.lattice.voxel_size_m);
  if (const auto offset = lattice_offset(map, other, map_terrain_from_other_terrain)) {
    change.matching = VoxelMatching::lattice;
    change.pairs = pairs_by_index(map, other, *offset);
  } else {
    change.matching = VoxelMatching::nearest;
    change.pairs = pairs_by_distance(map, other, map_terrain_from_other_terrain,
                                     options.match_distance_voxels * size_m);
  }
  if (change.pairs.empty())
    throw libmap::Error("none is common to both maps; check their areas and frames",
                        {.field = "voxels"});
  find_unpaired(map, other, change);
  change.common = summarize(map, surface, other, change.pairs);
  summarize_evaluated(map, surface, other, options, change);
  return change;
}

libmap::PointCloud to_cloud(const MapChange& change, const VoxelMap& map, const VoxelMap& other,
                            const libmap::Pose& map_terrain_from_other_terrain, bool border) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const libmap::Pose map_from_terrain = map.terrain_from_map.inverse();
  const std::size_t count = change.pairs.size() + change.only_map.size() + change.only_other.size();
  libmap::PointCloud cloud;
  cloud.positions.reserve(count);
  std::vector<double> score_map, score_other, graspable_map, graspable_other, evaluated, classes;
  const auto add = [&](std::uint32_t a, std::uint32_t b, ChangeClass one) {
    cloud.positions.push_back(map_from_terrain * (a != none ? map.center_in_terrain(a)
                                                            : map_terrain_from_other_terrain *
                                                                  other.center_in_terrain(b)));
    score_map.push_back(a != none ? static_cast<double>(map.scores[a]) : nan);
    score_other.push_back(b != none ? static_cast<double>(other.scores[b]) : nan);
    graspable_map.push_back(a != none ? map.graspable[a] : 0.0);
    graspable_other.push_back(b != none ? other.graspable[b] : 0.0);
    evaluated.push_back((a == none || map.evaluated(a, border)) &&
                        (b == none || other.evaluated(b, border)));
    classes.push_back(static_cast<double>(one));
  };
  for (const VoxelPair& pair : change.pairs) add(pair.map, pair.other, class_of(map, other, pair));
  for (const std::uint32_t a : change.only_map) add(a, none, ChangeClass::only_map);
  for (const std::uint32_t b : change.only_other) add(none, b, ChangeClass::only_other);
  std::vector<double> difference(count);
  for (std::size_t n = 0; n < count; ++n) difference[n] = score_other[n] - score_map[n];
  const auto field = [&](const char* name, libmap::ScalarType type, std::vector<double>& values) {
    cloud.fields.push_back({name, type, std::move(values)});
  };
  field("score_map", libmap::ScalarType::float32, score_map);
  field("score_other", libmap::ScalarType::float32, score_other);
  field("difference", libmap::ScalarType::float32, difference);
  field("graspable_map", libmap::ScalarType::uint8, graspable_map);
  field("graspable_other", libmap::ScalarType::uint8, graspable_other);
  field("evaluated", libmap::ScalarType::uint8, evaluated);
  field("change", libmap::ScalarType::uint8, classes);
  return cloud;
}

}  // namespace libgtd
