#include "libmap/poses/trajectory_io.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/poses/colmap_io.h"
#include "libmap/poses/stamp_pairing.h"
#include "libmap/poses/trajectory_text.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::array<std::pair<const char*, TrajectoryFormat>, 4> extensions = {{
    {".tum", TrajectoryFormat::tum},
    {".kitti", TrajectoryFormat::kitti},
    {".g2o", TrajectoryFormat::g2o},
    {".toro", TrajectoryFormat::toro},
}};

// First line of a file whose vertex ids are sequence numbers, not nodes.
constexpr std::string_view numbered_head = "# graspmap: poses without nodes, numbered in order";

std::vector<const GraphNode*> valid_nodes(const PoseGraph& graph) {
  std::vector<const GraphNode*> nodes;
  for (const GraphNode& node : graph.nodes)
    if (node.weight != GraphNode::invalid_weight) nodes.push_back(&node);
  return nodes;
}

using NodePairs = std::vector<std::pair<const GraphNode*, const TrajectoryPose*>>;

NodePairs pair_by_node(const Trajectory& trajectory, const PoseGraph& graph) {
  NodePairs pairs;
  for (const TrajectoryPose& pose : trajectory)
    if (const GraphNode* node = graph.find_node(pose.node);
        node != nullptr && node->weight != GraphNode::invalid_weight)
      pairs.emplace_back(node, &pose);
  return pairs;
}

NodePairs pair_by_time(const Trajectory& trajectory, const std::vector<const GraphNode*>& nodes) {
  std::vector<double> node_stamps;
  std::vector<double> pose_stamps;
  node_stamps.reserve(nodes.size());
  pose_stamps.reserve(trajectory.size());
  for (const GraphNode* node : nodes) node_stamps.push_back(node->stamp_s);
  for (const TrajectoryPose& pose : trajectory) pose_stamps.push_back(pose.stamp_s);
  NodePairs pairs;
  for (const auto& [i, j] : pair_by_stamp(node_stamps, pose_stamps, pairing_tolerance_s))
    pairs.emplace_back(nodes[i], &trajectory[j]);
  return pairs;
}

NodePairs pair_by_order(const Trajectory& trajectory, const PoseGraph& graph,
                        std::vector<const GraphNode*> nodes) {
  const auto has_stored_pose = [&](const GraphNode* node) {
    return graph.optimized_map_from_base.contains(node->id);
  };
  const std::size_t valid = nodes.size();
  // RTAB-Map exports its optimized poses.
  if (trajectory.size() != valid)
    std::erase_if(nodes, [&](const GraphNode* node) { return !has_stored_pose(node); });
  if (trajectory.size() != nodes.size())
    throw Error("without node ids and stamps, one pose per node of the scan is required",
                {.field = "poses",
                 .value = std::to_string(trajectory.size()),
                 .bound = std::to_string(valid)});
  NodePairs pairs;
  for (std::size_t i = 0; i < nodes.size(); ++i) pairs.emplace_back(nodes[i], &trajectory[i]);
  return pairs;
}

std::optional<TrajectoryFormat> format_of_extension(const fs::path& path) {
  const std::string extension = lower_case(path.extension().string());
  for (const auto& [name, format] : extensions)
    if (extension == name) return format;
  return std::nullopt;
}

TrajectoryFormat format_of_text(const std::string& text, const fs::path& path) {
  if (const auto format = format_of_extension(path)) return *format;
  const std::string extension = recognize_poses(text, path.string());
  if (extension == ".log") return TrajectoryFormat::open3d;
  if (extension == ".json") return TrajectoryFormat::nerfstudio;
  if (extension == ".euroc") return TrajectoryFormat::euroc;
  return *format_of_extension("poses" + extension);
}

PoseAxes axes_of(TrajectoryFormat format) {
  if (format == TrajectoryFormat::tum_motion_capture) return PoseAxes::motion_capture;
  if (format == TrajectoryFormat::kitti_optical) return PoseAxes::optical;
  return PoseAxes::map;
}

