#include "libgtd/terrain/planar_delaunay.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "libgtd/terrain/radix_sort.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

enum class Fate : std::uint8_t { unknown, kept, dropped };

using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;  // index
using FaceBase = CGAL::Triangulation_face_base_with_info_2<Fate, Kernel>;
using Triangulation =
    CGAL::Delaunay_triangulation_2<Kernel,
                                   CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>>;
using Face = Triangulation::Face_handle;
using Points = std::vector<Eigen::Vector3d>;
using Indices = std::vector<std::uint32_t>;

constexpr std::uint32_t hilbert_cells = 4096;  // cells per side
constexpr unsigned hilbert_bits = 24;

// Index of a cell of a 4096 x 4096 square on the Hilbert curve (Hilbert 1891).
std::uint32_t hilbert_index(std::uint32_t x, std::uint32_t y) {
  std::uint32_t curve_index = 0;
  for (std::uint32_t bit = hilbert_cells / 2; bit > 0; bit /= 2) {
    const std::uint32_t right = (x & bit) != 0 ? 1 : 0;
    const std::uint32_t up = (y & bit) != 0 ? 1 : 0;
    curve_index = curve_index << 2 | ((3 * right) ^ up);
    // The curve is transposed in the lower quadrants, and mirrored, too, in the lower right one.
    // Computed without branches, which would be unpredictable.
    const std::uint32_t transposed = up - 1;
    const std::uint32_t mirrored = transposed & (0U - right);
    x ^= mirrored;
    y ^= mirrored;
    const std::uint32_t swapped = (x ^ y) & transposed;
    x ^= swapped;
    y ^= swapped;
  }
  return curve_index;
}

// Neighbors on the Hilbert curve are close in the plane, so that each point is located within a few
// triangles of its predecessor. For a strip of 16,384 points this order takes 0.9 ms, CGAL's
// spatial_sort 3.0; the triangulation takes 10.4 ms with either.
void sort_along_hilbert(const Points& points, Indices& members) {
  struct Item {
    std::uint32_t curve_index;
    std::uint32_t index;
  };
  if (members.empty()) return;
  Eigen::Vector2d low = points[members.front()].head<2>(), high = low;
  for (const std::uint32_t i : members) {
    low = low.cwiseMin(points[i].head<2>());
    high = high.cwiseMax(points[i].head<2>());
  }
  const double side = (high - low).maxCoeff();
  const auto cell = [&](double offset) {
    const double at = offset / side * hilbert_cells;
    return at < hilbert_cells ? static_cast<std::uint32_t>(at) : hilbert_cells - 1;
  };
  std::vector<Item> items;
  items.reserve(members.size());
  for (const std::uint32_t i : members)
    items.push_back(
        {hilbert_index(cell(points[i].x() - low.x()), cell(points[i].y() - low.y())), i});
  radix_sort(items, hilbert_bits, [](const Item& item) { return item.curve_index; });
  for (std::size_t n = 0; n < items.size(); ++n) members[n] = items[n].index;
}

// Inserts in rounds of four times as many points as before (Amenta, Choi, Rote 2003): later points
// are then among earlier ones, where fewer long thin triangles arise.
Indices in_rounds(const Indices& members) {
  Indices rounds;
  rounds.reserve(members.size());
  std::size_t step = 1;
  while (32 * step < members.size()) step *= 4;
  for (bool first = true; step > 0; step /= 4, first = false)
    for (std::size_t n = 0; n < members.size(); n += step)
      if (first || n % (4 * step) != 0) rounds.push_back(members[n]);
  return rounds;
}

// Keeps the highest of points with the same x and y, in any order.
Triangulation triangulate(const Points& points, Indices members) {
  sort_along_hilbert(points, members);
  members = in_rounds(members);
  // Fetched at once and not one by one between insertions, for the cache.
  std::vector<Kernel::Point_2> plane_points;
  plane_points.reserve(members.size());
  for (const std::uint32_t i : members) plane_points.emplace_back(points[i].x(), points[i].y());
  Triangulation triangulation;
  triangulation.tds().vertices().reserve(members.size() + 1);
  triangulation.tds().faces().reserve(2 * members.size() + 2);
  Face hint;
  for (std::size_t n = 0; n < members.size(); ++n) {
    const std::size_t before = triangulation.number_of_vertices();
    const auto vertex = triangulation.insert(plane_points[n], hint);
    const bool added = triangulation.number_of_vertices() > before;
    if (added || points[members[n]].z() > points[vertex->info()].z()) vertex->info() = members[n];
    hint = vertex->face();
  }
  return triangulation;
}

