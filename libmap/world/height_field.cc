#include "libmap/world/height_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

namespace {

constexpr double max_nodes = 1 << 26;
constexpr float missing = std::numeric_limits<float>::infinity();
// Depth of height 0 below the surface, and tolerance of barycentric coordinates.
constexpr double sink_m = 0.05;
constexpr double edge_tolerance = 1e-9;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

Eigen::Vector3d node(const HeightField& field, std::size_t column, std::size_t row) {
  return {field.corner_m.x() + static_cast<double>(column) * field.cell_size_m,
          field.corner_m.y() + static_cast<double>(row) * field.cell_size_m,
          field.base_m + static_cast<double>(field.heights_m[row * field.columns + column])};
}

HeightField make_grid(const TriangleMesh& mesh, double cell_size_m) {
  const Bounds3d bounds = bounds_of(mesh.vertices);
  HeightField field;
  field.cell_size_m = cell_size_m;
  const Eigen::Array2d low = (bounds.min.head<2>() / cell_size_m).array().floor() - 1;
  const Eigen::Array2d high = (bounds.max.head<2>() / cell_size_m).array().ceil() + 1;
  const Eigen::Array2d nodes = high - low + 1;
  if (!(nodes.prod() <= max_nodes))
    throw Error("the height field has more than 2^26 nodes; use larger cells",
                {.field = "cell_size_m", .value = to_text(cell_size_m)});
  field.corner_m = low * cell_size_m;
  field.base_m = bounds.min.z() - sink_m;
  field.columns = static_cast<std::size_t>(nodes.x());
  field.rows = static_cast<std::size_t>(nodes.y());
  field.heights_m.assign(field.columns * field.rows, missing);
  return field;
}

// Calls visit(column, row) for the cells that the bounding box of a triangle touches in plan; with
// more = 1, for the nodes of these cells.
template <typename Visit>
void for_box(const HeightField& field, const TriangleCorners& corners, std::size_t more,
             const Visit& visit) {
  const auto range = [&](int axis, std::size_t nodes) {
    const auto [low, high] = std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
    const auto cell = [&](double x) {
      const double whole = std::floor((x - field.corner_m[axis]) / field.cell_size_m);
      return static_cast<std::size_t>(std::clamp(whole, 0.0, static_cast<double>(nodes - 2)));
    };
    return std::pair(cell(low), cell(high) + more);
  };
  const auto [first_column, last_column] = range(0, field.columns);
  const auto [first_row, last_row] = range(1, field.rows);
  for (std::size_t row = first_row; row <= last_row; ++row)
    for (std::size_t column = first_column; column <= last_column; ++column) visit(column, row);
}

// Calls visit(column, row, height) for the nodes in a triangle that faces up.
template <typename Visit>
void for_nodes(const HeightField& field, const TriangleCorners& corners, const Visit& visit) {
  const Eigen::Vector2d a = corners[0].head<2>();
  const Eigen::Vector2d ab = corners[1].head<2>() - a;
  const Eigen::Vector2d ac = corners[2].head<2>() - a;
  const double area = cross(ab, ac);
  if (!(area > 0)) return;
  for_box(field, corners, 1, [&](std::size_t column, std::size_t row) {
    const Eigen::Vector2d at = node(field, column, row).head<2>() - a;
    const double u = cross(at, ac) / area;
    const double v = cross(ab, at) / area;
    if (std::min({u, v, 1 - u - v}) < -edge_tolerance) return;
    const double z = (1 - u - v) * corners[0].z() + u * corners[1].z() + v * corners[2].z();
    visit(column, row, static_cast<float>(z - field.base_m));
  });
}

// Extrapolates heights to missing nodes next to others, so that cells on the border are complete.
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
      float sum = 0.0F;
      float count = 0.0F;
      for (std::ptrdiff_t k = 0; k < 9; ++k) {
        const float near = at(column + k % 3 - 1, row + k / 3 - 1);
        const float far = at(column + 2 * (k % 3 - 1), row + 2 * (k / 3 - 1));
        if (near == missing || far == missing) continue;
        sum += 2 * near - far;
        count += 1.0F;
      }
      if (count > 0)
        field.heights_m[static_cast<std::size_t>(row * columns + column)] = sum / count;
    }
}

// Finds where a segment crosses borders and diagonals of cells, as fractions 0 to 1 with both ends.
void find_crossings(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                    std::vector<double>& crossings) {
  crossings = {0.0, 1.0};
  const Eigen::Vector3d begin(from.x(), from.y(), from.x() - from.y());
  const Eigen::Vector3d end(to.x(), to.y(), to.x() - to.y());
  for (int k = 0; k < 3; ++k)
    for (double line = std::floor(std::min(begin[k], end[k])) + 1;
         line < std::max(begin[k], end[k]); ++line)
      crossings.push_back((line - begin[k]) / (end[k] - begin[k]));
  std::sort(crossings.begin(), crossings.end());
}

// Distances between surface and field, by cell: 0 or above where there is surface, infinite where
// it faces down or nodes are missing.
class CellDeviations {
 public:
  explicit CellDeviations(const HeightField& field)
      : field_(field), of_cell_((field.columns - 1) * (field.rows - 1), -1.0F) {}

  // Two planes over a convex polygon in plan are farthest apart at its corners. These are nodes in
  // the triangle, and positions on its edges where cells begin.
  void add(const TriangleCorners& surface) {
    if (!((surface[1] - surface[0]).cross(surface[2] - surface[0]).z() > 0)) {
      for_box(field_, surface, 0,
              [&](std::size_t column, std::size_t row) { raise(column, row, missing); });
      return;
    }
    for_nodes(field_, surface, [&](std::size_t column, std::size_t row, float height) {
      const float deviation = height - field_.heights_m[row * field_.columns + column];
      for (std::size_t k = 0; k < 4; ++k) raise(column - k % 2, row - k / 2, std::abs(deviation));
    });
    for (std::size_t k = 0; k < 3; ++k) add_edge(surface, surface[k], surface[(k + 1) % 3]);
  }

