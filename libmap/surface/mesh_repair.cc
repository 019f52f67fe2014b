#include "libmap/surface/mesh_repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <tuple>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = 0xffffffff;
// In a row of caps, each may depend on the next.
constexpr std::size_t max_cap_passes = 1000;
constexpr double max_coordinate = 1e30;  // areas and volumes stay finite

// Cell indices of coordinates up to 10^6 m are exact.
constexpr double min_cell_m = 3e-12;

HalfEdge longest_edge(const TriangleMesh& mesh, std::uint32_t t) {
  HalfEdge longest = 3 * t;
  double length = -1.0;
  for (HalfEdge h = 3 * t; h < 3 * t + 3; ++h) {
    const double here = along(mesh, h).squaredNorm();
    if (here <= length) continue;
    length = here;
    longest = h;
  }
  return longest;
}

// Flips edges of an oriented manifold and updates its adjacency.
class CapFlipper {
 public:
  explicit CapFlipper(TriangleMesh& mesh)
      : mesh_(mesh), opposite_(opposites_of(mesh)), keep_(mesh.triangles.size(), true) {}

  // Removes a cap. Returns false if the adjacent triangle is a cap that depends on another one, or
  // if the new edge exists already.
  bool remove_cap(std::uint32_t cap, const std::function<bool(std::uint32_t)>& is_cap) {
    const HalfEdge h = longest_edge(mesh_, cap);
    const HalfEdge across = opposite_[h];
    if (!is_joined(across)) {
      drop(cap);
      return true;
    }
    if (is_cap(across / 3) && longest_edge(mesh_, across / 3) != across) return false;
    const std::uint32_t apex = source_of(mesh_.triangles, previous_in_triangle(h));
    const std::uint32_t beyond = source_of(mesh_.triangles, previous_in_triangle(across));
    if (apex == beyond || is_edge(previous_in_triangle(h), beyond)) return false;
    flip(h);
    touched_ = {cap, across / 3};
    return true;
  }

  // Triangles of the last flip.
  const std::array<std::uint32_t, 2>& touched() const { return touched_; }
  bool keeps(std::uint32_t t) const { return keep_[t]; }
  const std::vector<bool>& kept() const { return keep_; }

 private:
  // True if an edge joins the vertex of this corner and `to`.
  bool is_edge(HalfEdge corner, std::uint32_t to) const {
    HalfEdge h = corner;
    for (std::size_t step = 0; step < mesh_.triangles.size(); ++step) {
      if (target_of(mesh_.triangles, h) == to ||
          source_of(mesh_.triangles, previous_in_triangle(h)) == to)
        return true;
      const HalfEdge across = opposite_[previous_in_triangle(h)];
      if (across == corner) return false;
      if (!is_joined(across)) break;
      h = across;
    }
    // The fan is open: continues in the other direction.
    h = corner;
    for (std::size_t step = 0; step < mesh_.triangles.size() && is_joined(opposite_[h]); ++step) {
      h = next_in_triangle(opposite_[h]);
      if (target_of(mesh_.triangles, h) == to) return true;
    }
    return false;
  }

  void join(HalfEdge a, HalfEdge b) {
    opposite_[a] = b;
    if (is_joined(b)) opposite_[b] = a;
  }

  // Replaces the edge a -- b between the corners c and d by c -- d.
  void flip(HalfEdge h) {
    const HalfEdge o = opposite_[h];
    const std::uint32_t t = h / 3;
    const std::uint32_t u = o / 3;
    const std::uint32_t a = source_of(mesh_.triangles, h);
    const std::uint32_t b = source_of(mesh_.triangles, o);
    const std::uint32_t c = source_of(mesh_.triangles, previous_in_triangle(h));
    const std::uint32_t d = source_of(mesh_.triangles, previous_in_triangle(o));
    const HalfEdge over_bc = opposite_[next_in_triangle(h)];
    const HalfEdge over_ca = opposite_[previous_in_triangle(h)];
    const HalfEdge over_ad = opposite_[next_in_triangle(o)];
    const HalfEdge over_db = opposite_[previous_in_triangle(o)];
    mesh_.triangles[t] = {a, d, c};
    mesh_.triangles[u] = {d, b, c};
    join(3 * t, over_ad);
    join(3 * t + 1, 3 * u + 2);
    join(3 * t + 2, over_ca);
    join(3 * u, over_db);
    join(3 * u + 1, over_bc);
    // The cap takes the values of its neighbor, which had all the area.
    for (ScalarField& field : mesh_.face_fields) field.values[t] = field.values[u];
  }

