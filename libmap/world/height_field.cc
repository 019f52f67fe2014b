#include "libmap/world/height_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

namespace {

constexpr double max_nodes = 1 << 26;
constexpr float missing = std::numeric_limits<float>::infinity();
// Depth of the nodes below the surface, and tolerance of barycentric coordinates.
constexpr float sink_m = 0.05F;
constexpr double edge_tolerance = 1e-9;

using Corners = std::array<Eigen::Vector3d, 3>;

Corners corners_of(const TriangleMesh& mesh, const Triangle& t) {
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// A convex polygon in space of few corners.
struct Polygon {
  std::array<Eigen::Vector3d, 9> points;
  std::size_t size = 0;
};

// The part of the polygon on the left of the line from a to b, in plan (Sutherland and Hodgman
// 1974).
Polygon clip(const Polygon& polygon, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  Polygon result;
  const Eigen::Vector2d along = b - a;
  const auto side = [&](const Eigen::Vector3d& p) { return cross(along, p.head<2>() - a); };
  for (std::size_t n = 0; n < polygon.size; ++n) {
    const Eigen::Vector3d& p = polygon.points[n];
    const Eigen::Vector3d& q = polygon.points[(n + 1) % polygon.size];
    const double at_p = side(p);
    const double at_q = side(q);
    if (at_p >= 0) result.points[result.size++] = p;
    if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0))
      result.points[result.size++] = p + (q - p) * (at_p / (at_p - at_q));
  }
  return result;
}

template <std::size_t N>
Polygon clip_to(const Corners& triangle, const std::array<Eigen::Vector3d, N>& outline) {
  Polygon result{{triangle[0], triangle[1], triangle[2]}, 3};
  for (std::size_t n = 0; n < N && result.size > 0; ++n)
    result = clip(result, outline[n].template head<2>(), outline[(n + 1) % N].template head<2>());
  return result;
}

HeightField make_grid(const TriangleMesh& mesh, double cell_size_m) {
  const Bounds3d bounds = bounds_of(mesh.vertices);
  HeightField field;
  field.cell_size_m = cell_size_m;
  const Eigen::Array2d low = (bounds.min.head<2>() / cell_size_m).array().floor() - 1;
  const Eigen::Array2d high = (bounds.max.head<2>() / cell_size_m).array().ceil() + 1;
  const Eigen::Array2d nodes = high - low + 1;
  if (!(nodes.prod() <= max_nodes))
    throw Error("too small: the height field would have more than 2^26 nodes",
                {.field = "cell_size_m", .value = to_text(cell_size_m)});
  field.corner_m = low * cell_size_m;
  field.base_m = bounds.min.z();
  field.columns = static_cast<std::size_t>(nodes.x());
  field.rows = static_cast<std::size_t>(nodes.y());
  field.heights_m.assign(field.columns * field.rows, missing);
  return field;
}

Eigen::Vector3d node(const HeightField& field, std::size_t column, std::size_t row) {
  return {field.corner_m.x() + static_cast<double>(column) * field.cell_size_m,
          field.corner_m.y() + static_cast<double>(row) * field.cell_size_m,
          field.base_m + static_cast<double>(field.heights_m[row * field.columns + column])};
}

// The nodes in the triangle take its height if it is lower.
void lower_nodes(const Corners& corners, HeightField& field) {
  const Eigen::Vector2d a = corners[0].head<2>();
  const Eigen::Vector2d ab = corners[1].head<2>() - a;
  const Eigen::Vector2d ac = corners[2].head<2>() - a;
  const double area = cross(ab, ac);
  if (!(area > 0)) return;
  const auto [first_column, last_column, first_row, last_row] = field.cells_of(corners);
  for (std::size_t row = first_row; row <= last_row + 1; ++row)
    for (std::size_t column = first_column; column <= last_column + 1; ++column) {
      const Eigen::Vector2d at = node(field, column, row).head<2>() - a;
      const double u = cross(at, ac) / area;
      const double v = cross(ab, at) / area;
      if (std::min({u, v, 1 - u - v}) < -edge_tolerance) continue;
      const double height = (1 - u - v) * corners[0].z() + u * corners[1].z() + v * corners[2].z();
      float& lowest = field.heights_m[row * field.columns + column];
      lowest = std::min(lowest, static_cast<float>(height - field.base_m));
    }
}

