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

namespace libmap {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

constexpr std::size_t leaf_size = 8;
constexpr std::size_t leaves_grain = 64;
constexpr std::size_t triangles_grain = 1024;

Point point_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// The corners of a triangle, those shared with another first.
struct Corners {
  std::array<Point, 3> points;
  CGAL::Orientation side_of(const Point& p) const {
    return CGAL::orientation(points[0], points[1], points[2], p);
  }
  Kernel::Triangle_3 triangle() const { return {points[0], points[1], points[2]}; }
};

// Whether all of the points b[from..2] lie strictly on one side of a's plane.
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
    // The triangles meet in a convex set; with a corner in common, it is that corner alone or
    // reaches to the opposite side of one of them.
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

  // Triangles with an edge in common overlap only if they lie in one plane, on one side of it.
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

// Of triangles, in single precision: no smaller than they are.
struct Box {
  std::array<float, 3> low{};
  std::array<float, 3> high{};

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
  box.low.fill(HUGE_VALF);
  box.high.fill(-HUGE_VALF);
  for (const std::uint32_t v : mesh.triangles[triangle])
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = static_cast<float>(mesh.vertices[v][static_cast<Eigen::Index>(axis)]);
      // More than what was rounded.
      const float margin = std::numeric_limits<float>::epsilon() * std::abs(value) +
                           std::numeric_limits<float>::min();
      box.low[axis] = std::min(box.low[axis], value - margin);
      box.high[axis] = std::max(box.high[axis], value + margin);
    }
  return box;
}

