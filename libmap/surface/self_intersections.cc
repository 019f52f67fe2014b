#include "libmap/surface/self_intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/geometry/voxel_key.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

constexpr std::size_t groups_grain = 64;
constexpr std::size_t triangles_grain = 1024;

Point point_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// Corners of a triangle, starting with those shared with another triangle.
struct Corners {
  std::array<Point, 3> points;
  CGAL::Orientation side_of(const Point& p) const {
    return CGAL::orientation(points[0], points[1], points[2], p);
  }
  Kernel::Triangle_3 triangle() const { return {points[0], points[1], points[2]}; }
};

// True if the points b[from..2] are strictly on one side of a's plane.
bool apart(const Corners& a, const Corners& b, std::size_t from) {
  const CGAL::Orientation side = a.side_of(b.points[from]);
  if (side == CGAL::COPLANAR) return false;
  for (std::size_t k = from + 1; k < 3; ++k)
    if (a.side_of(b.points[k]) != side) return false;
  return true;
}

class PairTest {
 public:
  explicit PairTest(const TriangleMesh& mesh) : mesh_(mesh) {}

  bool operator()(const TrianglePair& pair) const {
    Triangle a = mesh_.triangles[pair.first];
    Triangle b = mesh_.triangles[pair.second];
    const std::size_t shared = move_shared_to_front(a, b);
    if (shared == 3) return false;
    const Corners first = corners(a);
    const Corners second = corners(b);
    if (shared == 2) return overlap_at_edge(first, second);
    // The intersection is convex; with a common corner, it is that corner or extends to the
    // opposite side of one of the triangles.
    if (apart(first, second, shared) || apart(second, first, shared)) return false;
    if (shared == 0) return CGAL::do_intersect(first.triangle(), second.triangle());
    return CGAL::do_intersect(Kernel::Segment_3(first.points[1], first.points[2]),
                              second.triangle()) ||
           CGAL::do_intersect(Kernel::Segment_3(second.points[1], second.points[2]),
                              first.triangle());
  }

 private:
  static std::size_t move_shared_to_front(Triangle& a, Triangle& b) {
    std::size_t shared = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto found = std::find(b.begin() + static_cast<std::ptrdiff_t>(shared), b.end(), a[i]);
      if (found == b.end()) continue;
      std::swap(a[shared], a[i]);
      std::iter_swap(b.begin() + static_cast<std::ptrdiff_t>(shared), found);
      ++shared;
    }
    return shared;
  }

  // Triangles with a common edge overlap only if they are coplanar and on one side of the edge.
  static bool overlap_at_edge(const Corners& a, const Corners& b) {
    if (a.side_of(b.points[2]) != CGAL::COPLANAR) return false;
    return CGAL::coplanar_orientation(a.points[0], a.points[1], a.points[2], b.points[2]) ==
           CGAL::POSITIVE;
  }

  Corners corners(const Triangle& t) const {
    return {{point_of(mesh_.vertices[t[0]]), point_of(mesh_.vertices[t[1]]),
             point_of(mesh_.vertices[t[2]])}};
  }

  const TriangleMesh& mesh_;
};

// Conservative bounding box in single precision, relative to a vertex of the mesh: single precision
// has steps of half a meter in UTM coordinates.
struct Box {
  std::array<float, 3> low = {HUGE_VALF, HUGE_VALF, HUGE_VALF};
  std::array<float, 3> high = {-HUGE_VALF, -HUGE_VALF, -HUGE_VALF};

  bool meets(const Box& other) const {
    return low[0] <= other.high[0] && other.low[0] <= high[0] && low[1] <= other.high[1] &&
           other.low[1] <= high[1] && low[2] <= other.high[2] && other.low[2] <= high[2];
  }
  void extend(const Box& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], other.low[axis]);
      high[axis] = std::max(high[axis], other.high[axis]);
    }
  }
};

Box box_of(const TriangleMesh& mesh, std::uint32_t triangle) {
  Box box;
  const Eigen::Vector3d& origin = mesh.vertices[mesh.triangles.front()[0]];
  for (const std::uint32_t v : mesh.triangles[triangle])
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto along = static_cast<Eigen::Index>(axis);
      const auto value = static_cast<float>(mesh.vertices[v][along] - origin[along]);
      // Exceeds the rounding error.
      const float margin = std::numeric_limits<float>::epsilon() * std::abs(value) +
                           std::numeric_limits<float>::min();
      box.low[axis] = std::min(box.low[axis], value - margin);
      box.high[axis] = std::max(box.high[axis], value + margin);
    }
  return box;
}

// Bounding volume hierarchy: boxes of triangles in Z order, recursively joined in groups of eight.
class BoxTree {
 public:
  BoxTree(const TriangleMesh& mesh, const std::vector<std::uint32_t>& triangles)
      : triangles_(in_z_order(mesh, triangles)), levels_(1) {
    levels_[0].resize(triangles_.size());
    parallel_each(triangles_.size(), 4096,
                  [&](std::size_t n) { levels_[0][n] = box_of(mesh, triangles_[n]); });
    do {
      const std::vector<Box>& below = levels_.back();
      std::vector<Box> level((below.size() + 7) / 8);
      for (std::size_t n = 0; n < below.size(); ++n) level[n / 8].extend(below[n]);
      levels_.push_back(std::move(level));
    } while (levels_.back().size() > 1);
  }

  // Calls visit(triangle) for triangles whose boxes intersect `box`.
  template <typename Visit>
  void each_near(const Box& box, const Visit& visit) const {
    each_group_near(box, 0, [&](std::size_t group) {
      for (std::size_t n = 8 * group; n < end_of(group); ++n)
        if (levels_[0][n].meets(box)) visit(triangles_[n]);
    });
  }

