#include "tools/map_frame.h"

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace graspmap_tools {

const std::vector<std::pair<std::string, PointFrame>>& point_frame_names() {
  static const std::vector<std::pair<std::string, PointFrame>> names = {
      {"input", PointFrame::input}, {"terrain", PointFrame::terrain}};
  return names;
}

std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table) {
  const std::size_t columns[] = {table.column("x"), table.column("y"), table.column("z")};
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    Eigen::Vector3d& position = positions.emplace_back();
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      position[axis] = table.number(row, columns[static_cast<std::size_t>(axis)]);
    if (!position.allFinite())
      throw libmap::Error("x, y and z must be finite",
                          {.file = table.file, .field = "row " + std::to_string(row + 1)});
  }
  return positions;
}

libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run) {
  const auto manifest = libmap::read_manifest_of(map);
  if (!manifest) {
    run.warn(map + ": no manifest beside it: listed points are taken in its own frame");
    return libmap::Pose::Identity();
  }
  // Clouds and meshes that were never scored have one frame alone.
  const libmap::Pose* terrain_from_input = manifest->find_transform("terrain_from_input");
  const bool map_in_terrain = manifest->frame == "terrain";
  const bool points_in_terrain = points_frame == PointFrame::terrain;
  if (terrain_from_input == nullptr || map_in_terrain == points_in_terrain)
    return libmap::Pose::Identity();
  return map_in_terrain ? *terrain_from_input : terrain_from_input->inverse();
}

Eigen::Vector3d parse_vector(const std::string& text, const std::string& field) {
  Eigen::Vector3d vector;
  std::string_view rest = text;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const std::size_t comma = rest.find(',');
    const auto value = libmap::parse_double(rest.substr(0, comma));
    if (!value || (comma == std::string_view::npos) != (axis == 2))
      throw libmap::Error("not three numbers", {.field = field, .value = text, .bound = "X,Y,Z"});
    vector[axis] = *value;
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
  }
  return vector;
}

}  // namespace graspmap_tools
