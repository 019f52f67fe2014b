#include "tools/scan_poses.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"

namespace graspmap_tools {

namespace fs = std::filesystem;
using libmap::PoseSource;

namespace {

// The best first: optimised, else by odometry, else ground truth.
constexpr PoseSource sources[] = {PoseSource::stored, PoseSource::odometry,
                                  PoseSource::ground_truth};

std::optional<PoseSource> source_named(const std::string& name) {
  for (const PoseSource source : sources)
    if (to_text(source) == name) return source;
  return std::nullopt;
}

std::string sources_in(const libmap::PoseGraph& graph) {
  std::string names;
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(graph, source).empty())
      names += (names.empty() ? "" : ", ") + to_text(source);
  return names.empty() ? "no poses at all" : names;
}

libmap::Trajectory poses_in_file(const std::string& file, const libmap::PoseGraph& graph,
                                 Run& run) {
  if (!fs::exists(file) && !libmap::is_trajectory_path(file))
    throw libmap::Error(
        "no such poses" + libmap::did_you_mean(file, {"odometry", "stored", "ground-truth"}),
        {.file = {},
         .field = "--poses",
         .value = file,
         .bound = "auto, odometry, stored, ground-truth or a file"});
  const libmap::TrajectoryFile read = libmap::read_trajectory(file);
  try {
    libmap::NodeTrajectory assigned = libmap::assign_nodes(read.poses, graph);
    run.add_input(file);
    run.say(fmt::format("{} of {} poses belong to nodes of the scan", assigned.poses.size(),
                        read.poses.size()));
    run.manifest().results.emplace_back("poses_in_file",
                                        static_cast<std::int64_t>(read.poses.size()));
    return std::move(assigned.poses);
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
}

std::string best_poses(const libmap::PoseGraph& graph, const std::string& scan) {
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(graph, source).empty()) return to_text(source);
  throw libmap::Error("the scan has no poses: give a file of poses with --poses",
                      {.file = scan, .field = {}, .value = {}, .bound = {}});
}

libmap::Trajectory wanted_poses(const std::string& scan, const std::string& wanted,
                                const libmap::PoseGraph& graph, Run& run) {
  const std::optional<PoseSource> source = source_named(wanted);
  if (!source) return poses_in_file(wanted, graph, run);
  libmap::Trajectory poses = libmap::trajectory_of(graph, *source);
  if (poses.empty())
    throw libmap::Error("the scan has none", {.file = scan,
                                              .field = "--poses",
                                              .value = wanted,
                                              .bound = "what it has: " + sources_in(graph)});
  return poses;
}

void report_nodes_without_pose(const std::string& scan, const std::string& wanted,
                               const libmap::PoseGraph& graph, const libmap::Trajectory& poses,
                               bool strict, Run& run) {
  constexpr int invalid_weight = -9;
  std::size_t nodes = 0;
  for (const libmap::GraphNode& node : graph.nodes) nodes += node.weight != invalid_weight ? 1 : 0;
  if (poses.size() >= nodes) return;
  const std::string text =
      fmt::format("{} of {} nodes have no pose there", nodes - poses.size(), nodes);
  if (strict)
    throw libmap::Error(text, {.file = scan, .field = "--poses", .value = wanted, .bound = {}});
  run.warn(scan + ": " + text + ": their frames are left out");
}

}  // namespace

void add_poses_option(Command& command, std::string& poses) {
  command.option("--poses", "auto|odometry|stored|ground-truth|FILE", poses,
                 "where the frames were: by the scan, or a file of poses (.tum, .kitti, .g2o); "
                 "auto: the first of stored, odometry and ground-truth that the scan has");
}

std::vector<std::string> scan_inputs(const std::string& scan, const std::string& poses) {
  std::vector<std::string> inputs = {scan};
  if (poses != "auto" && !source_named(poses)) inputs.push_back(poses);
  return inputs;
}

std::unique_ptr<libmap::ScanSource> open_scan(const std::string& path, bool strict, Run& run) {
  auto scan = run.timed("open", [&] { return libmap::open_scan(path); });
  for (const std::string& warning : scan->warnings()) {
    if (strict) throw libmap::Error(warning).in_file(path);
    run.warn(path + ": " + warning);
  }
  return scan;
}

libmap::Trajectory find_poses(const libmap::ScanSource& scan, std::string& poses, bool strict,
                              Run& run) {
  const std::string path = scan.path().string();
  if (poses == "auto") {
    poses = best_poses(scan.graph(), path);
    run.say("poses: " + poses);
  }
  libmap::Trajectory found = wanted_poses(path, poses, scan.graph(), run);
  report_nodes_without_pose(path, poses, scan.graph(), found, strict, run);
  run.manifest().parameters.emplace_back("poses", poses);
  return found;
}

libmap::Pose truth_from_poses(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                              const std::string& poses_name, Run& run) {
  const std::string path = scan.path().string();
  const libmap::Trajectory truth = libmap::trajectory_of(scan.graph(), PoseSource::ground_truth);
  if (truth.empty())
    throw libmap::Error("the scan has no ground truth",
                        {.file = path, .field = "--frame", .value = "ground-truth", .bound = {}});
  if (poses_name == to_text(PoseSource::ground_truth)) return libmap::Pose::Identity();
  libmap::AbsoluteTrajectoryError error;
  try {
    error = libmap::absolute_trajectory_error(poses, truth);
  } catch (const libmap::Error& failure) {
    throw failure.in_file(path);
  }
  run.say(
      fmt::format("aligned with {} true poses: RMSE {:.1f} mm", error.poses, 1e3 * error.rmse_m));
  run.manifest().results.emplace_back("trajectory_rmse_m", error.rmse_m);
  run.manifest().transforms.emplace_back("ground_truth_from_poses", error.truth_from_estimate);
  return error.truth_from_estimate;
}

}  // namespace graspmap_tools