std::array<std::uint32_t, 3> corners_of(const Face& face) {
  const auto corner = [&](int n) { return face->vertex(n % 3)->info(); };
  const auto comes_before = [&](int a, int b) {
    const auto &p = face->vertex(a)->point(), &q = face->vertex(b)->point();
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  };
  const int least = comes_before(0, 1) ? (comes_before(0, 2) ? 0 : 2) : comes_before(1, 2) ? 1 : 2;
  return {corner(least), corner(least + 1), corner(least + 2)};
}

// Points between two lines parallel to y, [low, high) in x, and their triangulation.
struct Strip {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  Indices members;
  std::vector<std::array<std::uint32_t, 3>> final_triangles;
  std::vector<std::array<std::uint32_t, 2>> rims;  // edges with a final triangle to the left
  Indices open;                                    // corners of the hull and of others
  std::size_t vertices = 0;
};

// Returns true if the circumcircle of a triangle is certainly inside the strip, so that no point
// outside touches it. The margin of a thousandth of its radius covers rounding, which reaches 1e-5
// of the radius for the thinnest triangles evaluated.
bool is_final(const Face& face, const Strip& strip) {
  const auto &a = face->vertex(0)->point(), &b = face->vertex(1)->point(),
             &c = face->vertex(2)->point();
  const double bx = b.x() - a.x(), by = b.y() - a.y(), cx = c.x() - a.x(), cy = c.y() - a.y();
  const double bb = bx * bx + by * by, cc = cx * cx + cy * cy;
  const double area = bx * cy - by * cx;
  if (!(area > 1e-10 * std::max(bb, cc))) return false;
  const double x = (cy * bb - by * cc) / (2 * area), y = (bx * cc - cx * bb) / (2 * area);
  const double reach = std::sqrt(x * x + y * y) * (1 + 1e-3) + 1e-14 * std::abs(a.x());
  return a.x() + x - reach > strip.low && a.x() + x + reach < strip.high;
}

// Vertices of edge `n`, with the face to its left.
std::array<std::uint32_t, 2> edge_of(const Face& face, int n) {
  return {face->vertex(Triangulation::ccw(n))->info(), face->vertex(Triangulation::cw(n))->info()};
}

void triangulate_strip(const Points& points, Strip& strip) {
  Triangulation triangulation = triangulate(points, std::move(strip.members));
  strip.vertices = triangulation.number_of_vertices();
  if (triangulation.dimension() < 2) {
    for (const auto& vertex : triangulation.finite_vertex_handles())
      strip.open.push_back(vertex->info());
    return;
  }
  for (const Face face : triangulation.all_face_handles())
    face->info() =
        !triangulation.is_infinite(face) && is_final(face, strip) ? Fate::kept : Fate::dropped;
  strip.final_triangles.reserve(triangulation.number_of_faces());
  for (const Face face : triangulation.all_face_handles())
    if (face->info() == Fate::kept) {
      strip.final_triangles.push_back(corners_of(face));
      for (int n = 0; n < 3; ++n)
        if (face->neighbor(n)->info() != Fate::kept) strip.rims.push_back(edge_of(face, n));
    } else {
      for (int n = 0; n < 3; ++n)
        if (!triangulation.is_infinite(face->vertex(n)))
          strip.open.push_back(face->vertex(n)->info());
    }
  std::sort(strip.open.begin(), strip.open.end());
  strip.open.erase(std::unique(strip.open.begin(), strip.open.end()), strip.open.end());
}