// Missing nodes beside others continue their slopes, so that cells on the border are whole.
void extend_border(HeightField& field) {
  const std::vector<float> heights = field.heights_m;
  const auto columns = static_cast<std::ptrdiff_t>(field.columns);
  const auto rows = static_cast<std::ptrdiff_t>(field.rows);
  const auto at = [&](std::ptrdiff_t column, std::ptrdiff_t row) {
    const bool inside = column >= 0 && row >= 0 && column < columns && row < rows;
    return inside ? heights[static_cast<std::size_t>(row * columns + column)] : missing;
  };
  for (std::ptrdiff_t row = 0; row < rows; ++row)
    for (std::ptrdiff_t column = 0; column < columns; ++column) {
      if (at(column, row) != missing) continue;
      // Sums and counts of continued slopes, and of heights alone.
      std::array<float, 2> sums{};
      std::array<float, 2> counts{};
      for (std::ptrdiff_t y = -1; y <= 1; ++y)
        for (std::ptrdiff_t x = -1; x <= 1; ++x) {
          const float near = at(column + x, row + y);
          const float far = at(column + 2 * x, row + 2 * y);
          if (near == missing) continue;
          const std::size_t kind = far == missing ? 1 : 0;
          sums[kind] += kind == 1 ? near : 2 * near - far;
          counts[kind] += 1.0F;
        }
      const std::size_t kind = counts[0] > 0 ? 0 : 1;
      if (counts[kind] > 0)
        field.heights_m[static_cast<std::size_t>(row * columns + column)] =
            sums[kind] / counts[kind];
    }
}

// The largest distance between two pieces that have the same outline in plan: planes over a convex
// polygon are farthest apart at its corners.
double deviation_of(const Polygon& polygon, const Corners& surface, const Corners& cell,
                    double enough) {
  const Eigen::Vector3d normal = (cell[1] - cell[0]).cross(cell[2] - cell[0]);
  double largest = 0.0;
  for (std::size_t n = 0; n < polygon.size; ++n) {
    const Eigen::Vector3d& on_surface = polygon.points[n];
    const double above = normal.dot(on_surface - cell[0]) / normal.z();
    if (std::abs(above) <= enough) continue;
    const Eigen::Vector3d on_cell = on_surface - above * Eigen::Vector3d::UnitZ();
    const auto distance = [](const Eigen::Vector3d& from, const Corners& to) {
      return (nearest_on_triangle(from, to[0], to[1], to[2]) - from).norm();
    };
    largest = std::max({largest, distance(on_cell, surface), distance(on_surface, cell)});
  }
  return largest;
}

// Deviation of each cell: 0 without surface, infinite where it faces down or nodes are missing.
std::vector<float> deviations(const TriangleMesh& mesh, const HeightField& field) {
  std::vector<float> result((field.columns - 1) * (field.rows - 1), 0.0F);
  for (const Triangle& t : mesh.triangles) {
    const Corners corners = corners_of(mesh, t);
    const bool faces_down = !(area_normal(mesh, t).z() > 0);
    const auto [first_column, last_column, first_row, last_row] = field.cells_of(corners);
    for (std::size_t row = first_row; row <= last_row; ++row)
      for (std::size_t column = first_column; column <= last_column; ++column) {
        float& largest = result[row * (field.columns - 1) + column];
        const Eigen::Vector3d low = node(field, column, row);
        const Eigen::Vector3d high = node(field, column + 1, row + 1);
        for (const Eigen::Vector3d& third :
             {node(field, column + 1, row), node(field, column, row + 1)}) {
          const bool right = third.y() == low.y();
          const Corners cell = right ? Corners{low, third, high} : Corners{low, high, third};
          const Polygon polygon = clip_to(corners, cell);
          if (polygon.size == 0) continue;
          if (faces_down || !std::isfinite(low.z() + third.z() + high.z()))
            largest = missing;
          else
            largest = std::max(largest, static_cast<float>(deviation_of(
                                            polygon, corners, cell, static_cast<double>(largest))));
        }
      }
  }
  return result;
}

