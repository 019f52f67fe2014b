#include "libgtd/evaluate/map_regions.h"

#include <algorithm>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libgtd {

namespace {

using Sets = libmap::DisjointSets<std::uint32_t>;

std::vector<std::uint32_t> graspable_voxels(const VoxelMap& map, bool border) {
  std::vector<std::uint32_t> graspable;
  for (std::uint32_t n = 0; n < map.size(); ++n)
    if (map.graspable[n] != 0 && map.evaluated(n, border)) graspable.push_back(n);
  return graspable;
}

// Joins each voxel with its neighbors before it in the order of voxels. For each of the columns
// that can hold some, a cursor follows the voxels: both move on in the same order.
void join_neighbors(const VoxelMap& map, const std::vector<std::uint32_t>& graspable, int reach,
                    Sets& sets) {
  for (int di = -reach; di <= 0; ++di)
    for (int dj = -reach; dj <= (di < 0 ? reach : 0); ++dj) {
      std::uint32_t cursor = 0;
      for (std::uint32_t n = 0; n < graspable.size(); ++n) {
        const Voxel& here = map.voxels[graspable[n]];
        const Voxel first{here.i + di, here.j + dj, here.k - reach};
        const Voxel last{here.i + di, here.j + dj, here.k + reach};
        while (cursor < n && map.voxels[graspable[cursor]] < first) ++cursor;
        for (std::uint32_t m = cursor; m < n && map.voxels[graspable[m]] <= last; ++m)
          sets.join(n, m);
      }
    }
}

// Lists of voxels, one a set, each ascending, in the order of their first voxels.
std::vector<std::vector<std::uint32_t>> members_of(const std::vector<std::uint32_t>& graspable,
                                                   Sets& sets) {
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> number(graspable.size(), none);
  std::vector<std::vector<std::uint32_t>> members;
  for (std::uint32_t n = 0; n < graspable.size(); ++n) {
    std::uint32_t& set = number[sets.find(n)];
    if (set == none) {
      set = static_cast<std::uint32_t>(members.size());
      members.emplace_back();
    }
    members[set].push_back(graspable[n]);
  }
  return members;
}

MapRegion describe(const VoxelMap& map, const MapSurface& surface,
                   std::vector<std::uint32_t> voxels) {
  MapRegion region;
  region.best_voxel = voxels.front();
  region.min = region.max = map.center_in_terrain(voxels.front());
  double score_sum = 0.0;
  for (const std::uint32_t at : voxels) {
    const Eigen::Vector3d center = map.center_in_terrain(at);
    const auto area_m2 = static_cast<double>(surface.area_m2[at]);
    region.area_m2 += area_m2;
    region.centroid += area_m2 * center;
    region.min = region.min.cwiseMin(center);
    region.max = region.max.cwiseMax(center);
    score_sum += static_cast<double>(map.scores[at]);
    if (map.scores[at] > map.scores[region.best_voxel]) region.best_voxel = at;
    region.plan_area_m2 += surface.plan_area_m2(at);
  }
  region.centroid /= region.area_m2;
  region.best_score = static_cast<double>(map.scores[region.best_voxel]);
  region.mean_score = score_sum / static_cast<double>(voxels.size());
  region.voxels = std::move(voxels);
  return region;
}

}  // namespace

void bind(libmap::ParameterTable& table, MapRegionOptions& options) {
  table.add("adjacency_voxels", options.adjacency_voxels, libmap::Range{1.0, 100.0},
            "voxels of one region differ by at most so much in each index; 1: 26 neighbors");
  table.add("min_voxels", options.min_voxels, libmap::Range{1.0, 1e9},
            "smaller regions are left out, voxels");
}

MapRegionResult find_regions(const VoxelMap& map, const MapSurface& surface,
                             const MapRegionOptions& options) {
  libmap::check_parameters(options);
  if (surface.area_m2.size() != map.size())
    throw libmap::Error("the surface is of another map", {.field = "area_m2"});
  const std::vector<std::uint32_t> graspable = graspable_voxels(map, options.border);
  Sets sets(graspable.size());
  join_neighbors(map, graspable, options.adjacency_voxels, sets);
  MapRegionResult result;
  for (std::vector<std::uint32_t>& voxels : members_of(graspable, sets)) {
    if (voxels.size() < static_cast<std::size_t>(options.min_voxels)) {
      ++result.left_out_regions;
      result.left_out_voxels += voxels.size();
      continue;
    }
    result.voxels += voxels.size();
    result.regions.push_back(describe(map, surface, std::move(voxels)));
  }
  std::stable_sort(result.regions.begin(), result.regions.end(),
                   [](const MapRegion& a, const MapRegion& b) { return a.area_m2 > b.area_m2; });
  result.region_of_voxel.assign(map.size(), -1);
  for (std::size_t r = 0; r < result.regions.size(); ++r)
    for (const std::uint32_t voxel : result.regions[r].voxels)
      result.region_of_voxel[voxel] = static_cast<std::int32_t>(r);
  return result;
}

}  // namespace libgtd
