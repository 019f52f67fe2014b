// Point cloud as plain data: positions with optional normals, colors and scalar fields.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose.h"

namespace libmap {

// Type of a scalar field in files; in memory, all values are doubles.
enum class ScalarType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

// One number per point, vertex or face, e.g. "score". Names are unique in a list of fields.
struct ScalarField {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::vector<double> values;

  bool operator==(const ScalarField&) const = default;
};

// Returns the field called `name`, or nullptr.
const ScalarField* find_field(const std::vector<ScalarField>& fields, std::string_view name);
ScalarField* find_field(std::vector<ScalarField>& fields, std::string_view name);

using Color = std::array<std::uint8_t, 3>;  // red, green, blue

// Positions in meters. `normals` and `colors` are empty or have one element per point; each field
// has one value per point. Normals can have any length: some programs store a confidence in it.
struct PointCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Color> colors;
  std::vector<ScalarField> fields;
  // cloud_from_sensor, as PCD's VIEWPOINT; the identity if it is not known.
  Pose viewpoint = Pose::Identity();

  std::size_t size() const { return positions.size(); }
  bool empty() const { return positions.empty(); }
  bool has_normals() const { return !normals.empty(); }
  bool has_colors() const { return !colors.empty(); }

  const ScalarField* find_field(std::string_view name) const {
    return libmap::find_field(fields, name);
  }
  ScalarField* find_field(std::string_view name) { return libmap::find_field(fields, name); }

  // Adds a field of size() zeros, or resets the existing field of that name to zeros of `type`.
  ScalarField& add_field(std::string_view name, ScalarType type);

  // Throws Error naming the first array with a length other than size().
  void check() const;
};

// Returns the points of `cloud` at `indices`, in that order, with normals, colors and fields.
PointCloud select_points(const PointCloud& cloud, const std::vector<std::size_t>& indices);

// Appends the points of `more`. Keeps normals, colors and fields that both clouds have; keeps
// everything if one cloud is empty. The viewpoint is the identity if the viewpoints differ.
void append_cloud(const PointCloud& more, PointCloud& cloud);
// Appends the values of further points; the result is empty if either vector is empty.
template <typename T>
void append_values(const std::vector<T>& more, std::vector<T>& values) {
  if (more.empty()) values.clear();
  if (!values.empty()) values.insert(values.end(), more.begin(), more.end());
}
// Appends the values of fields; keeps only fields that both lists have, of equal name and type.
void append_fields(const std::vector<ScalarField>& more, std::vector<ScalarField>& fields);

// Returns the cloud in the target frame. Transforms positions, a known viewpoint and points in the
// fields vp_x, vp_y, vp_z; only rotates normals and vectors in the fields approach_x, _y, _z.
PointCloud transform_cloud(const PointCloud& cloud, const Pose& target_from_source);

struct Bounds3d {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();  // corners of an axis-aligned box, m
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

// Returns the axis-aligned bounding box of the points; zeros if there are none.
Bounds3d bounds_of(const std::vector<Eigen::Vector3d>& positions);

}  // namespace libmap
