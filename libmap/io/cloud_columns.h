// Conversion between clouds and the named columns (columns.h) that cloud files contain.
//
// Recognized names: x y z, X Y Z; normal_x .., nx .., Normals_0 ..; red green blue, r g b,
// diffuse_red ... Three columns form a triple only if all three exist; all other columns become
// scalar fields. Colors stored as fractions (float, none above 1) are scaled to 0-255.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/io/columns.h"

namespace libmap {

enum class NotFinite { drop, refuse };  // treatment of positions that are not finite

struct CloudFromColumns {
  PointCloud cloud;
  std::size_t dropped_points = 0;  // points with a position that is not finite
};

// Throws Error if x, y or z is missing, two fields have equal names, or a position is not finite
// (with NotFinite::refuse).
CloudFromColumns cloud_from_columns(const ColumnSet& columns, NotFinite not_finite);

// Returns the columns of the positions and, with `with_normals`, of the normals.
std::vector<Column> geometry_columns(const std::vector<Column>& columns, bool with_normals);

// Names of the normals' columns: nx ny nz (PLY, CSV) or normal_x normal_y normal_z (PCD).
enum class NormalNames { short_names, long_names };

// Returns views on `cloud`, which must outlive the views. Positions are declared float32, or
// float64 if float32 would move a coordinate by more than 1e-5 m. Throws Error if a reader would
// take fields for positions, normals or colors because of the names.
ColumnSet columns_of_cloud(const PointCloud& cloud, NormalNames names);

// Appends columns that view the given arrays, which must outlive `set`.
void add_position_columns(const std::vector<Eigen::Vector3d>& positions, ColumnSet& set);
void add_normal_columns(const std::vector<Eigen::Vector3f>& normals, NormalNames names,
                        ColumnSet& set);
void add_color_columns(const std::vector<Color>& colors, ColumnSet& set);
void add_field_columns(const std::vector<ScalarField>& fields, ColumnSet& set);

// Returns the columns as scalar fields. Throws Error if two columns have equal names.
std::vector<ScalarField> fields_of_columns(const ColumnSet& columns);

// Unpacks PCL's packed color 0xAARRGGBB (bytes from `first`) into columns red, green, blue;
// with_packed_color packs these columns, if all three exist, into a column `rgb`.
void add_packed_color_columns(const std::byte* first, std::size_t stride, bool big_endian,
                              ColumnSet& set);
ColumnSet with_packed_color(const ColumnSet& columns);

// True if float32 would move a coordinate by more than 1e-5 m.
bool need_float64(const std::vector<Eigen::Vector3d>& positions);

}  // namespace libmap
