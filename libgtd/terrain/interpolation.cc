#include "libgtd/terrain/interpolation.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "libgtd/terrain/planar_delaunay.h"
#include "libgtd/terrain/radix_sort.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/single_precision.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_2;
using Eigen::Vector3d;

constexpr std::size_t triangles_per_chunk = 4096;
constexpr std::size_t columns_at_once = 16;  // grid columns per task of a thread

// Coordinates of grid nodes along one axis, ascending.
using Axis = std::vector<double>;

struct Box {
  double min_x, max_x, min_y, max_y;
  double area() const { return (max_x - min_x) * (max_y - min_y); }
};

struct Triangle {
  std::array<Point, 3> at;
  std::array<double, 3> z;
};

using Corners = std::array<std::uint32_t, 3>;

// Grid columns first .. last - 1 that may intersect a triangle.
struct Placement {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
  bool refused = false;  // the triangle has an edge that is too long
};

std::vector<Vector3d> finite_points(const libmap::PointCloud& cloud, InterpolationMethod method) {
  std::vector<Vector3d> points;
  points.reserve(cloud.size());
  for (const Vector3d& p : cloud.positions) {
    const bool single = method == InterpolationMethod::thesis;
    const Vector3d point = single ? libmap::rounded_to_single(p) : p;
    if (point.allFinite()) points.push_back(point);
  }
  return points;
}

Box box_of(const std::vector<Vector3d>& points) {
  Box box{points[0].x(), points[0].x(), points[0].y(), points[0].y()};
  for (const Vector3d& p : points) {
    box.min_x = std::min(box.min_x, p.x());
    box.max_x = std::max(box.max_x, p.x());
    box.min_y = std::min(box.min_y, p.y());
    box.max_y = std::max(box.max_y, p.y());
  }
  return box;
}

double area_of_cells(const std::vector<Vector3d>& points, const Box& box, double cell) {
  const double column = std::floor(box.min_x / cell), row = std::floor(box.min_y / cell);
  const double columns = std::floor(box.max_x / cell) - column + 1;
  const double rows = std::floor(box.max_y / cell) - row + 1;
  if (!(columns * rows < 0x1p52)) {  // limit of exact integers
    std::vector<std::pair<double, double>> cells;
    cells.reserve(points.size());
    for (const Vector3d& p : points)
      cells.emplace_back(std::floor(p.x() / cell), std::floor(p.y() / cell));
    std::sort(cells.begin(), cells.end());
    const auto end = std::unique(cells.begin(), cells.end());
    return static_cast<double>(end - cells.begin()) * cell * cell;
  }
  std::vector<std::uint64_t> keys;
  keys.reserve(points.size());
  for (const Vector3d& p : points)
    keys.push_back(static_cast<std::uint64_t>((std::floor(p.x() / cell) - column) * rows +
                                              (std::floor(p.y() / cell) - row)));
  unsigned bits = 1;
  while (columns * rows > std::ldexp(1.0, static_cast<int>(bits))) ++bits;
  radix_sort(keys, bits, [](std::uint64_t one) { return one; });
  const auto end = std::unique(keys.begin(), keys.end());
  return static_cast<double>(end - keys.begin()) * cell * cell;
}

double occupied_area(const std::vector<Vector3d>& points, const Box& box, double cell) {
  if (cell > 0) return area_of_cells(points, box, cell);
  cell = 4 * std::sqrt(box.area() / static_cast<double>(points.size()));
  return std::min(box.area(), area_of_cells(points, box, cell));
}

// Eq. 3-5 as in the author's program: its 5/3 is an integer division with result 1.
double thesis_spacing(std::size_t count, const Box& box) {
  const double density =
      static_cast<double>(count) / ((box.max_x - box.min_x) * (box.max_y - box.min_y));
  return 1 / (std::round(std::sqrt(density) * 10000) / 10000);
}

std::size_t max_nodes(std::size_t points, const InterpolationOptions& options) {
  constexpr double always = 1e6;
  const double most =
      always + static_cast<double>(options.max_nodes_per_point) * static_cast<double>(points);
  return most < static_cast<double>(options.max_nodes) ? static_cast<std::size_t>(most)
                                                       : options.max_nodes;
}