  // Number of groups of eight triangles.
  std::size_t groups() const { return levels_[1].size(); }
  // Calls visit(a, b) for pairs with intersecting boxes and one triangle in the group; each pair
  // occurs in one group only.
  template <typename Visit>
  void each_pair(std::size_t group, const Visit& visit) const {
    each_group_near(levels_[1][group], group, [&](std::size_t other) {
      for (std::size_t i = 8 * group; i < end_of(group); ++i)
        for (std::size_t j = group == other ? i + 1 : 8 * other; j < end_of(other); ++j)
          if (levels_[0][i].meets(levels_[0][j])) visit(triangles_[i], triangles_[j]);
    });
  }

 private:
  static std::vector<std::uint32_t> in_z_order(const TriangleMesh& mesh,
                                               const std::vector<std::uint32_t>& triangles) {
    Eigen::AlignedBox3d bounds;
    for (const std::uint32_t t : triangles) bounds.extend(center_of(mesh, mesh.triangles[t]));
    const double cells_per_m = (voxel_cell_limit - 1) / std::max(bounds.sizes().maxCoeff(), 1e-300);
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order(triangles.size());
    parallel_each(triangles.size(), 4096, [&](std::size_t n) {
      const Eigen::Vector3d center = center_of(mesh, mesh.triangles[triangles[n]]);
      const Eigen::Vector3i cell = ((center - bounds.min()) * cells_per_m).cast<int>();
      order[n] = {z_order(pack({cell, 0})), triangles[n]};
    });
    std::sort(order.begin(), order.end());
    std::vector<std::uint32_t> sorted;
    sorted.reserve(order.size());
    for (const auto& [key, triangle] : order) sorted.push_back(triangle);
    return sorted;
  }

  std::size_t end_of(std::size_t group) const { return std::min(8 * group + 8, triangles_.size()); }

  // Calls visit(group) for groups from `first` on whose boxes intersect `box`.
  template <typename Visit>
  void each_group_near(const Box& box, std::size_t first, const Visit& visit) const {
    walk(levels_.size() - 1, 0, box, first, visit);
  }
  template <typename Visit>
  void walk(std::size_t level, std::size_t node, const Box& box, std::size_t first,
            const Visit& visit) const {
    const std::size_t end = std::min(node + 8, levels_[level].size());
    for (; node < end; ++node) {
      if (((node + 1) << (3 * (level - 1))) <= first || !levels_[level][node].meets(box)) continue;
      if (level == 1)
        visit(node);
      else
        walk(level - 1, 8 * node, box, first, visit);
    }
  }

  std::vector<std::uint32_t> triangles_;
  std::vector<std::vector<Box>> levels_;  // boxes of triangles, of groups of eight, and so on
};

bool is_collinear(const TriangleMesh& mesh, const Triangle& t) {
  const Eigen::Vector3d& a = mesh.vertices[t[0]];
  const double longest =
      std::max((mesh.vertices[t[1]] - a).squaredNorm(), (mesh.vertices[t[2]] - a).squaredNorm());
  // The exact predicate is used only if double precision does not suffice.
  if (area_normal(mesh, t).norm() > 1e-12 * longest) return false;
  return CGAL::collinear(point_of(a), point_of(mesh.vertices[t[1]]), point_of(mesh.vertices[t[2]]));
}

// 1 for triangles that `only` marks and that have an area.
std::vector<char> find_marked(const TriangleMesh& mesh, const std::vector<bool>& only) {
  std::vector<char> marks(mesh.triangles.size(), 0);
  parallel_each(marks.size(), 4096, [&](std::size_t t) {
    if ((only.empty() || only[t]) && !is_collinear(mesh, mesh.triangles[t])) marks[t] = 1;
  });
  return marks;
}

// Calls find(n, part) for each n below `count` and concatenates the parts.
template <typename Find>
std::vector<TrianglePair> found_in_ranges(std::size_t count, std::size_t grain, const Find& find) {
  return parallel_reduce(
      count, grain, std::vector<TrianglePair>(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<TrianglePair> part;
        for (std::size_t n = begin; n < end; ++n) find(n, part);
        return part;
      },
      [](std::vector<TrianglePair> a, const std::vector<TrianglePair>& b) {
        a.insert(a.end(), b.begin(), b.end());
        return a;
      });
}

}  // namespace

std::vector<TrianglePair> find_self_intersections(const TriangleMesh& mesh,
                                                  const std::vector<bool>& only) {
  const std::vector<char> marks = find_marked(mesh, only);
  std::vector<std::uint32_t> marked;
  for (std::uint32_t t = 0; t < marks.size(); ++t)
    if (marks[t] != 0) marked.push_back(t);
  const BoxTree tree(mesh, marked);
  const PairTest test(mesh);
  std::vector<TrianglePair> found = found_in_ranges(
      tree.groups(), groups_grain, [&](std::size_t n, std::vector<TrianglePair>& part) {
        tree.each_pair(n, [&](std::uint32_t a, std::uint32_t b) {
          const TrianglePair pair = std::minmax(a, b);
          if (test(pair)) part.push_back(pair);
        });
      });
  if (marked.size() < marks.size()) {
    const auto more = found_in_ranges(marks.size(), triangles_grain,
                                      [&](std::size_t n, std::vector<TrianglePair>& part) {
                                        if (marks[n] != 0) return;
                                        const auto t = static_cast<std::uint32_t>(n);
                                        tree.each_near(box_of(mesh, t), [&](std::uint32_t other) {
                                          const TrianglePair pair = std::minmax(t, other);
                                          if (!is_collinear(mesh, mesh.triangles[t]) && test(pair))
                                            part.push_back(pair);
                                        });
                                      });
    found.insert(found.end(), more.begin(), more.end());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace libmap
