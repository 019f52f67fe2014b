#include "libgtd/evaluate/map_regions.h"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <boost/graph/adjacency_list.hpp>
#include <boost/graph/connected_components.hpp>
#include <boost/graph/dijkstra_shortest_paths.hpp>
#include <boost/graph/kruskal_min_spanning_tree.hpp>
#include <cmath>
#include <limits>

#include "libgtd/evaluate/lookup.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/point_cloud.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libgtd {

namespace {

std::vector<std::uint32_t> graspable_voxels(const VoxelMap& map, bool border) {
  std::vector<std::uint32_t> graspable;
  for (std::uint32_t n = 0; n < map.size(); ++n)
    if (map.graspable[n] != 0 && map.evaluated(n, border)) graspable.push_back(n);
  return graspable;
}

// Sets of connected voxels, each ascending, in the order of their first voxels.
std::vector<std::vector<std::uint32_t>> connected(const VoxelMap& map,
                                                  const std::vector<std::uint32_t>& graspable,
                                                  int reach) {
  std::vector<Voxel> voxels;
  voxels.reserve(graspable.size());
  for (const std::uint32_t n : graspable) voxels.push_back(map.voxels[n]);
  libmap::DisjointSets<std::uint32_t> sets(voxels.size());
  visit_pairs(voxels, reach, [&](std::size_t n, std::size_t m) {
    sets.join(static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(m));
  });
  std::vector<std::size_t> number(voxels.size());  // number of the set, stored at its first voxel
  std::vector<std::vector<std::uint32_t>> members;
  for (std::uint32_t n = 0; n < voxels.size(); ++n) {
    const std::uint32_t first = sets.find(n);
    if (first == n) {
      number[n] = members.size();
      members.emplace_back();
    }
    members[number[first]].push_back(graspable[n]);
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

using libmap::Bounds3d;
using Graph = boost::adjacency_list<boost::vecS, boost::vecS, boost::undirectedS,
                                    boost::no_property, RegionLink>;

constexpr std::size_t max_links = 10'000'000;
// Distances of voxels are multiples of their size. The tolerance prevents rounding from excluding
// the stride itself.
constexpr double reach_tolerance = 1.0 + 1e-9;
constexpr double farthest_m = std::numeric_limits<double>::max();

void check(const RegionReachOptions& options) {
  libmap::check_parameters(options);
  if (options.start && !options.start->allFinite())
    throw libmap::Error("is not finite", {.field = "start"});
}

// Voxel centers of one region, or of several connected regions.
struct PointSet {
  std::vector<std::uint32_t> voxels;
  libmap::PointCloud points;
  Bounds3d box;
};

PointSet point_set_of(const VoxelMap& map, std::vector<std::uint32_t> voxels) {
  PointSet set;
  set.points.positions.reserve(voxels.size());
  for (const std::uint32_t voxel : voxels)
    set.points.positions.push_back(map.center_in_terrain(voxel));
  set.box = libmap::bounds_of(set.points.positions);
  set.voxels = std::move(voxels);
  return set;
}

double distance_to(const Bounds3d& box, const Eigen::Vector3d& point) {
  return (point - point.cwiseMax(box.min).cwiseMin(box.max)).norm();
}

double distance_between(const Bounds3d& a, const Bounds3d& b) {
  return (a.min - b.max).cwiseMax(b.min - a.max).cwiseMax(0.0).norm();
}

using BoxPoint = boost::geometry::model::point<double, 3, boost::geometry::cs::cartesian>;
using Box = boost::geometry::model::box<BoxPoint>;
using BoxTree = boost::geometry::index::rtree<std::pair<Box, std::uint32_t>,
                                              boost::geometry::index::quadratic<16>>;

Box box_of(const Bounds3d& bounds, double margin) {
  return {{bounds.min.x() - margin, bounds.min.y() - margin, bounds.min.z() - margin},
          {bounds.max.x() + margin, bounds.max.y() + margin, bounds.max.z() + margin}};
}

// Pairs of sets at most `reach_m` apart, each with its nearest voxels, ascending by a, then b.
class NearestPairs {
 public:
  NearestPairs(const std::vector<PointSet>& sets, double reach_m)
      : sets_(sets),
        given_reach_m_(reach_m),
        reach_m_(std::min(reach_m * reach_tolerance, farthest_m)) {
    std::vector<std::pair<Box, std::uint32_t>> boxes;
    for (std::uint32_t s = 0; s < sets.size(); ++s) boxes.emplace_back(box_of(sets[s].box, 0.0), s);
    tree_ = BoxTree(boxes);
  }

  std::vector<RegionLink> find() const {
    std::vector<std::vector<RegionLink>> of_set(sets_.size());
    std::vector<std::vector<std::uint32_t>> smaller(sets_.size());
    std::size_t pairs = 0;
    for (std::uint32_t s = 0; s < sets_.size(); ++s) {
      smaller[s] = smaller_neighbors(s);
      pairs += smaller[s].size();
      if (pairs > max_links)
        throw libmap::Error("too large: more than 10 million pairs of regions would be linked",
                            {.field = "stride_m", .value = libmap::to_text(given_reach_m_)});
    }
    libmap::parallel_each(sets_.size(), 8, [&](std::size_t s) {
      of_set[s] = links_of(static_cast<std::uint32_t>(s), smaller[s]);
    });
    std::vector<RegionLink> links;
    for (const std::vector<RegionLink>& part : of_set)
      links.insert(links.end(), part.begin(), part.end());
    std::sort(links.begin(), links.end(), [](const RegionLink& x, const RegionLink& y) {
      return std::pair(x.a, x.b) < std::pair(y.a, y.b);
    });
    return links;
  }

 private:
  // Searches the larger set of each pair for the points of the smaller one.
  std::vector<std::uint32_t> smaller_neighbors(std::uint32_t set) const {
    const auto rank = [&](std::uint32_t s) { return std::pair(sets_[s].voxels.size(), s); };
    std::vector<std::uint32_t> near;
    const auto is_candidate = [&](const std::pair<Box, std::uint32_t>& other) {
      return rank(other.second) < rank(set) &&
             distance_between(sets_[set].box, sets_[other.second].box) <= reach_m_;
    };
    namespace index = boost::geometry::index;
    for (auto found = tree_.qbegin(index::intersects(box_of(sets_[set].box, reach_m_)) &&
                                   index::satisfies(is_candidate));
         found != tree_.qend(); ++found)
      near.push_back(found->second);
    std::sort(near.begin(), near.end());
    return near;
  }

  std::vector<RegionLink> links_of(std::uint32_t set,
                                   const std::vector<std::uint32_t>& neighbors) const {
    std::vector<Eigen::Vector3d> points;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> owners;  // set, voxel
    for (const std::uint32_t other : neighbors)
      for (std::size_t n = 0; n < sets_[other].voxels.size(); ++n) {
        const Eigen::Vector3d& point = sets_[other].points.positions[n];
        if (distance_to(sets_[set].box, point) > reach_m_) continue;
        points.push_back(point);
        owners.emplace_back(other, sets_[other].voxels[n]);
      }
    std::vector<RegionLink> links;
    if (points.empty()) return links;
    const std::vector<LookupAnswer> answers =
        look_up(sets_[set].points, points, {.max_distance_m = reach_m_});
    for (std::size_t n = 0; n < points.size(); ++n) {
      if (!answers[n].found) continue;
      const auto [other, voxel] = owners[n];
      const std::uint32_t own = sets_[set].voxels[answers[n].map_point];
      const RegionLink link = set < other
                                  ? RegionLink{set, other, answers[n].distance_m, own, voxel}
                                  : RegionLink{other, set, answers[n].distance_m, voxel, own};
      if (links.empty() || links.back().a != link.a || links.back().b != link.b)
        links.push_back(link);
      else if (link.distance_m < links.back().distance_m)
        links.back() = link;
    }
    return links;
  }

  const std::vector<PointSet>& sets_;
  double given_reach_m_;
  double reach_m_;
  BoxTree tree_;
};

Graph graph_of(std::size_t nodes, const std::vector<RegionLink>& links) {
  Graph graph(nodes);
  for (const RegionLink& link : links) boost::add_edge(link.a, link.b, link, graph);
  return graph;
}

struct Components {
  std::vector<std::uint32_t> of_node;  // numbered by their first nodes
  std::size_t count = 0;
};

Components components_of(const Graph& graph) {
  Components components;
  components.of_node.resize(boost::num_vertices(graph));
  if (!components.of_node.empty())
    components.count =
        static_cast<std::size_t>(boost::connected_components(graph, components.of_node.data()));
  return components;
}

// Minimum spanning tree of each component, shortest link first.
std::vector<RegionLink> spanning_links(const Graph& graph) {
  std::vector<Graph::edge_descriptor> kept;
  boost::kruskal_minimum_spanning_tree(
      graph, std::back_inserter(kept),
      boost::weight_map(boost::get(&RegionLink::distance_m, graph)));
  std::vector<RegionLink> links;
  links.reserve(kept.size());
  for (const Graph::edge_descriptor& edge : kept) links.push_back(graph[edge]);
  return links;
}

std::vector<PointSet> joined(const VoxelMap& map, const std::vector<PointSet>& sets,
                             const Components& components) {
  std::vector<std::vector<std::uint32_t>> voxels(components.count);
  for (std::size_t s = 0; s < sets.size(); ++s) {
    std::vector<std::uint32_t>& whole = voxels[components.of_node[s]];
    whole.insert(whole.end(), sets[s].voxels.begin(), sets[s].voxels.end());
  }
  std::vector<PointSet> larger;
  for (std::vector<std::uint32_t>& members : voxels) {
    std::sort(members.begin(), members.end());
    larger.push_back(point_set_of(map, std::move(members)));
  }
  return larger;
}

// Spanning tree of all regions. Links within a reach merge sets, then links within twice this
// reach, until one set is left. No shorter link is missed, because sets at smaller distances are
// merged already.
std::vector<RegionLink> spanning_tree(const VoxelMap& map, const MapRegionResult& regions,
                                      std::vector<PointSet> sets, std::vector<RegionLink> links,
                                      double reach_m) {
  std::vector<RegionLink> tree;
  while (sets.size() > 1) {
    const Graph graph = graph_of(sets.size(), links);
    for (RegionLink link : spanning_links(graph)) {
      link.a = static_cast<std::uint32_t>(regions.region_of_voxel[link.voxel_a]);
      link.b = static_cast<std::uint32_t>(regions.region_of_voxel[link.voxel_b]);
      if (link.a > link.b) {
        std::swap(link.a, link.b);
        std::swap(link.voxel_a, link.voxel_b);
      }
      tree.push_back(link);
    }
    const Components components = components_of(graph);
    if (components.count == sets.size() && !(reach_m < farthest_m))
      throw libmap::Error(
          "the distances between the regions are not finite",
          {.field = "voxel_size_m", .value = libmap::to_text(map.lattice.voxel_size_m)});
    if (components.count < sets.size()) sets = joined(map, sets, components);
    reach_m = std::max(2.0 * reach_m, map.lattice.voxel_size_m);
    links = NearestPairs(sets, reach_m).find();
  }
  return tree;
}

// Summed in the order of PointTree (nanoflann's L2_Simple_Adaptor), so that both compute the same
// distance.
double distance_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  double sum = 0.0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return std::sqrt(sum);
}

// Distance from a position to the nearest voxel of each region.
std::vector<double> distances_from(const Eigen::Vector3d& position,
                                   const std::vector<PointSet>& sets) {
  std::vector<double> distances(sets.size(), std::numeric_limits<double>::infinity());
  for (std::size_t s = 0; s < sets.size(); ++s)
    for (const Eigen::Vector3d& point : sets[s].points.positions)
      distances[s] = std::min(distances[s], distance_of(point, position));
  return distances;
}

// Shortest paths from node `start` along the links; `lengthen` adds a link to the length of a path.
template <typename Lengthen>
std::vector<double> lengths_from(std::uint32_t start, const Graph& graph,
                                 const Lengthen& lengthen) {
  std::vector<double> lengths(boost::num_vertices(graph));
  boost::dijkstra_shortest_paths(graph, start,
                                 boost::weight_map(boost::get(&RegionLink::distance_m, graph))
                                     .distance_map(lengths.data())
                                     .distance_combine(lengthen)
                                     .distance_compare(std::less<>())
                                     .distance_inf(std::numeric_limits<double>::infinity())
                                     .distance_zero(0.0));
  return lengths;
}

// Adds the start as a node, with links to the regions within `max_m`.
std::vector<RegionLink> with_start(std::vector<RegionLink> links,
                                   const std::vector<double>& start_distances, double max_m) {
  const auto start = static_cast<std::uint32_t>(start_distances.size());
  for (std::uint32_t r = 0; r < start; ++r)
    if (start_distances[r] <= max_m)
      links.push_back({.a = r, .b = start, .distance_m = start_distances[r]});
  return links;
}

void describe_access(const MapRegionResult& regions, const std::vector<double>& start_distances,
                     double stride_m, RegionReach& reach) {
  constexpr double any = std::numeric_limits<double>::max();
  const std::size_t nodes = start_distances.size() + 1;
  const auto start = static_cast<std::uint32_t>(start_distances.size());
  const std::vector<double> strides =
      lengths_from(start, graph_of(nodes, with_start(reach.tree, start_distances, any)),
                   [](double way, double link) { return std::max(way, link); });
  const std::vector<double> steps = lengths_from(
      start, graph_of(nodes, with_start(reach.links, start_distances, stride_m * reach_tolerance)),
      [](double way, double link) { return way + (link > 0.0 ? 1.0 : 0.0); });
  for (std::size_t r = 0; r < reach.access.size(); ++r) {
    RegionAccess& access = reach.access[r];
    access.stride_needed_m = strides[r];
    access.reachable = std::isfinite(steps[r]);
    if (!access.reachable) continue;
    access.steps = static_cast<std::size_t>(steps[r]);
    ++reach.reachable_regions;
    reach.reachable_area_m2 += regions.regions[r].area_m2;
  }
}

}  // namespace

void bind(libmap::ParameterTable& table, MapRegionOptions& options) {
  table.add("adjacency_voxels", options.adjacency_voxels, libmap::Range{1.0, 100.0},
            "maximum index difference, per axis, of connected voxels of a region; 1: 26 neighbors");
  table.add("min_voxels", options.min_voxels, libmap::Range{1.0, 1e9},
            "minimum number of voxels of a graspable region; smaller regions are skipped");
}

MapRegionResult find_regions(const VoxelMap& map, const MapSurface& surface,
                             const MapRegionOptions& options) {
  libmap::check_parameters(options);
  if (surface.area_m2.size() != map.size())
    throw libmap::Error("not one value per voxel of the map", {.field = "area_m2"});
  const std::vector<std::uint32_t> graspable = graspable_voxels(map, options.border);
  MapRegionResult result;
  for (std::vector<std::uint32_t>& voxels : connected(map, graspable, options.adjacency_voxels)) {
    if (voxels.size() < static_cast<std::size_t>(options.min_voxels)) {
      ++result.skipped_regions;
      result.skipped_voxels += voxels.size();
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

void bind(libmap::ParameterTable& table, RegionReachOptions& options) {
  table.add("stride_m", options.stride_m, libmap::positive,
            "maximum distance between two graspable regions that the robot can step across, m");
}

RegionReach find_reach(const VoxelMap& map, const MapRegionResult& regions,
                       const RegionReachOptions& options) {
  check(options);
  RegionReach reach;
  if (regions.regions.empty()) return reach;
  std::vector<PointSet> sets;
  for (const MapRegion& region : regions.regions) sets.push_back(point_set_of(map, region.voxels));
  reach.links = NearestPairs(sets, options.stride_m).find();
  const Components groups = components_of(graph_of(sets.size(), reach.links));
  reach.groups = groups.count;
  reach.access.resize(sets.size());
  for (std::size_t r = 0; r < sets.size(); ++r) reach.access[r].group = groups.of_node[r];
  std::vector<double> start_distances(sets.size(), std::numeric_limits<double>::infinity());
  start_distances.front() = 0.0;
  if (options.start) start_distances = distances_from(*options.start, sets);
  const auto nearest = std::min_element(start_distances.begin(), start_distances.end());
  reach.start_region = static_cast<std::uint32_t>(nearest - start_distances.begin());
  reach.start_distance_m = *nearest;
  // A robot on a region reaches it without a step.
  for (double& distance : start_distances)
    if (distance <= map.lattice.voxel_size_m) distance = 0.0;
  reach.tree = spanning_tree(map, regions, std::move(sets), reach.links, options.stride_m);
  reach.joining_stride_m = 0.0;
  for (const RegionLink& link : reach.tree)
    reach.joining_stride_m = std::max(*reach.joining_stride_m, link.distance_m);
  describe_access(regions, start_distances, options.stride_m, reach);
  return reach;
}

}  // namespace libgtd
