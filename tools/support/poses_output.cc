#include "tools/support/poses_output.h"

#include <fmt/format.h>

#include <filesystem>

#include "libmap/core/error.h"
#include "libmap/scan/colmap_builder.h"
#include "libmap/scan/picture_file.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string>& model_names() {
  static const std::vector<std::string> names = {"cameras.txt", "images.txt", "points3D.txt"};
  return names;
}

// Without a trailing slash.
fs::path plain(const std::string& path) {
  const fs::path given(path);
  return given.has_filename() ? given : given.parent_path();
}

bool is_model(const std::string& path) { return plain(path).extension() == ".colmap"; }

libmap::ColmapModel model_of(const libmap::Trajectory& poses, const libmap::ScanSource& scan,
                             Run& run) {
  libmap::ColmapBuilder builder;
  for (const libmap::TrajectoryPose& pose : poses) {
    try {
      const std::vector<libmap::CameraView> views =
          libmap::read_pictures(scan, pose.node, {.color = true, .depth = false});
      for (std::size_t c = 0; c < views.size(); ++c)
        builder.add_image(libmap::picture_file(scan, pose.node, views, c).name, views[c],
                          pose.world_from_base * views[c].color_camera.base_from_camera);
    } catch (const libmap::Error& error) {
      run.warn(std::string(error.what()) + "; its pose is not in the model of COLMAP");
    }
  }
  return builder.model();
}

void warn_of_lost_nodes(const std::string& path, const libmap::Trajectory& poses,
                        const libmap::PoseGraph& graph, Run& run) {
  constexpr int invalid_weight = -9;
  std::size_t nodes = 0;
  for (const libmap::GraphNode& node : graph.nodes) nodes += node.weight != invalid_weight ? 1 : 0;
  if (plain(path).extension() != ".kitti" || poses.size() == nodes) return;
  run.warn(
      fmt::format("{}: its lines name no nodes, and {} of {} nodes have a pose: only a file "
                  ".tum, .g2o or .toro can be bound to the scan again",
                  path, poses.size(), nodes));
}

}  // namespace

void claim_poses_output(const std::string& path, const std::vector<std::string>& inputs, Run& run) {
  if (is_model(path)) return run.claim_output_tree(plain(path), model_names(), inputs);
  if (!libmap::is_trajectory_path(path))
    throw libmap::Error("unknown format of poses",
                        {.file = path,
                         .field = "extension",
                         .value = plain(path).extension().string(),
                         .bound = "one of .tum .kitti .g2o .toro .colmap"});
  run.claim_output(path, inputs);
}

void write_poses_output(const std::string& path, const libmap::TrajectoryFile& poses,
                        const libmap::ScanSource& scan, bool nodes, Run& run) {
  if (is_model(path))
    return run.write_output_tree(plain(path), model_names(), [&](const fs::path& folder) {
      const libmap::ColmapModel model = model_of(poses.poses, scan, run);
      if (!folder.empty()) libmap::write_colmap_model(folder, model);
    });
  warn_of_lost_nodes(path, poses.poses, scan.graph(), run);
  run.write_output(
      path, [&](const auto& temporary) { libmap::write_trajectory(temporary, poses, nodes); });
}

}  // namespace graspmap_tools
