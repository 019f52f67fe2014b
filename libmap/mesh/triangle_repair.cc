#include "libmap/mesh/triangle_repair.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <tuple>
#include <unordered_map>

#include "libmap/core/error.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::uint32_t no_vertex = 0xffffffff;
// A row of caps may wait for its last one.
constexpr std::size_t max_cap_passes = 1000;
constexpr double max_coordinate = 1e30;  // its powers that areas and volumes need are finite

// A coordinate counts a finite number of them.
constexpr double least_cell = 1e-270;

// Kept vertices by cells four distances wide: most searches look into one or two of them.
class VertexGrid {
 public:
  VertexGrid(const std::vector<Eigen::Vector3d>& vertices, double distance)
      : vertices_(vertices),
        distance_(distance),
        cells_per_m_(distance > 0.0 ? 1.0 / std::max(4.0 * distance, least_cell) : 1.0),
        next_(vertices.size(), no_vertex) {
    first_.reserve(vertices.size());
  }

  // The first kept vertex within the distance of v, or none.
  std::uint32_t find(std::uint32_t v) const {
    const Eigen::Array3d at = vertices_[v].array();
    const Eigen::Array3d low = cell_of(at - distance_);
    const Eigen::Array3d high = cell_of(at + distance_);
    std::uint32_t found = no_vertex;
    for (int corner = 0; corner < 8; ++corner) {
      const std::array<bool, 3> upper = {(corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0};
      if ((upper[0] && low.x() == high.x()) || (upper[1] && low.y() == high.y()) ||
          (upper[2] && low.z() == high.z()))
        continue;
      const auto cell =
          first_.find(key({upper[0] ? high.x() : low.x(), upper[1] ? high.y() : low.y(),
                           upper[2] ? high.z() : low.z()}));
      if (cell == first_.end()) continue;
      for (std::uint32_t n = cell->second; n != no_vertex; n = next_[n])
        if (n < found && (vertices_[n] - vertices_[v]).norm() <= distance_) found = n;
    }
    return found;
  }

  void keep(std::uint32_t v) {
    const auto [cell, is_new] = first_.try_emplace(key(cell_of(vertices_[v].array())), v);
    if (is_new) return;
    next_[v] = cell->second;
    cell->second = v;
  }

 private:
  // A search is half as wide as a cell: it meets one or two of them along each axis.
  Eigen::Array3d cell_of(const Eigen::Array3d& at) const { return (at * cells_per_m_).floor(); }

  // Cells that share a key share their vertices' list: distances decide.
  static std::uint64_t key(const Eigen::Array3d& cell) {
    std::uint64_t mixed = 0;
    for (int axis = 0; axis < 3; ++axis) {
      // Of numbers of any size, unlike those of an integer. Adding 0 makes -0 equal to 0.
      mixed = (mixed ^ std::bit_cast<std::uint64_t>(cell[axis] + 0.0)) * 0x9e3779b97f4a7c15ULL;
      mixed ^= mixed >> 29U;
    }
    return mixed;
  }

  const std::vector<Eigen::Vector3d>& vertices_;
  double distance_;
  double cells_per_m_;
  std::unordered_map<std::uint64_t, std::uint32_t> first_;
  std::vector<std::uint32_t> next_;
};

HalfEdge longest_edge(const TriangleMesh& mesh, std::uint32_t t) {
  HalfEdge longest = 3 * t;
  double length = -1.0;
  for (HalfEdge h = 3 * t; h < 3 * t + 3; ++h) {
    const double here =
        (mesh.vertices[target_of(mesh.triangles, h)] - mesh.vertices[source_of(mesh.triangles, h)])
            .squaredNorm();
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
      : mesh_(mesh),
        opposite_(opposites_of(mesh.triangles, edges_of(mesh.triangles, mesh.vertices.size()))),
        keep_(mesh.triangles.size(), true) {}

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
    // All of the area was the neighbour's.
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
  VertexGrid grid(mesh.vertices, distance_m);
  std::vector<std::uint32_t> kept_of(mesh.vertices.size());
  std::size_t joined = 0;
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    const std::uint32_t found = grid.find(v);
    kept_of[v] = found == no_vertex ? v : found;
    if (found == no_vertex)
      grid.keep(v);
    else
      ++joined;
  }
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
