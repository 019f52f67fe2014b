#include "libmap/io/cloud_columns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string_view>
#include <utility>

#include "libmap/core/error.h"

namespace libmap {
namespace {

using Triple = std::array<const Column*, 3>;
using Names = std::array<std::string_view, 3>;

constexpr std::array<Names, 2> position_names = {{{"x", "y", "z"}, {"X", "Y", "Z"}}};
constexpr std::array<Names, 3> normal_names = {{{"normal_x", "normal_y", "normal_z"},
                                                {"nx", "ny", "nz"},
                                                {"Normals_0", "Normals_1", "Normals_2"}}};
constexpr std::array<Names, 3> color_names = {
    {{"red", "green", "blue"}, {"r", "g", "b"}, {"diffuse_red", "diffuse_green", "diffuse_blue"}}};

template <std::size_t N>
std::optional<Triple> find_triple(const ColumnSet& set, const std::array<Names, N>& candidates) {
  for (const Names& names : candidates) {
    const Triple triple = {set.find(names[0]), set.find(names[1]), set.find(names[2])};
    if (triple[0] != nullptr && triple[1] != nullptr && triple[2] != nullptr) return triple;
  }
  return std::nullopt;
}

std::vector<std::string> names_of(const ColumnSet& set) {
  std::vector<std::string> names;
  for (const Column& column : set.columns) names.push_back(column.name);
  return names;
}

void require_unique(const std::vector<std::string>& names) {
  std::set<std::string_view> seen;
  for (const std::string& name : names)
    if (!seen.insert(name).second) throw Error("occurs twice", {.field = "field '" + name + "'"});
}

Triple require_positions(const ColumnSet& set) {
  if (const auto triple = find_triple(set, position_names)) return *triple;
  std::string all;
  for (const std::string& name : names_of(set)) all += " " + name.substr(0, 40);
  throw Error(
      "required for points; found:" + (all.empty() ? std::string(" none") : all.substr(0, 400)),
      {.field = "fields x, y and z"});
}

std::vector<Eigen::Vector3d> read_positions(const Triple& triple, std::size_t rows) {
  std::vector<Eigen::Vector3d> positions(rows);
  for (int axis = 0; axis < 3; ++axis)
    for_each_value_in_parallel(
        *triple[static_cast<std::size_t>(axis)], rows,
        [&](std::size_t row, double value) { positions[row][axis] = value; });
  // Text declared as float32 is rounded to float32, unless it has more digits than float32.
  const bool is_float_text = std::any_of(triple.begin(), triple.end(), [](const Column* column) {
    return column->type == ScalarType::float32 && column->stored == StoredType::float64;
  });
  if (is_float_text && !need_float64(positions))
    for (Eigen::Vector3d& position : positions)
      for (double& coordinate : position) coordinate = as_type(coordinate, ScalarType::float32);
  return positions;
}

std::vector<Eigen::Vector3f> read_normals(const Triple& triple, std::size_t rows) {
  std::vector<Eigen::Vector3f> normals(rows);
  for (int axis = 0; axis < 3; ++axis)
    for_each_value_in_parallel(
        *triple[static_cast<std::size_t>(axis)], rows, [&](std::size_t row, double value) {
          normals[row][axis] = static_cast<float>(as_type(value, ScalarType::float32));
        });
  return normals;
}

double color_scale(const Triple& triple, std::size_t rows) {
  if (triple[0]->type == ScalarType::uint16) return 1.0 / 257.0;
  double largest = 0.0;
  for (const Column* column : triple) {
    if (column->type != ScalarType::float32 && column->type != ScalarType::float64) return 1.0;
    for_each_value(*column, rows,
                   [&](std::size_t, double value) { largest = std::max(largest, value); });
  }
  return largest <= 1.0 ? 255.0 : 1.0;
}

std::vector<Color> read_colors(const Triple& triple, std::size_t rows) {
  const double scale = color_scale(triple, rows);
  std::vector<Color> colors(rows);
  for (std::size_t channel = 0; channel < 3; ++channel)
    for_each_value_in_parallel(*triple[channel], rows, [&](std::size_t row, double value) {
      colors[row][channel] = static_cast<std::uint8_t>(as_type(value * scale, ScalarType::uint8));
    });
  return colors;
}

ScalarField read_field(const Column& column, std::size_t rows) {
  ScalarField field{column.name, column.type, std::vector<double>(rows)};
  // Numbers stored in their declared type need no rounding.
  const bool rounds = column.stored != stored_as(column.type);
  for_each_value_in_parallel(column, rows, [&](std::size_t row, double value) {
    field.values[row] = rounds ? as_type(value, column.type) : value;
  });
  return field;
}

bool uses(const std::optional<Triple>& triple, const Column& column) {
  return triple && std::find(triple->begin(), triple->end(), &column) != triple->end();
}

// Removes or rejects points that are not finite.
CloudFromColumns without_holes(PointCloud cloud, NotFinite not_finite) {
  std::vector<std::size_t> kept;
  kept.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.positions[i].allFinite())
      kept.push_back(i);
    else if (not_finite == NotFinite::refuse)
      throw Error("position is not finite", {.field = "vertex " + std::to_string(i)});
  }
  const std::size_t dropped = cloud.size() - kept.size();
  if (dropped == 0) return {std::move(cloud), 0};
  return {select_points(cloud, kept), dropped};
}

