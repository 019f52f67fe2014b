#include "libmap/poses/trajectory_io.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/stamp_pairing.h"
#include "libmap/scan/trajectory_text.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr double pairing_tolerance_s = 0.02;
constexpr int invalid_weight = -9;
constexpr std::array<const char*, 3> extensions = {".tum", ".kitti", ".g2o"};

std::string extension_of(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

std::vector<const GraphNode*> valid_nodes(const PoseGraph& graph) {
  std::vector<const GraphNode*> nodes;
  for (const GraphNode& node : graph.nodes)
    if (node.weight != invalid_weight) nodes.push_back(&node);
  return nodes;
}

using NodePairs = std::vector<std::pair<const GraphNode*, const TrajectoryPose*>>;

NodePairs pair_by_node(const Trajectory& trajectory, const PoseGraph& graph) {
  NodePairs pairs;
  for (const TrajectoryPose& pose : trajectory)
    if (const GraphNode* node = graph.find_node(pose.node)) pairs.emplace_back(node, &pose);
  return pairs;
}

NodePairs pair_by_time(const Trajectory& trajectory, const std::vector<const GraphNode*>& nodes) {
  std::vector<double> node_stamps;
  std::vector<double> pose_stamps;
  for (const GraphNode* node : nodes) node_stamps.push_back(node->stamp_s);
  for (const TrajectoryPose& pose : trajectory) pose_stamps.push_back(pose.stamp_s);
  NodePairs pairs;
  for (const auto& [i, j] : pair_by_stamp(node_stamps, pose_stamps, pairing_tolerance_s))
    pairs.emplace_back(nodes[i], &trajectory[j]);
  return pairs;
}

NodePairs pair_by_order(const Trajectory& trajectory, const std::vector<const GraphNode*>& nodes) {
  if (trajectory.size() != nodes.size())
    throw Error("has neither nodes nor stamps and another number of poses than the scan has nodes",
                {.file = {},
                 .field = "poses",
                 .value = std::to_string(trajectory.size()),
                 .bound = std::to_string(nodes.size())});
  NodePairs pairs;
  for (std::size_t i = 0; i < nodes.size(); ++i) pairs.emplace_back(nodes[i], &trajectory[i]);
  return pairs;
}

}  // namespace

bool is_trajectory_path(const fs::path& path) {
  const std::string extension = extension_of(path);
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

void require_trajectory_format(const fs::path& path) {
  if (!is_trajectory_path(path))
    throw Error("unknown format of poses", {.file = path.string(),
                                            .field = "extension",
                                            .value = path.extension().string(),
                                            .bound = "one of .tum .kitti .g2o"});
}

TrajectoryFile read_trajectory(const fs::path& path) {
  require_trajectory_format(path);
  const std::string text = read_whole_file(path);
  const std::string extension = extension_of(path);
  TrajectoryFile file;
  if (extension == ".tum") file.poses = parse_tum(text, path.string());
  if (extension == ".kitti") file.poses = parse_kitti(text, path.string());
  if (extension == ".g2o") {
    PoseGraphText graph = parse_g2o(text, path.string());
    file = {std::move(graph.poses), std::move(graph.links)};
  }
  if (file.poses.empty()) throw Error("holds no pose", {.file = path.string()});
  return file;
}

void write_trajectory(const fs::path& path, const TrajectoryFile& trajectory, bool nodes) {
  require_trajectory_format(path);
  const std::string extension = extension_of(path);
  if (extension == ".tum") write_text(path, to_tum(trajectory.poses, nodes));
  if (extension == ".kitti") write_text(path, to_kitti(trajectory.poses));
  if (extension == ".g2o") write_text(path, to_g2o(trajectory.poses, trajectory.links));
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
                                        : pair_by_order(trajectory, nodes);
  if (pairs.empty())
    throw Error(have_nodes ? "none of the poses belongs to a node of the scan"
                           : "no pose lies within 20 ms of a node of the scan");
  std::map<int, TrajectoryPose> poses;
  for (const auto& [node, pose] : pairs)
    if (!poses.emplace(node->id, TrajectoryPose{node->id, node->stamp_s, pose->world_from_base})
             .second)
      throw Error("two poses for one node",
                  {.file = {}, .field = "node", .value = std::to_string(node->id)});
  NodeTrajectory result;
  for (const auto& [id, pose] : poses) result.poses.push_back(pose);
  result.foreign = trajectory.size() - pairs.size();
  return result;
}

}  // namespace libmap