// Cells with too large a deviation and those around them, so that the nodes between a cell and one
// that is skipped are on the surface.
void mark_missing(const std::vector<float>& deviation, double max_deviation_m, HeightField& field) {
  const std::size_t columns = field.columns - 1;
  const std::size_t rows = field.rows - 1;
  field.is_missing.assign(deviation.size(), false);
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t column = 0; column < columns; ++column) {
      if (static_cast<double>(deviation[row * columns + column]) <= max_deviation_m) continue;
      for (std::size_t y = std::max<std::size_t>(row, 1) - 1; y <= std::min(row + 1, rows - 1); ++y)
        for (std::size_t x = std::max<std::size_t>(column, 1) - 1;
             x <= std::min(column + 1, columns - 1); ++x)
          field.is_missing[y * columns + x] = true;
    }
  for (std::size_t cell = 0; cell < deviation.size(); ++cell)
    if (!field.is_missing[cell])
      field.deviation_m = std::max(field.deviation_m, static_cast<double>(deviation[cell]));
  field.missing_cells =
      static_cast<std::size_t>(std::count(field.is_missing.begin(), field.is_missing.end(), true));
}

// Nodes that no remaining cell has are put below the surface.
void sink_nodes(HeightField& field) {
  std::vector<bool> needed(field.heights_m.size(), false);
  for (std::size_t row = 0; row + 1 < field.rows; ++row)
    for (std::size_t column = 0; column + 1 < field.columns; ++column) {
      if (field.is_missing[row * (field.columns - 1) + column]) continue;
      const std::size_t first = row * field.columns + column;
      const std::array<std::size_t, 4> nodes = {first, first + 1, first + field.columns,
                                                first + field.columns + 1};
      if (std::any_of(nodes.begin(), nodes.end(),
                      [&](std::size_t n) { return field.heights_m[n] == missing; }))
        continue;
      for (const std::size_t n : nodes) needed[n] = true;
    }
  const float low = field.min_m() - sink_m;
  for (std::size_t n = 0; n < needed.size(); ++n)
    if (!needed[n]) field.heights_m[n] = low;
}

}  // namespace

float HeightField::min_m() const { return *std::min_element(heights_m.begin(), heights_m.end()); }

float HeightField::max_m() const { return *std::max_element(heights_m.begin(), heights_m.end()); }

std::array<std::size_t, 4> HeightField::cells_of(
    const std::array<Eigen::Vector3d, 3>& corners) const {
  const Eigen::Vector3d low = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
  const Eigen::Vector3d high = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
  const auto cell = [&](double x, double corner, std::size_t nodes) {
    const double whole_cells = std::floor((x - corner) / cell_size_m);
    return static_cast<std::size_t>(std::clamp(whole_cells, 0.0, static_cast<double>(nodes - 2)));
  };
  return {cell(low.x(), corner_m.x(), columns), cell(high.x(), corner_m.x(), columns),
          cell(low.y(), corner_m.y(), rows), cell(high.y(), corner_m.y(), rows)};
}

HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options) {
  HeightField field = make_grid(mesh, options.cell_size_m);
  for (const Triangle& t : mesh.triangles) lower_nodes(corners_of(mesh, t), field);
  if (field.min_m() == missing)
    throw Error("no triangle of the mesh faces up, so there is no height field");
  extend_border(field);
  mark_missing(deviations(mesh, field), options.max_deviation_m, field);
  sink_nodes(field);
  return field;
}

bool is_above_missing(const HeightField& field, const TriangleMesh& mesh,
                      const Triangle& triangle) {
  const Corners corners = corners_of(mesh, triangle);
  const auto [first_column, last_column, first_row, last_row] = field.cells_of(corners);
  for (std::size_t row = first_row; row <= last_row; ++row)
    for (std::size_t column = first_column; column <= last_column; ++column) {
      if (!field.is_missing[row * (field.columns - 1) + column]) continue;
      const std::array<Eigen::Vector3d, 4> cell = {
          node(field, column, row), node(field, column + 1, row), node(field, column + 1, row + 1),
          node(field, column, row + 1)};
      if (clip_to(corners, cell).size > 0) return true;
    }
  return false;
}

}  // namespace libmap