std::vector<Strip> cut_into_strips(const Points& points, std::size_t points_per_strip) {
  std::vector<Strip> strips(std::max<std::size_t>(1, points.size() / points_per_strip));
  std::vector<double> lines;
  if (strips.size() > 1) {
    // A sample is sufficient to place the lines.
    std::vector<double> xs;
    for (std::size_t n = 0; n < points.size(); n += 16) xs.push_back(points[n].x());
    std::sort(xs.begin(), xs.end());
    for (std::size_t s = 1; s < strips.size(); ++s) {
      lines.push_back(xs[xs.size() * s / strips.size()]);
      strips[s - 1].high = strips[s].low = lines.back();
    }
  }
  for (Strip& strip : strips) strip.members.reserve(points.size() / strips.size() + 1);
  for (std::uint32_t i = 0; i < points.size(); ++i)
    strips[static_cast<std::size_t>(std::upper_bound(lines.begin(), lines.end(), points[i].x()) -
                                    lines.begin())]
        .members.push_back(i);
  return strips;
}

// Set of edges between two points, in either direction.
class Edges {
 public:
  explicit Edges(const std::vector<Strip>& strips) {
    for (const Strip& strip : strips)
      for (const auto& [from, to] : strip.rims) of_pair_[key_of(from, to)] = from < to;
  }
  bool empty() const { return of_pair_.empty(); }
  // Fate of a face to the left of an edge; unknown if the edge is not a rim.
  Fate fate_beside(const std::array<std::uint32_t, 2>& edge) const {
    const auto found = of_pair_.find(key_of(edge[0], edge[1]));
    if (found == of_pair_.end()) return Fate::unknown;
    return found->second == (edge[0] < edge[1]) ? Fate::dropped : Fate::kept;
  }

 private:
  static std::uint64_t key_of(std::uint32_t a, std::uint32_t b) {
    return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  }
  std::unordered_map<std::uint64_t, bool> of_pair_;  // true: the final side is to the left
};

// Triangles between the final ones of the strips. Every triangle that is not final has its corners
// among the open points and no other point in its circumcircle, so that it is in the triangulation
// of the open points. The rims separate these triangles from those in the area of final ones.
void triangulate_between(const Points& points, const std::vector<Strip>& strips,
                         PlanarTriangulation& whole) {
  Indices open;
  for (const Strip& strip : strips) open.insert(open.end(), strip.open.begin(), strip.open.end());
  const Triangulation triangulation = triangulate(points, std::move(open));
  if (triangulation.dimension() < 2) return;
  const Edges rims(strips);
  std::vector<Face> faces, reached;
  for (const Face face : triangulation.finite_face_handles()) {
    faces.push_back(face);
    face->info() = rims.empty() ? Fate::kept : Fate::unknown;
    for (int n = 0; n < 3 && face->info() == Fate::unknown; ++n)
      face->info() = rims.fate_beside(edge_of(face, n));
    if (face->info() != Fate::unknown) reached.push_back(face);
  }
  while (!reached.empty()) {
    const Face face = reached.back();
    reached.pop_back();
    for (int n = 0; n < 3; ++n) {
      const Face& next = face->neighbor(n);
      if (triangulation.is_infinite(next) || next->info() != Fate::unknown) continue;
      // The fate of a face beside a rim is known already, so that no rim is crossed.
      next->info() = face->info();
      reached.push_back(next);
    }
  }
  for (const Face& face : faces)
    if (face->info() == Fate::kept) whole.triangles.push_back(corners_of(face));
}

}  // namespace

PlanarTriangulation triangulate_in_plane(const Points& points, std::size_t points_per_strip) {
  std::vector<Strip> strips = cut_into_strips(points, std::max<std::size_t>(points_per_strip, 1));
  libmap::parallel_each(strips.size(),
                        [&](std::size_t s) { triangulate_strip(points, strips[s]); });
  PlanarTriangulation whole;
  for (const Strip& strip : strips) {
    whole.vertices += strip.vertices;
    whole.triangles.insert(whole.triangles.end(), strip.final_triangles.begin(),
                           strip.final_triangles.end());
  }
  triangulate_between(points, strips, whole);
  return whole;
}

}  // namespace libgtd
