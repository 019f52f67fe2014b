// A cloud of points as plain data: positions, and whatever else its source knew of them.
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

// How a scalar field is stored in files; in memory every value is a double.
enum class ScalarType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

// One number per point (or a face), for instance "score" or "curvature". Names are unique.
struct ScalarField {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::vector<double> values;

  bool operator==(const ScalarField&) const = default;
};

// The field of that name, or nullptr.
const ScalarField* find_field(const std::vector<ScalarField>& fields, std::string_view name);
ScalarField* find_field(std::vector<ScalarField>& fields, std::string_view name);

using Color = std::array<std::uint8_t, 3>;  // red, green, blue

// Positions in meters. `normals` and `colors` are either empty or as long as `positions`, and so is
// each field. Normals need not be of unit length: some programs store their confidence in it.
struct PointCloud {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Color> colors;
  std::vector<ScalarField> fields;
  // cloud_from_sensor, as PCD's VIEWPOINT; the identity where it is not known.
  Pose viewpoint = Pose::Identity();

  std::size_t size() const { return positions.size(); }
  bool empty() const { return positions.empty(); }
  bool has_normals() const { return !normals.empty(); }
  bool has_colors() const { return !colors.empty(); }

  // The field of that name, or nullptr.
  const ScalarField* find_field(std::string_view name) const {
    return libmap::find_field(fields, name);
  }
  ScalarField* find_field(std::string_view name) { return libmap::find_field(fields, name); }

  // Adds a field of size() zeros, or empties and retypes the one of that name.
  ScalarField& add_field(std::string_view name, ScalarType type);

  // Throws Error naming the first array whose length is not size().
  void check() const;
};

// The points of `cloud` at `indices`, in that order, with all that belongs to them.
PointCloud select_points(const PointCloud& cloud, const std::vector<std::size_t>& indices);

// The points of `more` behind the others. Normals, colors and fields are left that both have; all
// of one if the other has no points.
void append_cloud(const PointCloud& more, PointCloud& cloud);
// The same of one value per point.
template <typename T>
void append_values(const std::vector<T>& more, std::vector<T>& values) {
  if (more.empty()) values.clear();
  if (!values.empty()) values.insert(values.end(), more.begin(), more.end());
}
// The same of fields alone: those of both names and types.
void append_fields(const std::vector<ScalarField>& more, std::vector<ScalarField>& fields);

// The cloud moved: positions, a known viewpoint and the fields vp_x, vp_y, vp_z by
// `target_from_source`; normals and the fields approach_x, approach_y, approach_z by its rotation.
PointCloud transform_cloud(const PointCloud& cloud, const Pose& target_from_source);

struct Bounds3d {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
};

// The smallest axis-aligned box around the points; zeros for an empty cloud.
Bounds3d bounds_of(const std::vector<Eigen::Vector3d>& positions);

}  // namespace libmap
