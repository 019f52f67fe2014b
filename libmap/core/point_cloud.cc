#include "libmap/core/point_cloud.h"

#include <algorithm>
#include <utility>

#include "libmap/core/error.h"

namespace libmap {

const ScalarField* find_field(const std::vector<ScalarField>& fields, std::string_view name) {
  const auto found = std::find_if(fields.begin(), fields.end(),
                                  [&](const ScalarField& field) { return field.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

ScalarField* find_field(std::vector<ScalarField>& fields, std::string_view name) {
  return const_cast<ScalarField*>(find_field(std::as_const(fields), name));
}

ScalarField& PointCloud::add_field(std::string_view name, ScalarType type) {
  ScalarField* field = find_field(name);
  if (field == nullptr) field = &fields.emplace_back();
  field->name = name;
  field->type = type;
  field->values.assign(size(), 0.0);
  return *field;
}

void PointCloud::check() const {
  const auto require = [&](const std::string& what, std::size_t length, bool may_be_empty) {
    if (length == size() || (may_be_empty && length == 0)) return;
    throw Error("not one value for each of the cloud's " + std::to_string(size()) + " points",
                {.field = what, .value = std::to_string(length) + " values long"});
  };
  require("normals", normals.size(), true);
  require("colors", colors.size(), true);
  for (const ScalarField& field : fields) require(field.name, field.values.size(), false);
}

PointCloud select_points(const PointCloud& cloud, const std::vector<std::size_t>& indices) {
  const auto select = [&](const auto& from, auto& to) {
    to.reserve(indices.size());
    for (const std::size_t index : indices) to.push_back(from[index]);
  };
  PointCloud selected;
  selected.viewpoint = cloud.viewpoint;
  select(cloud.positions, selected.positions);
  if (cloud.has_normals()) select(cloud.normals, selected.normals);
  if (cloud.has_colors()) select(cloud.colors, selected.colors);
  for (const ScalarField& field : cloud.fields) {
    ScalarField& target = selected.fields.emplace_back();
    target.name = field.name;
    target.type = field.type;
    select(field.values, target.values);
  }
  return selected;
}

namespace {

// Applies `change` to the vectors in the fields NAME_x, NAME_y, NAME_z, if all three exist.
template <typename Change>
void change_vectors(PointCloud& cloud, const std::string& name, const Change& change) {
  ScalarField* x = cloud.find_field(name + "_x");
  ScalarField* y = cloud.find_field(name + "_y");
  ScalarField* z = cloud.find_field(name + "_z");
  if (x == nullptr || y == nullptr || z == nullptr) return;
  for (std::size_t n = 0; n < x->values.size(); ++n) {
    const Eigen::Vector3d changed =
        change(Eigen::Vector3d(x->values[n], y->values[n], z->values[n]));
    x->values[n] = changed.x();
    y->values[n] = changed.y();
    z->values[n] = changed.z();
  }
}

}  // namespace

void append_fields(const std::vector<ScalarField>& more, std::vector<ScalarField>& fields) {
  const auto like = [&](const ScalarField& field) {
    return std::find_if(more.begin(), more.end(), [&](const ScalarField& other) {
      return other.name == field.name && other.type == field.type;
    });
  };
  std::erase_if(fields, [&](const ScalarField& field) { return like(field) == more.end(); });
  for (ScalarField& field : fields) {
    const std::vector<double>& values = like(field)->values;
    field.values.insert(field.values.end(), values.begin(), values.end());
  }
}

void append_cloud(const PointCloud& more, PointCloud& cloud) {
  if (more.empty()) return;
  if (cloud.empty()) {
    cloud = more;
    return;
  }
  append_values(more.positions, cloud.positions);
  append_values(more.normals, cloud.normals);
  append_values(more.colors, cloud.colors);
  append_fields(more.fields, cloud.fields);
  if (more.viewpoint.matrix() != cloud.viewpoint.matrix()) cloud.viewpoint = Pose::Identity();
}

PointCloud transform_cloud(const PointCloud& cloud, const Pose& target_from_source) {
  PointCloud moved = cloud;
  for (Eigen::Vector3d& point : moved.positions) point = target_from_source * point;
  const Eigen::Matrix3f rotation = target_from_source.linear().cast<float>();
  for (Eigen::Vector3f& normal : moved.normals) normal = rotation * normal;
  // The identity means an unknown viewpoint, which a transform does not change.
  if (!cloud.viewpoint.matrix().isIdentity(0.0))
    moved.viewpoint = target_from_source * cloud.viewpoint;
  change_vectors(moved, "vp", [&](const Eigen::Vector3d& origin) -> Eigen::Vector3d {
    return target_from_source * origin;
  });
  change_vectors(moved, "approach", [&](const Eigen::Vector3d& direction) -> Eigen::Vector3d {
    return target_from_source.linear() * direction;
  });
  return moved;
}

Bounds3d bounds_of(const std::vector<Eigen::Vector3d>& positions) {
  if (positions.empty()) return {};
  Bounds3d bounds{positions.front(), positions.front()};
  for (const Eigen::Vector3d& point : positions) {
    bounds.min = bounds.min.cwiseMin(point);
    bounds.max = bounds.max.cwiseMax(point);
  }
  return bounds;
}

}  // namespace libmap