void check_grid(const Box& box, double spacing, std::size_t max_nodes) {
  const double columns = (box.max_x - box.min_x) / spacing + 1;
  const double rows = (box.max_y - box.min_y) / spacing + 1;
  if (!(columns * rows <= static_cast<double>(max_nodes)))
    throw libmap::Error(
        "too small: the interpolation grid over the points' x and y would have more than " +
            std::to_string(max_nodes) + " nodes; remove points far from the others",
        {.field = "grid spacing", .value = libmap::to_text(spacing) + " m"});
  const double farthest = std::max(
      {std::abs(box.min_x), std::abs(box.max_x), std::abs(box.min_y), std::abs(box.max_y)});
  if (!(spacing > farthest * 0x1.0p-50))
    throw libmap::Error("too small for points this far from the origin",
                        {.field = "grid spacing", .value = libmap::to_text(spacing) + " m"});
}

Axis repeated_addition(double min, double max, double spacing) {
  Axis axis;
  for (double at = min; at < max; at += spacing) axis.push_back(at);
  return axis;
}

Axis lattice(double min, double max, double spacing) {
  Axis axis;
  for (double i = std::ceil(min / spacing); i * spacing <= max; ++i) axis.push_back(i * spacing);
  return axis;
}

// Returns the first node of `axis` at or after `at`; the spacing gives a first guess.
std::size_t first_node(const Axis& axis, double at, double spacing) {
  const double index = (at - axis.front()) / spacing - 1;
  std::size_t i = !(index > 0)                               ? 0
                  : index < static_cast<double>(axis.size()) ? static_cast<std::size_t>(index)
                                                             : axis.size();
  while (i > 0 && axis[i - 1] >= at) --i;
  while (i < axis.size() && axis[i] < at) ++i;
  return i;
}

// Range of y in which the vertical line at `x` intersects the triangle, slightly widened.
std::pair<double, double> crossing(const Triangle& t, double x) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t a = 0; a < 3; ++a) {
    const Point& p = t.at[a];
    const Point& q = t.at[(a + 1) % 3];
    if (std::min(p.x(), q.x()) > x || std::max(p.x(), q.x()) < x) continue;
    const double run = q.x() - p.x();
    if (run == 0) {
      low = std::min({low, p.y(), q.y()});
      high = std::max({high, p.y(), q.y()});
      continue;
    }
    const double y = p.y() + std::clamp((x - p.x()) / run, 0.0, 1.0) * (q.y() - p.y());
    low = std::min(low, y);
    high = std::max(high, y);
  }
  const double margin = 1e-14 * (std::abs(low) + std::abs(high)) + 1e-12 * (high - low);
  return {low - margin, high + margin};
}

bool covers(const Triangle& t, const Point& node) {
  return CGAL::orientation(t.at[0], t.at[1], node) != CGAL::RIGHT_TURN &&
         CGAL::orientation(t.at[1], t.at[2], node) != CGAL::RIGHT_TURN &&
         CGAL::orientation(t.at[2], t.at[0], node) != CGAL::RIGHT_TURN;
}

// Height by n . (r - r0) = 0, in the order of operations of the author's program.
double plane_height(const Triangle& t, double x, double y) {
  const Vector3d origin(t.at[0].x(), t.at[0].y(), t.z[0]);
  const Vector3d b = Vector3d(t.at[1].x(), t.at[1].y(), t.z[1]) - origin;
  const Vector3d c = Vector3d(t.at[2].x(), t.at[2].y(), t.z[2]) - origin;
  const Vector3d n = c.cross(b);
  return (n.x() * origin.x() + n.y() * origin.y() + n.z() * origin.z() - x * n.x() - y * n.y()) /
         n.z();
}

// Height from coordinates relative to a corner, which are precise far from the origin, too. Clamped
// to the heights of the corners, because the area of very thin triangles is inaccurate.
double barycentric_height(const Triangle& t, double x, double y) {
  const double bx = t.at[1].x() - t.at[0].x(), by = t.at[1].y() - t.at[0].y();
  const double cx = t.at[2].x() - t.at[0].x(), cy = t.at[2].y() - t.at[0].y();
  const double px = x - t.at[0].x(), py = y - t.at[0].y();
  const double area = bx * cy - by * cx;
  const double u = (px * cy - py * cx) / area;
  const double v = (bx * py - by * px) / area;
  const double z = t.z[0] + u * (t.z[1] - t.z[0]) + v * (t.z[2] - t.z[0]);
  const auto [low, high] = std::minmax({t.z[0], t.z[1], t.z[2]});
  return std::isnan(z) ? t.z[0] : std::clamp(z, low, high);
}

