#include "libmap/surface/triangle_repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>

#include "libmap/core/error.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = 0xffffffff;
// A row of caps may wait for its last one.
constexpr std::size_t max_cap_passes = 1000;
constexpr double max_coordinate = 1e30;  // its powers that areas and volumes need are finite

// A coordinate of 10^6 m still counts cells in whole numbers.
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

// Turns edges of an oriented manifold and keeps its adjacency.
class CapFlipper {
 public:
  explicit CapFlipper(TriangleMesh& mesh)
      : mesh_(mesh), opposite_(opposites_of(mesh)), keep_(mesh.triangles.size(), true) {}

  // Whether anything was done: not if the triangle beyond is a cap that waits for another, or the
  // new edge exists.
  bool settle(std::uint32_t cap, const std::function<bool(std::uint32_t)>& is_cap) {
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

  // The two triangles of the last flip.
  const std::array<std::uint32_t, 2>& touched() const { return touched_; }
  bool keeps(std::uint32_t t) const { return keep_[t]; }
  const std::vector<bool>& kept() const { return keep_; }

 private:
  // Whether an edge leads from the vertex of this corner to `to`.
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
    // The fan is open: the other way round, too.
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

  // a -> b with the corner c on one side and d on the other becomes c -- d.
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
    // All of the area was the neighbor's.
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
        throw Error("it cannot be a place", {.field = "vertex " + std::to_string(v),
                                             .value = std::to_string(mesh.vertices[v][axis]),
                                             .bound = "within 1e30 m of the origin"});
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
        names_a_vertex_twice(mesh.triangles[t]) || lowest_height(mesh, mesh.triangles[t]) <= lowest;
  return marks;
}

std::size_t weld_vertices(TriangleMesh& mesh, double distance_m) {
  // Most searches look into one or two cells. The odd factor keeps vertices of a lattice from the
  // same slots.
  const double cell_m = std::max(4.1 * distance_m, min_cell_m);
  GrowingGrid grid(Eigen::Vector3d::Zero(), cell_m, mesh.vertices.size());
  std::vector<std::uint32_t> kept;  // vertices by their number in the grid
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
  // Each pass settles a cap that others wait for, or is the last one.
  for (std::size_t pass = 0; pass <= max_cap_passes; ++pass) {
    bool has_changed = false;
    std::vector<std::uint32_t> left;
    for (const std::uint32_t cap : caps) {
      if (!flipper.keeps(cap) || !is_cap(cap)) continue;
      if (flipper.settle(cap, is_cap)) has_changed = true;
      if (flipper.keeps(cap)) left.push_back(cap);
      if (flipper.keeps(cap) && flipper.touched()[0] == cap) left.push_back(flipper.touched()[1]);
    }
    std::sort(left.rbegin(), left.rend());  // each pass in the other direction than the one before
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

}  // namespace libmap
