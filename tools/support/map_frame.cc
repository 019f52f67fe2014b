#include "tools/support/map_frame.h"

#include "libmap/raster/dem_reader.h"

namespace graspmap_tools {

PointFrameNames point_frame_names() {
  return {{"input", PointFrame::input}, {"terrain", PointFrame::terrain}, {"map", PointFrame::map}};
}

PointFrameNames listed_point_frame_names() {
  PointFrameNames names = point_frame_names();
  names.insert(names.begin(), {"auto", PointFrame::automatic});
  return names;
}

std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table) {
  const std::size_t columns[] = {table.column("x"), table.column("y"), table.column("z")};
  if (table.rows.empty()) throw libmap::no_elements("rows below the header", table.file);
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

namespace {

// Reads the manifest of a file or folder; the folder's name may end with '/'.
std::optional<libmap::Manifest> manifest_of(const std::filesystem::path& path) {
  return libmap::read_manifest_of(path.has_filename() ? path : path.parent_path());
}

// Frame of points by their manifest: the parameter points_frame of a look-up, else the frame.
PointFrame recorded_frame(const libmap::Manifest& points) {
  const libmap::ManifestValue* value = points.find_parameter("points_frame");
  const auto* recorded = value == nullptr ? nullptr : std::get_if<std::string>(value);
  if (recorded != nullptr)
    for (const auto& [name, frame] : point_frame_names())
      if (name == *recorded) return frame;
  return points.frame == "terrain" ? PointFrame::terrain : PointFrame::input;
}

void require_same_terrain_frame(const libmap::Manifest& points, const std::string& file,
                                const std::string& map) {
  const libmap::Pose* own = points.find_transform(terrain_from_input_name);
  if (own == nullptr) return;
  const auto of_map = manifest_of(map);
  const libmap::Pose* others = terrain_from_input_of(of_map);
  if (others == nullptr || own->matrix() != others->matrix())
    throw libmap::Error("the points are in the terrain frame of another map",
                        {.file = file,
                         .field = "--points-frame",
                         .value = "auto",
                         .bound = "input, terrain or map"});
}

void copy_transform(const std::string& file, const char* name, Run& run) {
  const auto manifest = manifest_of(file);
  const libmap::Pose* transform = manifest ? manifest->find_transform(name) : nullptr;
  if (transform != nullptr) run.manifest().transforms.emplace_back(name, *transform);
}

}  // namespace

const libmap::Pose* terrain_from_input_of(const std::optional<libmap::Manifest>& manifest) {
  return manifest ? manifest->find_transform(terrain_from_input_name) : nullptr;
}

PointFrame frame_of_points(const std::string& points, PointFrame asked, const std::string& map,
                           Run& run) {
  if (asked != PointFrame::automatic) return asked;
  PointFrame found = PointFrame::input;
  if (const auto manifest = manifest_of(points)) {
    found = recorded_frame(*manifest);
    if (found == PointFrame::terrain) require_same_terrain_frame(*manifest, points, map);
  }
  for (const auto& [name, frame] : point_frame_names())
    if (frame == found)
      for (auto& [key, value] : run.manifest().parameters)
        if (key == "points_frame") value = name;
  return found;
}

std::optional<libmap::Pose> site_from_map_of(const std::string& file) {
  const auto manifest = manifest_of(file);
  return manifest ? site_from_map_of(*manifest) : std::nullopt;
}

std::optional<libmap::Pose> site_from_map_of(const libmap::Manifest& manifest) {
  const libmap::Pose* site_from_map = manifest.find_transform(site_from_map_name);
  const libmap::Pose* terrain_from_input = manifest.find_transform(terrain_from_input_name);
  if (manifest.frame != "terrain" || terrain_from_input == nullptr)
    return site_from_map == nullptr ? std::nullopt : std::optional(*site_from_map);
  return site_from_map == nullptr ? *terrain_from_input : *terrain_from_input * *site_from_map;
}

bool is_from_true_frame(const std::string& file) {
  const auto manifest = manifest_of(file);
  return manifest && (manifest->frame == "ground truth" ||
                      manifest->find_transform(truth_from_poses_name) != nullptr);
}

void copy_truth_transform(const std::string& input, Run& run) {
  copy_transform(input, truth_from_poses_name, run);
}

void copy_terrain_transform(const std::string& map, Run& run) {
  copy_transform(map, terrain_from_input_name, run);
}

void copy_transforms(const std::string& input, Run& run) {
  if (const auto site_from_map = site_from_map_of(input))
    run.manifest().transforms.emplace_back(site_from_map_name, *site_from_map);
  copy_truth_transform(input, run);
  copy_georeference(input, run);
}

void copy_georeference(const std::string& input, Run& run) {
  if (const auto georeference = libmap::read_georeference(input))
    run.manifest().georeference = georeference;
}

void copy_frame(const std::string& input, Run& run) {
  if (const auto manifest = libmap::read_manifest_of(input)) run.manifest().frame = manifest->frame;
  copy_transforms(input, run);
}

void copy_missing_entries(const libmap::Manifest& source, Run& run) {
  const auto carry = [](const auto& facts, auto& own) {
    for (const auto& fact : facts)
      if (std::none_of(own.begin(), own.end(),
                       [&](const auto& known) { return known.first == fact.first; }))
        own.push_back(fact);
  };
  libmap::Manifest& manifest = run.manifest();
  manifest.frame = source.frame;
  manifest.transforms = source.transforms;
  manifest.georeference = source.georeference;
  carry(source.parameters, manifest.parameters);
  carry(source.results, manifest.results);
}

libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run) {
  const auto manifest = libmap::read_manifest_of(map);
  if (points_frame == PointFrame::map) {
    if (!manifest || manifest->find_transform(site_from_map_name) == nullptr)
      throw libmap::Error(
          manifest ? "the manifest has no transform site_from_map, which `graspmap crop` and "
                     "`graspmap simulate cameras` write"
                   : "has no manifest with the transform site_from_map",
          {.file = map, .field = "--points-frame", .value = "map", .bound = "input or terrain"});
    return *site_from_map_of(map);
  }
  if (!manifest) {
    run.warn(map + ": has no manifest; listed points are assumed to be in the frame of the map");
    return libmap::Pose::Identity();
  }
  // Clouds and meshes that were not scored have one frame only.
  const libmap::Pose* terrain_from_input = manifest->find_transform(terrain_from_input_name);
  const bool map_in_terrain = manifest->frame == "terrain";
  const bool points_in_terrain = points_frame == PointFrame::terrain;
  if (terrain_from_input == nullptr || map_in_terrain == points_in_terrain)
    return libmap::Pose::Identity();
  return map_in_terrain ? *terrain_from_input : terrain_from_input->inverse();
}

libmap::Pose map_from_input(const std::optional<libmap::Manifest>& manifest) {
  const libmap::Pose* pose = terrain_from_input_of(manifest);
  return pose != nullptr && manifest->frame == "terrain" ? *pose : libmap::Pose::Identity();
}

libmap::Pose terrain_from_map(const std::optional<libmap::Manifest>& manifest) {
  const libmap::Pose* pose = terrain_from_input_of(manifest);
  return pose != nullptr && manifest->frame != "terrain" ? *pose : libmap::Pose::Identity();
}

Eigen::Vector3d up_of_map(const std::optional<libmap::Manifest>& manifest) {
  return terrain_from_map(manifest).linear().transpose() * Eigen::Vector3d::UnitZ();
}

}  // namespace graspmap_tools
