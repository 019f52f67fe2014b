#include "libmap/surface/self_intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

constexpr std::size_t leaf_size = 8;
constexpr std::size_t leaves_grain = 64;

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

// Bounding boxes of triangles, halved by the median along their longest side. Nodes stand in
// preorder, so that a walk needs no stack.
class BoxTree {
 public:
  struct Node {
    Eigen::AlignedBox3d box;
    std::uint32_t begin = 0;  // of its triangles in order()
    std::uint32_t end = 0;
    std::uint32_t after = 0;  // the first node that is not below this one
    bool marked = false;      // one of its triangles has a mark
    bool is_leaf() const { return end - begin <= leaf_size; }
  };

  BoxTree(const TriangleMesh& mesh, std::vector<std::uint32_t> triangles,
          const std::vector<bool>& only)
      : only_(only), order_(std::move(triangles)) {
    boxes_.resize(mesh.triangles.size());
    for (const std::uint32_t t : order_)
      for (const std::uint32_t v : mesh.triangles[t]) boxes_[t].extend(mesh.vertices[v]);
    if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
    for (std::uint32_t n = 0; n < nodes_.size(); ++n)
      if (nodes_[n].is_leaf() && nodes_[n].marked) marked_leaves_.push_back(n);
  }

  const std::vector<std::uint32_t>& marked_leaves() const { return marked_leaves_; }

  // visit(a, b) for pairs of triangles whose boxes meet, one in the leaf, at least one marked; of
  // all marked leaves together, each pair once.
  template <typename Visit>
  void for_each_pair(std::uint32_t leaf, const Visit& visit) const {
    const Node& own = nodes_[leaf];
    for (std::uint32_t n = 0; n < nodes_.size();) {
      const Node& other = nodes_[n];
      if (!other.box.intersects(own.box)) {
        n = other.after;
      } else if (!other.is_leaf()) {
        ++n;
      } else {
        if (n >= leaf || !other.marked) visit_pairs(own, other, visit);
        n = other.after;
      }
    }
  }

 private:
  bool is_marked(std::uint32_t t) const { return only_.empty() || only_[t]; }

  template <typename Visit>
  void visit_pairs(const Node& own, const Node& other, const Visit& visit) const {
    for (std::uint32_t i = own.begin; i < own.end; ++i) {
      const std::uint32_t a = order_[i];
      for (std::uint32_t j = &own == &other ? i + 1 : other.begin; j < other.end; ++j) {
        const std::uint32_t b = order_[j];
        if (boxes_[a].intersects(boxes_[b]) && (is_marked(a) || is_marked(b))) visit(a, b);
      }
    }
  }

  void build(std::uint32_t begin, std::uint32_t end) {
    const std::size_t index = nodes_.size();
    Node node;
    node.begin = begin;
    node.end = end;
    for (std::uint32_t n = begin; n < end; ++n) {
      node.box.extend(boxes_[order_[n]]);
      node.marked = node.marked || is_marked(order_[n]);
    }
    nodes_.push_back(node);
    if (!node.is_leaf()) {
      Eigen::Index axis = 0;
      node.box.sizes().maxCoeff(&axis);
      const auto key = [&](std::uint32_t t) {
        return std::pair(boxes_[t].min()[axis] + boxes_[t].max()[axis], t);
      };
      const std::uint32_t middle = begin + (end - begin) / 2;
      std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                       [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
      build(begin, middle);
      build(middle, end);
    }
    nodes_[index].after = static_cast<std::uint32_t>(nodes_.size());
  }

  const std::vector<bool>& only_;
  std::vector<std::uint32_t> order_;
  std::vector<Eigen::AlignedBox3d> boxes_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> marked_leaves_;
};

bool is_collinear(const TriangleMesh& mesh, const Triangle& t) {
  const Eigen::Vector3d& a = mesh.vertices[t[0]];
  const double longest =
      std::max((mesh.vertices[t[1]] - a).squaredNorm(), (mesh.vertices[t[2]] - a).squaredNorm());
  // The exact predicate is asked only where doubles cannot tell.
  if (area_normal(mesh, t).norm() > 1e-12 * longest) return false;
  return CGAL::collinear(point_of(a), point_of(mesh.vertices[t[1]]), point_of(mesh.vertices[t[2]]));
}

std::vector<std::uint32_t> triangles_with_area(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> kept;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    if (!is_collinear(mesh, mesh.triangles[t])) kept.push_back(t);
  return kept;
}

}  // namespace

std::vector<TrianglePair> find_self_intersections(const TriangleMesh& mesh,
                                                  const std::vector<bool>& only) {
  const BoxTree tree(mesh, triangles_with_area(mesh), only);
  const PairTest test(mesh);
  std::vector<TrianglePair> found = parallel_reduce(
      tree.marked_leaves().size(), leaves_grain, std::vector<TrianglePair>(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<TrianglePair> part;
        for (std::size_t n = begin; n < end; ++n)
          tree.for_each_pair(tree.marked_leaves()[n], [&](std::uint32_t a, std::uint32_t b) {
            const TrianglePair pair = std::minmax(a, b);
            if (test(pair)) part.push_back(pair);
          });
        return part;
      },
      [](std::vector<TrianglePair> a, const std::vector<TrianglePair>& b) {
        a.insert(a.end(), b.begin(), b.end());
        return a;
      });
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace libmap