bool longer_than(const Triangle& t, double limit) {
  for (std::size_t a = 0; a < 3; ++a)
    if (CGAL::squared_distance(t.at[a], t.at[(a + 1) % 3]) > limit * limit) return true;
  return false;
}

// Heights at the grid nodes; NaN without a triangle. A node on an edge takes the lower height of
// its triangles, which differ by rounding, so that the order of the triangles has no effect.
class HeightGrid {
 public:
  HeightGrid(Axis xs, Axis ys, double spacing)
      : xs_(std::move(xs)),
        ys_(std::move(ys)),
        spacing_(spacing),
        z_(xs_.size() * ys_.size(), std::numeric_limits<double>::quiet_NaN()) {}

  void place(Placement& placed, const Triangle& t) const {
    if (xs_.empty()) return;
    const auto [low, high] = std::minmax({t.at[0].x(), t.at[1].x(), t.at[2].x()});
    std::size_t last = first_node(xs_, low, spacing_);
    placed.first = static_cast<std::uint32_t>(last);
    while (last < xs_.size() && xs_[last] <= high) ++last;
    placed.last = static_cast<std::uint32_t>(last);
  }

  // Strips of columns run in parallel. triangle_at(n) is the triangle of placements[n].
  template <typename TriangleAt, typename Height>
  void fill(const std::vector<Placement>& placements, const TriangleAt& triangle_at,
            const Height& height) {
    if (z_.empty()) return;
    const StripLists lists = list_by_strip(placements);
    libmap::parallel_each(lists.begins.size() - 1, [&](std::size_t s) {
      for (std::size_t at = lists.begins[s]; at < lists.begins[s + 1]; ++at) {
        const Placement& one = placements[lists.triangles[at]];
        fill_columns(triangle_at(lists.triangles[at]),
                     std::max<std::size_t>(one.first, s * columns_at_once),
                     std::min<std::size_t>(one.last, (s + 1) * columns_at_once), height);
      }
    });
  }

  std::size_t nodes() const { return z_.size(); }

  template <typename Visit>
  void visit(const Visit& visit_node) const {
    for (std::size_t i = 0; i < xs_.size(); ++i)
      for (std::size_t j = 0; j < ys_.size(); ++j)
        visit_node(xs_[i], ys_[j], z_[i * ys_.size() + j]);
  }

 private:
  // Triangles that may intersect each strip, strip by strip.
  struct StripLists {
    std::vector<std::uint32_t> triangles;
    std::vector<std::size_t> begins;  // first entry of each strip, and the end
  };
  StripLists list_by_strip(const std::vector<Placement>& placements) const {
    StripLists lists;
    lists.begins.assign((xs_.size() - 1) / columns_at_once + 2, 0);
    const auto for_each_entry = [&](const auto& visit) {
      for (std::uint32_t n = 0; n < placements.size(); ++n) {
        const Placement& one = placements[n];
        if (one.refused || one.first == one.last) continue;
        for (std::size_t s = one.first / columns_at_once; s <= (one.last - 1) / columns_at_once;
             ++s)
          visit(s, n);
      }
    };
    for_each_entry([&](std::size_t s, std::uint32_t) { ++lists.begins[s + 1]; });
    for (std::size_t s = 1; s < lists.begins.size(); ++s) lists.begins[s] += lists.begins[s - 1];
    lists.triangles.resize(lists.begins.back());
    std::vector<std::size_t> at = lists.begins;
    for_each_entry([&](std::size_t s, std::uint32_t n) { lists.triangles[at[s]++] = n; });
    return lists;
  }

  template <typename Height>
  void fill_columns(const Triangle& t, std::size_t begin, std::size_t end, const Height& height) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto [bottom, top] = crossing(t, xs_[i]);
      double* const column = z_.data() + i * ys_.size();
      for (std::size_t j = first_node(ys_, bottom, spacing_); j < ys_.size() && ys_[j] <= top; ++j)
        if (covers(t, Point(xs_[i], ys_[j]))) {
          const double z = height(t, xs_[i], ys_[j]);
          if (!(z >= column[j])) column[j] = z;
        }
    }
  }

  Axis xs_;
  Axis ys_;
  double spacing_;
  std::vector<double> z_;
};