// Boxes of triangles, halved by the median along their longest side. Nodes stand in preorder, so
// that a walk needs no stack.
class BoxTree {
 public:
  BoxTree(const TriangleMesh& mesh, const std::vector<std::uint32_t>& triangles)
      : items_(triangles.size()), boxes_(triangles.size()) {
    if (triangles.empty()) return;
    parallel_for(triangles.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) {
        const Box box = box_of(mesh, triangles[n]);
        for (std::size_t axis = 0; axis < 3; ++axis)
          items_[n].center[axis] = 0.5F * box.low[axis] + 0.5F * box.high[axis];
        items_[n].triangle = triangles[n];
      }
    });
    const auto count = static_cast<std::uint32_t>(triangles.size());
    nodes_.resize(node_count(count));
    std::vector<Range> parts;
    split(0, {0, count}, split_levels, parts);
    parallel_each(parts.size(), [&](std::size_t n) {
      std::vector<Range> whole;
      split(parts[n].node, parts[n], std::numeric_limits<int>::max(), whole);
    });
    parallel_for(items_.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) boxes_[n] = box_of(mesh, items_[n].triangle);
    });
    for (std::size_t n = nodes_.size(); n-- > 0;) find_box(n);
    for (std::uint32_t n = 0; n < nodes_.size(); ++n)
      if (nodes_[n].is_leaf()) leaves_.push_back(n);
  }

  // visit(triangle) for those whose boxes meet this one.
  template <typename Visit>
  void each_near(const Box& box, const Visit& visit) const {
    each_leaf_near(box, 0, [&](const Node& leaf) {
      for (std::uint32_t n = leaf.begin; n < leaf.end; ++n)
        if (boxes_[n].meets(box)) visit(items_[n].triangle);
    });
  }

  // Of the leaves.
  const std::vector<std::uint32_t>& leaves() const { return leaves_; }
  // visit(a, b) for pairs whose boxes meet, one in the leaf; of all leaves together, each pair
  // once.
  template <typename Visit>
  void each_pair(std::uint32_t leaf, const Visit& visit) const {
    const Node& own = nodes_[leaf];
    each_leaf_near(own.box, leaf, [&](const Node& other) {
      for (std::uint32_t i = own.begin; i < own.end; ++i)
        for (std::uint32_t j = &own == &other ? i + 1 : other.begin; j < other.end; ++j)
          if (boxes_[i].meets(boxes_[j])) visit(items_[i].triangle, items_[j].triangle);
    });
  }

 private:
  // Levels of the tree that are made one after the other, before threads share the rest.
  static constexpr int split_levels = 5;

  struct Item {
    std::array<float, 3> center{};
    std::uint32_t triangle = 0;
  };
  struct Node {
    Box box;
    std::uint32_t begin = 0;  // of its items
    std::uint32_t end = 0;
    std::uint32_t after = 0;  // the first node that is not below this one
    bool is_leaf() const { return end - begin <= leaf_size; }
  };
  struct Range {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
    std::uint32_t node = 0;
  };

  // From a node on.
  template <typename Visit>
  void each_leaf_near(const Box& box, std::uint32_t first, const Visit& visit) const {
    for (std::uint32_t n = first; n < nodes_.size();) {
      const Node& node = nodes_[n];
      if (!node.box.meets(box)) {
        n = node.after;
        continue;
      }
      if (node.is_leaf()) visit(node);
      ++n;
    }
  }

  static std::uint32_t node_count(std::uint32_t items) {
    return items <= leaf_size ? 1 : 1 + node_count(items / 2) + node_count(items - items / 2);
  }

  // Makes the nodes of a range, `levels` of them; of the ranges below, which are left, none is
  // made. Returns the node after them.
  std::uint32_t split(std::uint32_t number, Range range, int levels, std::vector<Range>& left) {
    range.node = number;
    if (levels == 0) {
      left.push_back(range);
      return number + node_count(range.end - range.begin);
    }
    Node& node = nodes_[number];
    node.begin = range.begin;
    node.end = range.end;
    if (node.is_leaf()) return node.after = number + 1;
    const std::uint32_t middle = range.begin + (range.end - range.begin) / 2;
    halve(range, middle);
    const std::uint32_t second = split(number + 1, {range.begin, middle}, levels - 1, left);
    return node.after = split(second, {middle, range.end}, levels - 1, left);
  }

  void halve(const Range& range, std::uint32_t middle) {
    Box centers{items_[range.begin].center, items_[range.begin].center};
    for (std::uint32_t n = range.begin + 1; n < range.end; ++n)
      centers.extend({items_[n].center, items_[n].center});
    std::size_t axis = 0;
    for (std::size_t a = 1; a < 3; ++a)
      if (centers.high[a] - centers.low[a] > centers.high[axis] - centers.low[axis]) axis = a;
    const auto first = items_.begin();
    std::nth_element(first + range.begin, first + middle, first + range.end,
                     [axis](const Item& a, const Item& b) {
                       return std::pair(a.center[axis], a.triangle) <
                              std::pair(b.center[axis], b.triangle);
                     });
  }

  // Of those below it.
  void find_box(std::size_t number) {
    Node& node = nodes_[number];
    if (node.is_leaf()) {
      node.box = boxes_[node.begin];
      for (std::uint32_t n = node.begin + 1; n < node.end; ++n) node.box.extend(boxes_[n]);
    } else {
      node.box = nodes_[number + 1].box;
      node.box.extend(nodes_[nodes_[number + 1].after].box);
    }
  }

  std::vector<Item> items_;
  std::vector<Box> boxes_;  // of the items
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> leaves_;
};

bool is_collinear(const TriangleMesh& mesh, const Triangle& t) {
  const Eigen::Vector3d& a = mesh.vertices[t[0]];
  const double longest =
      std::max((mesh.vertices[t[1]] - a).squaredNorm(), (mesh.vertices[t[2]] - a).squaredNorm());
  // The exact predicate is asked only where doubles cannot tell.
  if (area_normal(mesh, t).norm() > 1e-12 * longest) return false;
  return CGAL::collinear(point_of(a), point_of(mesh.vertices[t[1]]), point_of(mesh.vertices[t[2]]));
}

// 1 for triangles with an area, of those that `only` marks.
std::vector<char> find_marked(const TriangleMesh& mesh, const std::vector<bool>& only) {
  std::vector<char> marks(mesh.triangles.size(), 0);
  parallel_for(marks.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t)
      if ((only.empty() || only[t]) && !is_collinear(mesh, mesh.triangles[t])) marks[t] = 1;
  });
  return marks;
}

// find(n, part) for each number below `count`, the parts joined.
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
      tree.leaves().size(), leaves_grain, [&](std::size_t n, std::vector<TrianglePair>& part) {
        tree.each_pair(tree.leaves()[n], [&](std::uint32_t a, std::uint32_t b) {
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
