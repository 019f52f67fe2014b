// Conversion between clouds and the named columns (columns.h) that cloud files contain.
//
// Recognized names: positions x y z, X Y Z; normals normal_x .., nx .., Normals_0 ..; colors red
// green blue, r g b, diffuse_red ... Each needs all three columns; all other columns become scalar
// fields. Colors are scaled to 0-255 from 0-1 (floats, none above 1) or 0-65535 (uint16).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/io/columns.h"

namespace libmap {

enum class NotFinite { drop, refuse };  // points that are not finite: omit them, or throw Error

struct CloudFromColumns {
  PointCloud cloud;
  std::size_t dropped_points = 0;  // points with a position that is not finite
};

// Returns the columns as a cloud. Throws Error if x, y or z is missing, two columns have equal
// names, or, with NotFinite::refuse, a position is not finite.
CloudFromColumns cloud_from_columns(const ColumnSet& columns, NotFinite not_finite);

// Returns the columns of the positions and, with `with_normals`, of the normals.
std::vector<Column> geometry_columns(const std::vector<Column>& columns, bool with_normals);

// Names of the normals' columns: nx ny nz (PLY, CSV) or normal_x normal_y normal_z (PCD).
enum class NormalNames { short_names, long_names };

// Returns columns that refer to `cloud`, which must outlive them. Column::type of positions is
// float32, or float64 if float32 would move a coordinate by more than 1e-5 m. Throws Error if a
// field has no name, the name of another column, or if three fields have names recognized as above.
ColumnSet columns_of_cloud(const PointCloud& cloud, NormalNames names);

// Append columns as columns_of_cloud does. The arrays must outlive `set`.
void add_position_columns(const std::vector<Eigen::Vector3d>& positions, ColumnSet& set);
void add_normal_columns(const std::vector<Eigen::Vector3f>& normals, NormalNames names,
                        ColumnSet& set);
void add_color_columns(const std::vector<Color>& colors, ColumnSet& set);
void add_field_columns(const std::vector<ScalarField>& fields, ColumnSet& set);

// Returns all columns as scalar fields. Throws Error if two columns have equal names.
std::vector<ScalarField> fields_of_columns(const ColumnSet& columns);

// Adds columns red, green, blue of packed PCL colors (0xAARRGGBB) at `first`, `stride` bytes apart.
void add_packed_color_columns(const std::byte* first, std::size_t stride, bool big_endian,
                              ColumnSet& set);
// Returns the columns; red, green and blue, if all three exist, are packed into a column `rgb`.
ColumnSet with_packed_color(const ColumnSet& columns);

// True if float32 would move a coordinate by more than 1e-5 m.
bool need_float64(const std::vector<Eigen::Vector3d>& positions);

}  // namespace libmap