void check_options(const InterpolationOptions& options) {
  const auto check = [](const char* field, double value) {
    if (!(value >= 0) || std::isinf(value))
      throw libmap::Error(
          "out of range",
          {.field = field, .value = libmap::to_text(value), .bound = ">= 0 and finite"});
  };
  check("max_edge_m", options.max_edge_m);
  check("grid_spacing_m", options.grid_spacing_m);
  check("max_grid_spacing_m", options.max_grid_spacing_m);
  check("area_cell_m", options.area_cell_m);
}

void fill_triangles(const std::vector<Vector3d>& points, const std::vector<Corners>& triangles,
                    const InterpolationOptions& options, HeightGrid& grid,
                    InterpolationResult& result) {
  const auto triangle_at = [&](std::size_t n) {
    Triangle t;
    for (std::size_t a = 0; a < 3; ++a) {
      const Vector3d& corner = points[triangles[n][a]];
      t.at[a] = Point(corner.x(), corner.y());
      t.z[a] = corner.z();
    }
    return t;
  };
  std::vector<Placement> placements(triangles.size());
  libmap::parallel_each(triangles.size(), triangles_per_chunk, [&](std::size_t n) {
    const Triangle t = triangle_at(n);
    placements[n].refused = options.max_edge_m > 0 && longer_than(t, options.max_edge_m);
    grid.place(placements[n], t);
  });
  result.triangles = triangles.size();
  result.rejected_triangles = static_cast<std::size_t>(std::count_if(
      placements.begin(), placements.end(), [](const Placement& one) { return one.refused; }));
  if (options.method == InterpolationMethod::thesis)
    grid.fill(placements, triangle_at, plane_height);
  else
    grid.fill(placements, triangle_at, barycentric_height);
}

HeightGrid make_grid(const std::vector<Vector3d>& points, const Box& box,
                     const InterpolationOptions& options, InterpolationResult& result) {
  if (options.method == InterpolationMethod::thesis) {
    result.area_m2 = box.area();
    const double spacing = result.grid_spacing_m = thesis_spacing(points.size(), box);
    check_grid(box, spacing, max_nodes(points.size(), options));
    return {repeated_addition(box.min_x, box.max_x, spacing),
            repeated_addition(box.min_y, box.max_y, spacing), spacing};
  }
  result.area_m2 = occupied_area(points, box, options.area_cell_m);
  const double density = static_cast<double>(points.size()) / result.area_m2;
  double spacing = options.grid_spacing_m > 0 ? options.grid_spacing_m
                                              : 1 / std::sqrt(density * 5 / 3);  // eq. 3-5
  if (options.max_grid_spacing_m > 0) spacing = std::min(spacing, options.max_grid_spacing_m);
  result.grid_spacing_m = spacing;
  check_grid(box, spacing, max_nodes(points.size(), options));
  return {lattice(box.min_x, box.max_x, spacing), lattice(box.min_y, box.max_y, spacing), spacing};
}

}  // namespace

InterpolationResult interpolate(const libmap::PointCloud& cloud,
                                const InterpolationOptions& options) {
  check_options(options);
  const std::vector<Vector3d> points = finite_points(cloud, options.method);
  if (points.size() < 3)
    throw libmap::Error(
        "too few finite points for interpolation",
        {.field = "points", .value = std::to_string(points.size()), .bound = ">= 3"});
  const Box box = box_of(points);
  const PlanarTriangulation triangulation = triangulate_in_plane(points);
  if (triangulation.triangles.empty())
    throw libmap::Error("x and y are on a line, so that interpolation is impossible",
                        {.field = "points"});
  InterpolationResult result;
  result.skipped_points = cloud.size() - triangulation.vertices;
  HeightGrid grid = make_grid(points, box, options, result);
  fill_triangles(points, triangulation.triangles, options, grid, result);

  result.cloud.viewpoint = cloud.viewpoint;
  result.cloud.positions.reserve(grid.nodes());
  grid.visit([&](double x, double y, double z) {
    ++result.nodes;
    const bool thesis = options.method == InterpolationMethod::thesis;
    if (std::isnan(z)) {
      ++result.outside_nodes;
    } else if (thesis && z == 0) {
      ++result.zero_nodes;
    } else {
      const Vector3d node(x, y, z);
      result.cloud.positions.push_back(thesis ? libmap::rounded_to_single(node) : node);
    }
  });
  return result;
}

}  // namespace libgtd