template <typename T>
const std::byte* bytes_of(const T* values) {
  return reinterpret_cast<const std::byte*>(values);
}

// Rejects fields that a reader would take for positions, normals or colors.
void require_readable_back(const ColumnSet& set, const std::vector<ScalarField>& fields) {
  ColumnSet alone;
  for (const ScalarField& field : fields) {
    if (field.name.empty()) throw Error("a scalar field has no name");
    alone.columns.push_back({.name = field.name});
  }
  require_unique(names_of(set));
  for (const auto& triple : {find_triple(alone, position_names), find_triple(alone, normal_names),
                             find_triple(alone, color_names)})
    if (triple)
      throw Error(
          "scalar fields with these names would be read back as positions, normals or "
          "colors; rename them",
          {.field = (*triple)[0]->name + " " + (*triple)[1]->name + " " + (*triple)[2]->name});
}

}  // namespace

CloudFromColumns cloud_from_columns(const ColumnSet& set, NotFinite not_finite) {
  const std::optional<Triple> positions = require_positions(set);
  const std::optional<Triple> normals = find_triple(set, normal_names);
  const std::optional<Triple> colors = find_triple(set, color_names);
  require_unique(names_of(set));
  PointCloud cloud;
  cloud.positions = read_positions(*positions, set.rows);
  if (normals) cloud.normals = read_normals(*normals, set.rows);
  if (colors) cloud.colors = read_colors(*colors, set.rows);
  for (const Column& column : set.columns)
    if (!uses(positions, column) && !uses(normals, column) && !uses(colors, column))
      cloud.fields.push_back(read_field(column, set.rows));
  return without_holes(std::move(cloud), not_finite);
}

std::vector<Column> geometry_columns(const std::vector<Column>& columns, bool with_normals) {
  ColumnSet set;
  set.columns = columns;
  const std::optional<Triple> positions = find_triple(set, position_names);
  const std::optional<Triple> normals = find_triple(set, normal_names);
  std::vector<Column> kept;
  for (const Column& column : set.columns)
    if (uses(positions, column) || (with_normals && uses(normals, column))) kept.push_back(column);
  return kept;
}

std::vector<ScalarField> fields_of_columns(const ColumnSet& set) {
  require_unique(names_of(set));
  std::vector<ScalarField> fields;
  for (const Column& column : set.columns) fields.push_back(read_field(column, set.rows));
  return fields;
}

