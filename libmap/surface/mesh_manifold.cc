#include "libmap/surface/mesh_manifold.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

// Of the way to the middle of its fan, by which a copy of a vertex moves away from the others.
constexpr double gap = 0.01;
constexpr double max_gap = 0.5;

// Edges of more triangles than this are cut without looking for pairs.
constexpr std::size_t max_paired = 16;

// From the edge to the triangle's third corner, across the edge, of unit length.
Eigen::Vector3d wing_of(const TriangleMesh& mesh, HalfEdge h) {
  const Eigen::Vector3d& from = mesh.vertices[source_of(mesh.triangles, h)];
  const Eigen::Vector3d edge = along(mesh, h).normalized();
  const Eigen::Vector3d to_apex =
      mesh.vertices[source_of(mesh.triangles, previous_in_triangle(h))] - from;
  return (to_apex - edge.dot(to_apex) * edge).normalized();
}

// Joins at most `max_pairs` pairs of the edge's half-edges, straightest first; opens the others.
// Whether any was opened.
bool pair_half_edges(const TriangleMesh& mesh, const HalfEdge* half, std::size_t count,
                     std::size_t max_pairs, std::vector<HalfEdge>& opposite) {
  for (std::size_t n = 0; n < count; ++n) opposite[half[n]] = open_edge;
  if (count > max_paired) return true;
  std::vector<Eigen::Vector3d> wings;
  for (std::size_t n = 0; n < count; ++n) wings.push_back(wing_of(mesh, half[n]));
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t a = 0; a < count; ++a)
    for (std::size_t b = a + 1; b < count; ++b)
      if (source_of(mesh.triangles, half[a]) != source_of(mesh.triangles, half[b]))
        pairs.emplace_back(wings[a].dot(wings[b]), a, b);
  std::sort(pairs.begin(), pairs.end());
  std::size_t joined = 0;
  for (const auto& [cosine, a, b] : pairs) {
    if (joined == max_pairs) break;
    if (is_joined(opposite[half[a]]) || is_joined(opposite[half[b]])) continue;
    opposite[half[a]] = half[b];
    opposite[half[b]] = half[a];
    ++joined;
  }
  return 2 * joined < count;
}

// Which triangles must be turned over; edges across which that cannot be settled are opened.
class Orientation {
 public:
  Orientation(const TriangleMesh& mesh, std::vector<HalfEdge>& opposite)
      : mesh_(mesh), opposite_(opposite), state_(mesh.triangles.size(), State::unknown) {
    for (std::uint32_t t = 0; t < state_.size(); ++t)
      if (state_[t] == State::unknown) orient_component(t);
  }

  std::size_t cut_edges() const { return cut_edges_; }
  bool is_turned(std::uint32_t t) const { return state_[t] == State::turned; }

 private:
  enum class State : std::uint8_t { unknown, kept, turned };

  static State other(State state) { return state == State::kept ? State::turned : State::kept; }

  void orient_component(std::uint32_t seed) {
    std::vector<std::uint32_t> members = {seed};
    state_[seed] = State::kept;
    double kept_area = 0.0;
    double turned_area = 0.0;
    for (std::size_t n = 0; n < members.size(); ++n) {
      const std::uint32_t t = members[n];
      (is_turned(t) ? turned_area : kept_area) += area_normal(mesh_, mesh_.triangles[t]).norm();
      for (HalfEdge h = 3 * t; h < 3 * t + 3; ++h) cross(h, members);
    }
    if (turned_area > kept_area)
      for (const std::uint32_t t : members) state_[t] = other(state_[t]);
  }

  void cross(HalfEdge h, std::vector<std::uint32_t>& members) {
    const HalfEdge across = opposite_[h];
    if (!is_joined(across)) return;
    const bool same_sense = source_of(mesh_.triangles, h) == source_of(mesh_.triangles, across);
    const State wanted = same_sense ? other(state_[h / 3]) : state_[h / 3];
    State& neighbor = state_[across / 3];
    if (neighbor == State::unknown) {
      neighbor = wanted;
      members.push_back(across / 3);
    } else if (neighbor != wanted) {
      opposite_[h] = opposite_[across] = open_edge;
      ++cut_edges_;
    }
  }

