#include "libgtd/score/graspability_map.h"

#include <algorithm>
#include <numeric>

#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/score_color.h"

namespace libgtd {

namespace {

using libmap::PointCloud;
using libmap::ScalarField;
using libmap::ScalarType;

constexpr const char* obstacle_field = "obstacle";
constexpr const char* slope_field = "slope_deg";

template <typename Value>
void add_values(PointCloud& cloud, const char* name, ScalarType type,
                const std::vector<MapVoxel>& voxels, const Value& value) {
  ScalarField& field = cloud.add_field(name, type);
  for (std::size_t n = 0; n < voxels.size(); ++n)
    field.values[n] = static_cast<double>(value(voxels[n]));
}

void append(PointCloud& whole, const PointCloud& part) {
  const auto add = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (ScalarField& field : whole.fields) {
    const ScalarField* other = part.find_field(field.name);
    if (other == nullptr || part.fields.size() != whole.fields.size())
      throw libmap::Error("is not a field of all parts of the map", {.field = field.name});
    // Text files have no types: a part that contains only integers is read as int32.
    if (field.type != other->type) field.type = ScalarType::float64;
    add(field.values, other->values);
  }
  if (whole.has_colors() != part.has_colors() && !whole.empty() && !part.empty())
    throw libmap::Error("only some parts of the map have them", {.field = "colors"});
  if (whole.has_normals() != part.has_normals() && !whole.empty() && !part.empty())
    throw libmap::Error("only some parts of the map have them", {.field = "normals"});
  add(whole.positions, part.positions);
  add(whole.colors, part.colors);
  add(whole.normals, part.normals);
}

}  // namespace

const std::vector<std::pair<std::string, MapFrame>>& map_frame_names() {
  static const std::vector<std::pair<std::string, MapFrame>> names = {
      {"terrain", MapFrame::terrain}, {"input", MapFrame::input}};
  return names;
}

PointCloud to_cloud(const GraspabilityMap& map, MapFrame frame) {
  PointCloud cloud;
  const libmap::Pose input_from_terrain = map.terrain_from_input.inverse();
  for (const MapVoxel& one : map.voxels) {
    const Eigen::Vector3d center = map.lattice.center_of(one.voxel);
    cloud.positions.push_back(frame == MapFrame::input ? input_from_terrain * center : center);
    cloud.colors.push_back(center.z() < map.zero_plane_m ? libmap::below_plane_color
                                                         : libmap::score_color(one.score));
  }
  const auto add = [&](const char* name, ScalarType type, const auto& value) {
    add_values(cloud, name, type, map.voxels, value);
  };
  add("score", ScalarType::float32, [](const MapVoxel& one) { return one.score; });
  add("ssv", ScalarType::uint32, [](const MapVoxel& one) { return one.counts.ssv; });
  add("gsv", ScalarType::uint32, [](const MapVoxel& one) { return one.counts.gsv; });
  add("convex", ScalarType::uint8, [](const MapVoxel& one) { return one.convex; });
  add("graspable", ScalarType::uint8, [](const MapVoxel& one) { return one.graspable; });
  add("border", ScalarType::uint8, [](const MapVoxel& one) { return one.border; });
  add("i", ScalarType::int32, [](const MapVoxel& one) { return one.voxel.i; });
  add("j", ScalarType::int32, [](const MapVoxel& one) { return one.voxel.j; });
  add("k", ScalarType::int32, [](const MapVoxel& one) { return one.voxel.k; });
  if (map.content.outward_fall_fractions)
    add("falling_share", ScalarType::float32,
        [](const auto& one) { return one.outward_fall_fraction; });
  if (map.content.forces) {
    const auto add_force = [&](const char* name, float ForceEstimate::*value) {
      add(name, ScalarType::float32, [value](const MapVoxel& one) { return one.force.*value; });
    };
    add_force("hold_probability", &ForceEstimate::hold_probability);
    add_force("holding_force_n", &ForceEstimate::median_n);
    add_force("holding_force_low_n", &ForceEstimate::low_n);
    add_force("holding_force_high_n", &ForceEstimate::high_n);
    add_force("trial_spread", &ForceEstimate::trial_spread);
    add_force("parameter_spread", &ForceEstimate::parameter_spread);
  }
  if (map.content.slopes)
    add("slope_deg", ScalarType::float32, [](const MapVoxel& one) { return one.slope_deg; });
  if (map.content.obstacles)
    add(obstacle_field, ScalarType::uint8, [](const MapVoxel& one) { return one.obstacle; });
  if (!map.content.normals) return cloud;
  const Eigen::Matrix3f rotation = frame == MapFrame::input
                                       ? input_from_terrain.linear().cast<float>().eval()
                                       : Eigen::Matrix3f::Identity();
  for (const MapVoxel& one : map.voxels) cloud.normals.push_back(rotation * one.normal);
  return cloud;
}

PointCloud merge_map_clouds(const std::vector<PointCloud>& parts) {
  PointCloud whole;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    if (n == 0)
      whole = parts[n];
    else
      append(whole, parts[n]);
  }
  const std::vector<Voxel> voxels = VoxelFields(whole).all();
  std::vector<std::size_t> order(whole.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return voxels[a] < voxels[b]; });
  for (std::size_t n = 1; n < order.size(); ++n)
    if (voxels[order[n - 1]] == voxels[order[n]])
      throw libmap::Error(
          "two parts contain the same voxel",
          {.field = "i, j, k",
           .value = std::to_string(voxels[order[n]].i) + ", " + std::to_string(voxels[order[n]].j) +
                    ", " + std::to_string(voxels[order[n]].k)});
  return libmap::select_points(whole, order);
}

}  // namespace libgtd