// Reads the camera poses from images.txt; ignores the camera models.
TrajectoryFile read_colmap(const fs::path& path) {
  const fs::path file = file_of_trajectory(path);
  TrajectoryFile read;
  for (const auto& [id, image] : parse_colmap_images(read_whole_file(file), file.string()))
    read.images.push_back({image.name, image.camera_from_world.inverse()});
  return read;
}

TrajectoryFile parse_poses(TrajectoryFormat format, const std::string& text,
                           const std::string& file) {
  TrajectoryFile read;
  if (format == TrajectoryFormat::g2o || format == TrajectoryFormat::toro) {
    PoseGraphText graph =
        format == TrajectoryFormat::g2o ? parse_g2o(text, file) : parse_toro(text, file);
    if (text.starts_with(numbered_head))
      for (TrajectoryPose& pose : graph.poses) pose.node = 0;
    return {std::move(graph.poses), std::move(graph.links)};
  }
  if (format == TrajectoryFormat::nerfstudio) read.images = parse_nerfstudio(text, file);
  if (format == TrajectoryFormat::euroc) read.poses = parse_euroc(text, file);
  read.of_cameras = format == TrajectoryFormat::open3d;
  if (read.of_cameras) read.poses = parse_open3d(text, file);
  if (format >= TrajectoryFormat::open3d) return read;
  const bool is_kitti =
      format == TrajectoryFormat::kitti || format == TrajectoryFormat::kitti_optical;
  read.poses = is_kitti ? parse_kitti(text, file) : parse_tum(text, file);
  for (TrajectoryPose& pose : read.poses)
    pose.world_from_base = from_axes(axes_of(format), pose.world_from_base);
  return read;
}

}  // namespace

const std::vector<std::pair<std::string, TrajectoryFormat>>& trajectory_format_names() {
  static const std::vector<std::pair<std::string, TrajectoryFormat>> names = {
      {"auto", TrajectoryFormat::automatic},
      {"tum", TrajectoryFormat::tum},
      {"tum-motion-capture", TrajectoryFormat::tum_motion_capture},
      {"kitti", TrajectoryFormat::kitti},
      {"kitti-optical", TrajectoryFormat::kitti_optical},
      {"toro", TrajectoryFormat::toro},
      {"g2o", TrajectoryFormat::g2o},
      {"colmap", TrajectoryFormat::colmap},
      {"open3d", TrajectoryFormat::open3d},
      {"nerfstudio", TrajectoryFormat::nerfstudio},
      {"euroc", TrajectoryFormat::euroc}};
  return names;
}

bool is_trajectory_path(const fs::path& path) { return format_of_extension(path).has_value(); }

void require_trajectory_format(const fs::path& path) {
  if (is_trajectory_path(path)) return;
  std::string known;
  for (const auto& [name, format] : extensions) known += std::string(" ") + name;
  throw Error("unknown pose format", {.file = path.string(),
                                      .field = "extension",
                                      .value = path.extension().string(),
                                      .bound = "one of" + known});
}

fs::path file_of_trajectory(const fs::path& path) {
  return fs::is_directory(path) ? find_colmap_model(path) / "images.txt" : path;
}

TrajectoryFile read_trajectory(const fs::path& path, TrajectoryFormat format) {
  TrajectoryFile file;
  const bool may_be_model = fs::is_directory(path) || path.filename() == "images.txt";
  if (format == TrajectoryFormat::colmap ||
      (format == TrajectoryFormat::automatic && may_be_model)) {
    file = read_colmap(path);
  } else {
    const std::string text = read_whole_file(path);
    if (format == TrajectoryFormat::automatic) format = format_of_text(text, path);
    file = parse_poses(format, text, path.string());
  }
  if (file.poses.empty() && file.images.empty()) throw no_elements("poses", path);
  return file;
}