  const TriangleMesh& mesh_;
  std::vector<HalfEdge>& opposite_;
  std::vector<State> state_;
  std::size_t cut_edges_ = 0;
};

struct Fan {
  HalfEdge name = 0;
  double area = 0.0;
  Eigen::Vector3d ring_sum = Eigen::Vector3d::Zero();
  std::size_t ring_count = 0;
};

// The fans of one vertex: `corners` are all corners there.
std::vector<Fan> fans_of(const TriangleMesh& mesh, const std::vector<HalfEdge>& fan_of_corner,
                         const std::vector<HalfEdge>& corners) {
  std::vector<Fan> fans;
  std::vector<HalfEdge> by_fan = corners;
  std::sort(by_fan.begin(), by_fan.end(), [&](HalfEdge a, HalfEdge b) {
    return std::pair(fan_of_corner[a], a) < std::pair(fan_of_corner[b], b);
  });
  for (const HalfEdge corner : by_fan) {
    if (fans.empty() || fans.back().name != fan_of_corner[corner])
      fans.push_back({.name = fan_of_corner[corner]});
    Fan& fan = fans.back();
    fan.area += area_normal(mesh, mesh.triangles[corner / 3]).norm();
    for (const HalfEdge other : {next_in_triangle(corner), previous_in_triangle(corner)})
      fan.ring_sum += mesh.vertices[source_of(mesh.triangles, other)];
    fan.ring_count += 2;
  }
  return fans;
}

// Gives each fan a vertex of its own. How many vertices that adds.
std::size_t split_vertices(TriangleMesh& mesh, const std::vector<HalfEdge>& fan_of_corner,
                           double min_gap_m) {
  std::vector<HalfEdge> first_fan(mesh.vertices.size(), open_edge);
  std::vector<bool> is_split(mesh.vertices.size(), false);
  for (HalfEdge corner = 0; corner < fan_of_corner.size(); ++corner) {
    const std::uint32_t v = source_of(mesh.triangles, corner);
    if (first_fan[v] == open_edge) first_fan[v] = fan_of_corner[corner];
    if (first_fan[v] != fan_of_corner[corner]) is_split[v] = true;
  }
  const std::size_t vertices_before = mesh.vertices.size();
  if (std::find(is_split.begin(), is_split.end(), true) == is_split.end()) return 0;
  const VertexTriangles around = triangles_at_vertices(mesh.triangles, vertices_before);
  std::vector<std::pair<HalfEdge, std::uint32_t>> copy_of_fan;  // applied when all are known
  for (std::uint32_t v = 0; v < vertices_before; ++v) {
    if (!is_split[v]) continue;
    std::vector<HalfEdge> corners;
    for (const std::uint32_t t : around.of(v))
      for (HalfEdge corner = 3 * t; corner < 3 * t + 3; ++corner)
        if (source_of(mesh.triangles, corner) == v) corners.push_back(corner);
    const std::vector<Fan> fans = fans_of(mesh, fan_of_corner, corners);
    const auto largest = std::max_element(
        fans.begin(), fans.end(), [](const Fan& a, const Fan& b) { return a.area < b.area; });
    for (auto fan = fans.begin(); fan != fans.end(); ++fan) {
      if (fan == largest) continue;
      const std::uint32_t copy = append_vertex_between(mesh, v, v, 0.0);
      const Eigen::Vector3d middle = fan->ring_sum / static_cast<double>(fan->ring_count);
      const Eigen::Vector3d way = middle - mesh.vertices[copy];
      const double share = way.norm() > 0.0 ? std::max(gap, min_gap_m / way.norm()) : 0.0;
      mesh.vertices[copy] += std::min(share, max_gap) * way;
      copy_of_fan.emplace_back(fan->name, copy);
    }
  }
  std::sort(copy_of_fan.begin(), copy_of_fan.end());
  for (HalfEdge corner = 0; corner < fan_of_corner.size(); ++corner) {
    if (!is_split[source_of(mesh.triangles, corner)]) continue;
    const auto copy = std::lower_bound(copy_of_fan.begin(), copy_of_fan.end(),
                                       std::pair(fan_of_corner[corner], std::uint32_t{0}));
    if (copy != copy_of_fan.end() && copy->first == fan_of_corner[corner])
      mesh.triangles[corner / 3][corner % 3] = copy->second;
  }
  return mesh.vertices.size() - vertices_before;
}