  void drop(std::uint32_t t) {
    keep_[t] = false;
    for (HalfEdge h = 3 * t; h < 3 * t + 3; ++h) {
      if (is_joined(opposite_[h])) opposite_[opposite_[h]] = open_edge;
      opposite_[h] = no_edge;
    }
  }

  TriangleMesh& mesh_;
  std::vector<HalfEdge> opposite_;
  std::vector<bool> keep_;
  std::array<std::uint32_t, 2> touched_{};
};

}  // namespace

void require_sound(const TriangleMesh& mesh) {
  mesh.check();
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(mesh.vertices[v][axis]) <= max_coordinate))
        throw Error("not finite or too large", {.field = "vertex " + std::to_string(v),
                                                .value = std::to_string(mesh.vertices[v][axis]),
                                                .bound = "-1e30 to 1e30 m"});
}

double size_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) box.extend(mesh.vertices[v]);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

double lowest_height(const TriangleMesh& mesh, const Triangle& triangle) {
  double longest = 0.0;
  for (std::size_t k = 0; k < 3; ++k)
    longest = std::max(longest,
                       (mesh.vertices[triangle[(k + 1) % 3]] - mesh.vertices[triangle[k]]).norm());
  return longest > 0.0 ? area_normal(mesh, triangle).norm() / longest : 0.0;
}

std::vector<bool> degenerate_triangles(const TriangleMesh& mesh) {
  const double lowest = degenerate_height * size_of(mesh);
  std::vector<bool> marks(mesh.triangles.size(), false);
  for (std::size_t t = 0; t < marks.size(); ++t)
    marks[t] =
        has_repeated_vertex(mesh.triangles[t]) || lowest_height(mesh, mesh.triangles[t]) <= lowest;
  return marks;
}

std::size_t weld_vertices(TriangleMesh& mesh, double distance_m) {
  // Most searches need one or two cells. The odd factor avoids hash collisions of lattice vertices.
  const double cell_m = std::max(4.1 * distance_m, min_cell_m);
  GrowingGrid grid(Eigen::Vector3d::Zero(), cell_m, mesh.vertices.size());
  std::vector<std::uint32_t> kept;  // vertices by their index in the grid
  std::vector<std::uint32_t> kept_of(mesh.vertices.size());
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(distance_m);
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d& vertex = mesh.vertices[v];
    std::uint32_t first = no_vertex;
    grid.any_in_box(vertex - margin, vertex + margin,
                    [&](const Eigen::Vector3d& other, std::uint32_t n) {
                      if (n < first && (other - vertex).norm() <= distance_m) first = n;
                      return false;
                    });
    if (first == no_vertex) {
      first = static_cast<std::uint32_t>(kept.size());
      grid.add(vertex);
      kept.push_back(v);
    }
    kept_of[v] = kept[first];
  }
  const std::size_t joined = mesh.vertices.size() - kept.size();
  if (joined > 0)
    for (Triangle& t : mesh.triangles)
      for (std::uint32_t& v : t) v = kept_of[v];
  return joined;
}