namespace {

// Numbers the poses 1, 2, ... if their nodes are unknown, as RTAB-Map does. Returns true if it did;
// a comment in g2o states this (RTAB-Map's reader of TORO does not support comments).
bool number_nodes(Trajectory& poses) {
  const auto is_known = [](const TrajectoryPose& pose) { return pose.node != 0; };
  if (std::any_of(poses.begin(), poses.end(), is_known)) return false;
  int node = 0;
  for (TrajectoryPose& pose : poses) pose.node = ++node;
  return true;
}

bool have_distinct_stamps(const Trajectory& poses) {
  std::set<double> stamps;
  for (const TrajectoryPose& pose : poses) stamps.insert(pose.stamp_s);
  return stamps.size() == poses.size();
}

}  // namespace

void write_trajectory_as(TrajectoryFormat format, const fs::path& path,
                         const TrajectoryFile& trajectory, bool nodes) {
  Trajectory poses = trajectory.poses;
  const bool has_vertices = format == TrajectoryFormat::toro || format == TrajectoryFormat::g2o;
  const bool is_numbered = has_vertices && number_nodes(poses);
  // Only nodes distinguish poses with equal stamps.
  const bool have_nodes = std::all_of(poses.begin(), poses.end(),
                                      [](const TrajectoryPose& pose) { return pose.node > 0; });
  const bool with_nodes = nodes || (have_nodes && !have_distinct_stamps(poses));
  for (TrajectoryPose& pose : poses)
    pose.world_from_base = to_axes(axes_of(format), pose.world_from_base);
  switch (format) {
    case TrajectoryFormat::tum:
    case TrajectoryFormat::tum_motion_capture:
      return write_text(path, to_tum(poses, with_nodes));
    case TrajectoryFormat::kitti:
    case TrajectoryFormat::kitti_optical:
      return write_text(path, to_kitti(poses));
    case TrajectoryFormat::toro:
      return write_text(path, to_toro(poses, trajectory.links));
    case TrajectoryFormat::g2o:
      return write_text(path, (is_numbered ? std::string(numbered_head) + "\n" : "") +
                                  to_g2o(poses, trajectory.links));
    case TrajectoryFormat::automatic:
    case TrajectoryFormat::colmap:
    case TrajectoryFormat::open3d:
    case TrajectoryFormat::nerfstudio:
    case TrajectoryFormat::euroc:
      break;
  }
  throw Error("poses cannot be written in this format", {.file = path.string()});
}

void write_trajectory(const fs::path& path, const TrajectoryFile& trajectory, bool nodes) {
  require_trajectory_format(path);
  write_trajectory_as(*format_of_extension(path), path, trajectory, nodes);
}

NodeTrajectory assign_nodes(const Trajectory& trajectory, const PoseGraph& graph) {
  const bool have_nodes = std::all_of(trajectory.begin(), trajectory.end(),
                                      [](const TrajectoryPose& pose) { return pose.node > 0; });
  const bool have_stamps =
      std::any_of(trajectory.begin(), trajectory.end(),
                  [](const TrajectoryPose& pose) { return pose.stamp_s != 0.0; });
  const std::vector<const GraphNode*> nodes = valid_nodes(graph);
  const NodePairs pairs = have_nodes    ? pair_by_node(trajectory, graph)
                          : have_stamps ? pair_by_time(trajectory, nodes)
                                        : pair_by_order(trajectory, graph, nodes);
  if (pairs.empty())
    throw Error(have_nodes ? "none matches a node of the scan"
                           : "none is within 20 ms of a node of the scan",
                {.field = "poses"});
  std::map<int, TrajectoryPose> poses;
  for (const auto& [node, pose] : pairs)
    if (!poses.emplace(node->id, TrajectoryPose{node->id, node->stamp_s, pose->world_from_base})
             .second)
      throw Error("two poses belong to this node",
                  {.field = "node", .value = std::to_string(node->id)});
  NodeTrajectory result;
  for (const auto& [id, pose] : poses) result.poses.push_back(pose);
  result.unmatched = trajectory.size() - pairs.size();
  return result;
}

}  // namespace libmap
