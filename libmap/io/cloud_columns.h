// Which named columns make up a cloud, and the way back.
//
// Read under any of these names: x y z, X Y Z; normal_x .., nx .., Normals_0 ..; red green blue,
// r g b, diffuse_red ... Three columns are a triple only if all three are there; every other column
// becomes a scalar field. Colors stored as fractions (float, none above 1) are scaled to 0-255.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/io/columns.h"

namespace libmap {

enum class NotFinite { drop, refuse };  // what becomes of points whose position is not finite

struct CloudFromColumns {
  PointCloud cloud;
  std::size_t dropped_points = 0;  // those whose position is not finite
};

// Throws Error: no x, y or z; two fields of one name; a position that is not finite, if refused.
CloudFromColumns cloud_from_columns(const ColumnSet& columns, NotFinite not_finite);

// Those of the columns that make the cloud's positions and, where they are wanted, its normals.
std::vector<Column> geometry_columns(const std::vector<Column>& columns, bool with_normals);

// The columns of a format: normals as nx ny nz (PLY, CSV) or normal_x normal_y normal_z (PCD).
enum class NormalNames { short_names, long_names };

// Views on `cloud`, which must outlive them. Positions are declared float32 unless that moves some
// coordinate by more than 1e-5 m, then float64. Throws Error if a field's name would be taken for
// something else when it is read back.
ColumnSet columns_of_cloud(const PointCloud& cloud, NormalNames names);

// Positions (as above), then fields; for arrays of any length.
void add_position_columns(const std::vector<Eigen::Vector3d>& positions, ColumnSet& set);
void add_normal_columns(const std::vector<Eigen::Vector3f>& normals, NormalNames names,
                        ColumnSet& set);
void add_color_columns(const std::vector<Color>& colors, ColumnSet& set);
void add_field_columns(const std::vector<ScalarField>& fields, ColumnSet& set);

// The columns as scalar fields, all rows. Throws Error: two of one name.
std::vector<ScalarField> fields_of_columns(const ColumnSet& columns);

// red, green, blue out of PCL's one number 0xAARRGGBB, whose bytes begin at `first`; and into one
// column `rgb` of such numbers, where the three are there.
void add_packed_color_columns(const std::byte* first, std::size_t stride, bool big_endian,
                              ColumnSet& set);
ColumnSet with_packed_color(const ColumnSet& columns);

// Whether some coordinate is off by more than 1e-5 m as float32.
bool need_float64(const std::vector<Eigen::Vector3d>& positions);

}  // namespace libmap