bool need_float64(const std::vector<Eigen::Vector3d>& positions) {
  constexpr double tolerance_m = 1e-5;
  return std::any_of(positions.begin(), positions.end(), [](const Eigen::Vector3d& p) {
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(as_type(p[axis], ScalarType::float32) - p[axis]) > tolerance_m) return true;
    return false;
  });
}

void add_position_columns(const std::vector<Eigen::Vector3d>& positions, ColumnSet& set) {
  const ScalarType type = need_float64(positions) ? ScalarType::float64 : ScalarType::float32;
  const auto* first = reinterpret_cast<const double*>(positions.data());
  for (std::size_t axis = 0; axis < 3; ++axis)
    set.columns.push_back({std::string(position_names[0][axis]), type, StoredType::float64,
                           positions.empty() ? nullptr : bytes_of(first + axis),
                           sizeof(Eigen::Vector3d), false});
}

void add_normal_columns(const std::vector<Eigen::Vector3f>& normals, NormalNames names,
                        ColumnSet& set) {
  if (normals.empty()) return;
  const auto* first = reinterpret_cast<const float*>(normals.data());
  for (std::size_t axis = 0; axis < 3; ++axis)
    set.columns.push_back(
        {std::string(normal_names[names == NormalNames::short_names ? 1 : 0][axis]),
         ScalarType::float32, StoredType::float32, bytes_of(first + axis), sizeof(Eigen::Vector3f),
         false});
}

void add_color_columns(const std::vector<Color>& colors, ColumnSet& set) {
  if (colors.empty()) return;
  for (std::size_t channel = 0; channel < 3; ++channel)
    set.columns.push_back({std::string(color_names[0][channel]), ScalarType::uint8,
                           StoredType::uint8, bytes_of(colors.front().data() + channel),
                           sizeof(Color), false});
}

void add_field_columns(const std::vector<ScalarField>& fields, ColumnSet& set) {
  for (const ScalarField& field : fields)
    set.columns.push_back({field.name, field.type, StoredType::float64,
                           bytes_of(field.values.data()), sizeof(double), false});
  require_readable_back(set, fields);
}

void add_packed_color_columns(const std::byte* first, std::size_t stride, bool big_endian,
                              ColumnSet& set) {
  for (std::size_t channel = 0; channel < 3; ++channel)
    set.columns.push_back({std::string(color_names[0][channel]), ScalarType::uint8,
                           StoredType::uint8, first + (big_endian ? channel + 1 : 2 - channel),
                           stride, false});
}

ColumnSet with_packed_color(const ColumnSet& columns) {
  ColumnSet set;
  set.rows = columns.rows;
  const Column* const channels[] = {columns.find("red"), columns.find("green"),
                                    columns.find("blue")};
  const bool colored = channels[0] != nullptr && channels[1] != nullptr && channels[2] != nullptr;
  for (const Column& column : columns.columns) {
    if (!colored || (&column != channels[0] && &column != channels[1] && &column != channels[2])) {
      set.columns.push_back(column);
    } else if (&column == channels[0]) {
      auto packed = std::make_shared<std::vector<std::uint32_t>>(set.rows, 0xFF000000U);
      for (std::size_t c = 0; c < 3; ++c)
        for_each_value(*channels[c], set.rows, [&](std::size_t row, double value) {
          (*packed)[row] |= static_cast<std::uint32_t>(value) << (16 - 8 * c);
        });
      set.columns.push_back({"rgb", ScalarType::uint32, StoredType::uint32,
                             reinterpret_cast<const std::byte*>(packed->data()), 4, false});
      set.storage.push_back(packed);
    }
  }
  return set;
}

ColumnSet columns_of_cloud(const PointCloud& cloud, NormalNames names) {
  cloud.check();
  ColumnSet set;
  set.rows = cloud.size();
  add_position_columns(cloud.positions, set);
  add_normal_columns(cloud.normals, names, set);
  add_color_columns(cloud.colors, set);
  add_field_columns(cloud.fields, set);
  return set;
}

}  // namespace libmap