  const std::vector<float>& of_cell() const { return of_cell_; }

 private:
  void raise(std::size_t column, std::size_t row, float deviation) {
    float& largest = of_cell_[row * (field_.columns - 1) + column];
    largest = std::max(largest, deviation);
  }

  void add_edge(const TriangleCorners& surface, const Eigen::Vector3d& from,
                const Eigen::Vector3d& to) {
    const auto in_cells = [&](const Eigen::Vector3d& point) -> Eigen::Vector2d {
      return (point.head<2>() - field_.corner_m) / field_.cell_size_m;
    };
    find_crossings(in_cells(from), in_cells(to), crossings_);
    for (std::size_t n = 0; n + 1 < crossings_.size(); ++n) {
      const double middle = (crossings_[n] + crossings_[n + 1]) / 2;
      const Eigen::Vector2d at = in_cells(from + middle * (to - from));
      const auto column = static_cast<std::size_t>(at.x());
      const auto row = static_cast<std::size_t>(at.y());
      const Eigen::Vector3d low = node(field_, column, row);
      const Eigen::Vector3d high = node(field_, column + 1, row + 1);
      const bool right = at.x() - std::floor(at.x()) > at.y() - std::floor(at.y());
      const Eigen::Vector3d third =
          right ? node(field_, column + 1, row) : node(field_, column, row + 1);
      const TriangleCorners cell =
          right ? TriangleCorners{low, third, high} : TriangleCorners{low, high, third};
      const bool whole = std::isfinite(low.z() + third.z() + high.z());
      for (const double t : {crossings_[n], crossings_[n + 1]})
        raise(column, row, whole ? distance(from + t * (to - from), surface, cell) : missing);
    }
  }

  // Distance of a point of the surface from the triangle of a cell, and of the point above or below
  // it from the surface's triangle.
  static float distance(const Eigen::Vector3d& on_surface, const TriangleCorners& surface,
                        const TriangleCorners& cell) {
    const Eigen::Vector3d normal = (cell[1] - cell[0]).cross(cell[2] - cell[0]);
    const double above = normal.dot(on_surface - cell[0]) / normal.z();
    const Eigen::Vector3d on_cell = on_surface - above * Eigen::Vector3d::UnitZ();
    const auto to = [](const Eigen::Vector3d& point, const TriangleCorners& t) {
      return (nearest_on_triangle(point, t[0], t[1], t[2]) - point).norm();
    };
    return static_cast<float>(std::max(to(on_cell, surface), to(on_surface, cell)));
  }

  const HeightField& field_;
  std::vector<float> of_cell_;
  std::vector<double> crossings_;
};

// Removes the nodes of cells with too large a deviation. A cell without one of its nodes is left
// out, so that the field descends within cells that are left out.
void mark_missing(const std::vector<float>& deviations, double max_deviation_m,
                  HeightField& field) {
  const std::size_t columns = field.columns;
  const auto nodes_of = [&](std::size_t cell) {
    const std::size_t first = cell / (columns - 1) * columns + cell % (columns - 1);
    return std::array{first, first + 1, first + columns, first + columns + 1};
  };
  for (std::size_t cell = 0; cell < deviations.size(); ++cell)
    if (static_cast<double>(deviations[cell]) > max_deviation_m)
      for (const std::size_t n : nodes_of(cell)) field.heights_m[n] = missing;
  field.is_missing.assign(deviations.size(), false);
  for (std::size_t cell = 0; cell < deviations.size(); ++cell) {
    if (deviations[cell] < 0) continue;
    const auto nodes = nodes_of(cell);
    field.is_missing[cell] = std::any_of(
        nodes.begin(), nodes.end(), [&](std::size_t n) { return field.heights_m[n] == missing; });
    if (!field.is_missing[cell])
      field.deviation_m = std::max(field.deviation_m, static_cast<double>(deviations[cell]));
  }
  std::replace(field.heights_m.begin(), field.heights_m.end(), missing, 0.0F);
  // Simulators subtract the smallest height.
  const float low = *std::min_element(field.heights_m.begin(), field.heights_m.end());
  for (float& height : field.heights_m) height -= low;
  field.base_m += static_cast<double>(low);
}

}  // namespace

HeightField make_height_field(const TriangleMesh& mesh, const HeightFieldOptions& options) {
  HeightField field = make_grid(mesh, options.cell_size_m);
  bool faces_up = false;
  for (const Triangle& t : mesh.triangles)
    for_nodes(field, corners_of(mesh, t), [&](std::size_t column, std::size_t row, float height) {
      float& lowest = field.heights_m[row * field.columns + column];
      lowest = std::min(lowest, height);
      faces_up = true;
    });
  if (!faces_up) throw Error("none faces up", {.field = "triangles of the mesh"});
  extend_border(field);
  CellDeviations deviations(field);
  for (const Triangle& t : mesh.triangles) deviations.add(corners_of(mesh, t));
  mark_missing(deviations.of_cell(), options.max_deviation_m, field);
  return field;
}

bool may_be_left_out(const HeightField& field, const TriangleMesh& mesh, const Triangle& triangle) {
  bool found = false;
  for_box(field, corners_of(mesh, triangle), 0, [&](std::size_t column, std::size_t row) {
    found = found || field.is_missing[row * (field.columns - 1) + column];
  });
  return found;
}

}  // namespace libmap