std::vector<bool> repeated_triangles(const std::vector<Triangle>& triangles) {
  std::vector<std::pair<Triangle, std::uint32_t>> sorted;
  sorted.reserve(triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    Triangle corners = triangles[t];
    std::sort(corners.begin(), corners.end());
    sorted.emplace_back(corners, t);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<bool> marks(triangles.size(), false);
  for (std::size_t n = 1; n < sorted.size(); ++n)
    if (sorted[n].first == sorted[n - 1].first) marks[sorted[n].second] = true;
  return marks;
}

std::size_t flip_caps(TriangleMesh& mesh) {
  const double lowest = degenerate_height * size_of(mesh);
  std::vector<std::uint32_t> caps;
  const std::vector<bool> marks = degenerate_triangles(mesh);
  for (std::uint32_t t = 0; t < marks.size(); ++t)
    if (marks[t]) caps.push_back(t);
  if (caps.empty()) return 0;
  const std::size_t before = caps.size();
  CapFlipper flipper(mesh);
  const auto is_cap = [&](std::uint32_t t) {
    return lowest_height(mesh, mesh.triangles[t]) <= lowest;
  };
  // Each pass but the last removes at least one cap that others depend on.
  for (std::size_t pass = 0; pass <= max_cap_passes; ++pass) {
    bool has_changed = false;
    std::vector<std::uint32_t> left;
    for (const std::uint32_t cap : caps) {
      if (!flipper.keeps(cap) || !is_cap(cap)) continue;
      if (flipper.remove_cap(cap, is_cap)) has_changed = true;
      if (flipper.keeps(cap)) left.push_back(cap);
      if (flipper.keeps(cap) && flipper.touched()[0] == cap) left.push_back(flipper.touched()[1]);
    }
    std::sort(left.rbegin(), left.rend());  // the order is reversed in each pass
    left.erase(std::unique(left.begin(), left.end()), left.end());
    if (pass % 2 == 1) std::reverse(left.begin(), left.end());
    caps = std::move(left);
    if (!has_changed) break;
  }
  const auto remaining = static_cast<std::size_t>(std::count_if(
      caps.begin(), caps.end(), [&](std::uint32_t t) { return flipper.keeps(t) && is_cap(t); }));
  const std::vector<bool>& kept = flipper.kept();
  if (std::find(kept.begin(), kept.end(), false) != kept.end()) mesh = select_triangles(mesh, kept);
  return before - std::min(before, remaining);
}

namespace {

// Displacement of a copied vertex, per distance to the center of its fan.
constexpr double gap = 0.01;
constexpr double max_gap = 0.5;

// Edges with more triangles are cut without searching for pairs.
constexpr std::size_t max_paired = 16;

// Unit vector perpendicular to the edge, towards the triangle's third corner.
Eigen::Vector3d wing_of(const TriangleMesh& mesh, HalfEdge h) {
  const Eigen::Vector3d& from = mesh.vertices[source_of(mesh.triangles, h)];
  const Eigen::Vector3d edge = along(mesh, h).normalized();
  const Eigen::Vector3d to_apex =
      mesh.vertices[source_of(mesh.triangles, previous_in_triangle(h))] - from;
  return (to_apex - edge.dot(to_apex) * edge).normalized();
}

// Joins at most `max_pairs` pairs of the edge's half-edges, straightest first, and opens the
// others. Returns true if any was opened.
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

// Finds the triangles to be reversed. Opens edges across which no consistent orientation exists.
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

// Fans of one vertex; `corners` are all its corners.
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

// Gives each fan its own vertex. Returns the number of added vertices.
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
  std::vector<std::pair<HalfEdge, std::uint32_t>> copy_of_fan;  // applied at the end
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
      const double fraction = way.norm() > 0.0 ? std::max(gap, min_gap_m / way.norm()) : 0.0;
      mesh.vertices[copy] += std::min(fraction, max_gap) * way;
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

// Returns true if every edge had at most two triangles, in opposite directions, before cutting.
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

// Drops all but the first triangle of edges with more than two triangles, or two in one direction.
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
  // A fan may contain an edge twice, which splitting vertices does not separate. The second round
  // keeps one pair at such an edge, the third none.
  for (;;) {
    for (const std::size_t max_pairs : {max_paired, std::size_t{1}, std::size_t{0}, std::size_t{0}})
      if (cut_and_orient(mesh, max_pairs, min_gap_m, cuts)) return cuts;
    drop_unsettled(mesh, cuts);
  }
}

}  // namespace libmap