// Whether every edge was one of at most two triangles, in opposite senses, without cuts.
bool cut_and_orient(TriangleMesh& mesh, std::size_t max_pairs, double min_gap_m,
                    ManifoldCuts& cuts) {
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  std::vector<HalfEdge> opposite = opposites_of(mesh.triangles, edges);
  const std::size_t edges_before = cuts.edges;
  bool is_sound = true;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (edges.count(e) <= 2) continue;
    is_sound = false;
    if (pair_half_edges(mesh, &edges.half_edges[edges.first[e]], edges.count(e), max_pairs,
                        opposite))
      ++cuts.edges;
  }
  const Orientation orientation(mesh, opposite);
  cuts.edges += orientation.cut_edges();
  cuts.vertices += split_vertices(mesh, corner_fans(mesh.triangles, opposite), min_gap_m);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!orientation.is_turned(t)) continue;
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    ++cuts.turned;
  }
  return is_sound && cuts.edges == edges_before;
}

// Of each edge that is still one of more than two triangles, or of two in the same sense, all but
// the first triangle go.
void drop_unsettled(TriangleMesh& mesh, ManifoldCuts& cuts) {
  const MeshEdges edges = edges_of(mesh.triangles, mesh.vertices.size());
  std::vector<bool> keep(mesh.triangles.size(), true);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const HalfEdge* half = &edges.half_edges[edges.first[e]];
    const std::size_t count = edges.count(e);
    if (count < 2 ||
        (count == 2 && source_of(mesh.triangles, half[0]) != source_of(mesh.triangles, half[1])))
      continue;
    for (std::size_t n = 1; n < count; ++n) keep[half[n] / 3] = false;
  }
  const auto dropped = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), false));
  if (dropped == 0) return;
  mesh = select_triangles(mesh, keep);
  cuts.dropped += dropped;
}

}  // namespace

ManifoldCuts make_manifold(TriangleMesh& mesh, double min_gap_m) {
  ManifoldCuts cuts;
  // A fan may pass one edge twice; splitting vertices does not part it there. The second round
  // leaves such an edge one pair, the third none.
  for (;;) {
    for (const std::size_t max_pairs : {max_paired, std::size_t{1}, std::size_t{0}, std::size_t{0}})
      if (cut_and_orient(mesh, max_pairs, min_gap_m, cuts)) return cuts;
    drop_unsettled(mesh, cuts);
  }
}

bool is_oriented_manifold(const TriangleMesh& mesh) {
  const std::vector<HalfEdge> opposite = opposites_of(mesh);
  for (HalfEdge h = 0; h < opposite.size(); ++h) {
    if (opposite[h] == open_edge) continue;
    if (!is_joined(opposite[h]) ||
        source_of(mesh.triangles, h) == source_of(mesh.triangles, opposite[h]))
      return false;
  }
  const std::vector<HalfEdge> fans = corner_fans(mesh.triangles, opposite);
  std::vector<HalfEdge> fan_of(mesh.vertices.size(), open_edge);
  for (HalfEdge corner = 0; corner < fans.size(); ++corner) {
    HalfEdge& fan = fan_of[source_of(mesh.triangles, corner)];
    if (fan == open_edge) fan = fans[corner];
    if (fan != fans[corner]) return false;
  }
  return true;
}

}  // namespace libmap
