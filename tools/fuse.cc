// graspmap fuse: the depth images of a scan -> one oriented, coloured cloud.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/depth_fusion.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/scan_source.h"
#include "tools/command_line.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;
using libmap::PoseSource;

// Frame of the cloud: that of the poses, or ground truth's.
enum class CloudFrame { poses, ground_truth };

struct FuseOptions {
  std::string scan;
  std::string output;
  std::string poses = "auto";
  CloudFrame frame = CloudFrame::poses;
  libmap::DepthFusionOptions fusion;
};

constexpr PoseSource sources[] = {PoseSource::odometry, PoseSource::stored,
                                  PoseSource::ground_truth};

std::string sources_in(const libmap::PoseGraph& graph) {
  std::string names;
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(graph, source).empty())
      names += (names.empty() ? "" : ", ") + to_text(source);
  return names.empty() ? "no poses at all" : names;
}

std::optional<PoseSource> source_named(const std::string& name) {
  for (const PoseSource source : sources)
    if (to_text(source) == name) return source;
  return std::nullopt;
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

// The best poses that the scan has of its own: optimised, else by odometry, else ground truth.
std::string best_poses(const libmap::PoseGraph& graph, const std::string& scan) {
  for (const PoseSource source :
       {PoseSource::stored, PoseSource::odometry, PoseSource::ground_truth})
    if (!libmap::trajectory_of(graph, source).empty()) return to_text(source);
  throw libmap::Error("the scan has no poses: give a file of poses with --poses",
                      {.file = scan, .field = {}, .value = {}, .bound = {}});
}

libmap::Trajectory wanted_poses(const FuseOptions& options, const libmap::PoseGraph& graph,
                                Run& run) {
  const std::optional<PoseSource> source = source_named(options.poses);
  if (!source) return poses_in_file(options.poses, graph, run);
  libmap::Trajectory poses = libmap::trajectory_of(graph, *source);
  if (poses.empty())
    throw libmap::Error("the scan has none", {.file = options.scan,
                                              .field = "--poses",
                                              .value = options.poses,
                                              .bound = "what it has: " + sources_in(graph)});
  return poses;
}

// Into the frame of ground truth by the rigid alignment of the trajectories.
std::optional<libmap::Pose> truth_from_poses(const FuseOptions& options,
                                             const libmap::PoseGraph& graph,
                                             const libmap::Trajectory& poses, Run& run) {
  const libmap::Trajectory truth = libmap::trajectory_of(graph, PoseSource::ground_truth);
  if (options.frame == CloudFrame::poses) return std::nullopt;
  if (truth.empty())
    throw libmap::Error("the scan has no ground truth",
                        {.file = options.scan, .field = "--frame", .value = "ground-truth"});
  if (options.poses == to_text(PoseSource::ground_truth)) return libmap::Pose::Identity();
  libmap::AbsoluteTrajectoryError error;
  try {
    error = libmap::absolute_trajectory_error(poses, truth);
  } catch (const libmap::Error& failure) {
    throw failure.in_file(options.scan);
  }
  run.say(
      fmt::format("aligned with {} true poses: RMSE {:.1f} mm", error.poses, 1e3 * error.rmse_m));
  run.manifest().results.emplace_back("trajectory_rmse_m", error.rmse_m);
  run.manifest().transforms.emplace_back("ground_truth_from_poses", error.truth_from_estimate);
  return error.truth_from_estimate;
}

void add_results(const libmap::DepthFusionResult& result, libmap::Manifest& manifest) {
  const auto count = [&](const char* name, std::size_t value) {
    manifest.results.emplace_back(name, static_cast<std::int64_t>(value));
  };
  count("frames", result.frames);
  count("skipped_frames", result.skipped.size());
  count("pixels", result.pixels.pixels);
  count("measurements_used", result.pixels.used);
  count("rejected_unmeasured", result.pixels.unmeasured);
  count("rejected_out_of_range", result.pixels.out_of_range);
  count("rejected_without_ray", result.pixels.without_ray);
  count("rejected_flying", result.pixels.flying);
  count("rejected_grazing", result.pixels.grazing);
  count("occupied_voxels", result.occupied_voxels);
  count("surface_elements", result.elements);
  count("dropped_too_few_views", result.points.unconfirmed);
  count("dropped_seen_through", result.points.seen_through);
  count("dropped_beyond_edges", result.points.bent_away);
  count("merged", result.points.merged);
  count("points", result.cloud.size());
  count("points_beyond_edges", result.points.extended_points);
  manifest.timings_s.insert(manifest.timings_s.end(), result.timings_s.begin(),
                            result.timings_s.end());
}

void say_result(const libmap::DepthFusionResult& result, Run& run) {
  for (const auto& [name, seconds] : result.timings_s)
    run.detail(fmt::format("{}: {:.3f} s", name, seconds));
  const libmap::DepthPixelCounts& pixels = result.pixels;
  run.detail(
      fmt::format("{} of {} pixels used; {} unmeasured, {} out of range, {} flying, {} "
                  "grazing, {} without a ray",
                  pixels.used, pixels.pixels, pixels.unmeasured, pixels.out_of_range, pixels.flying,
                  pixels.grazing, pixels.without_ray));
  run.say(fmt::format("{} frames, {} measurements -> {} points", result.frames, pixels.used,
                      result.cloud.size()));
  if (result.cloud.empty()) run.warn("nothing was measured within the limits: the cloud is empty");
}

// Nodes that cannot be placed cost their frames; with --strict that is an error.
void report_nodes_without_pose(const FuseOptions& options, const libmap::PoseGraph& graph,
                               const libmap::Trajectory& poses, Run& run) {
  constexpr int invalid_weight = -9;
  std::size_t nodes = 0;
  for (const libmap::GraphNode& node : graph.nodes) nodes += node.weight != invalid_weight ? 1 : 0;
  if (poses.size() >= nodes) return;
  const std::string text =
      fmt::format("{} of {} nodes have no pose there", nodes - poses.size(), nodes);
  if (options.fusion.strict)
    throw libmap::Error(
        text, {.file = options.scan, .field = "--poses", .value = options.poses, .bound = {}});
  run.warn(options.scan + ": " + text + ": their frames are left out");
}

void fuse(FuseOptions options, Run& run) {
  libmap::require_cloud_format(options.output);
  std::vector<std::string> inputs = {options.scan};
  if (options.poses != "auto" && !source_named(options.poses)) inputs.push_back(options.poses);
  run.claim_output(options.output, inputs);
  const auto scan = run.timed("open", [&] { return libmap::open_scan(options.scan); });
  for (const std::string& warning : scan->warnings()) {
    if (options.fusion.strict) throw libmap::Error(warning).in_file(options.scan);
    run.warn(options.scan + ": " + warning);
  }
  if (options.poses == "auto") {
    options.poses = best_poses(scan->graph(), options.scan);
    run.say("poses: " + options.poses);
  }
  const libmap::Trajectory poses = wanted_poses(options, scan->graph(), run);
  report_nodes_without_pose(options, scan->graph(), poses, run);
  const auto alignment = truth_from_poses(options, scan->graph(), poses, run);
  libmap::DepthFusionResult result;
  try {
    result = libmap::fuse_depth(*scan, poses, options.fusion, run.progress());
  } catch (const libmap::Error& error) {
    // A broken frame's message names the file already.
    if (std::string_view(error.what()).starts_with(options.scan)) throw;
    throw error.in_file(options.scan);
  }
  for (const auto& [node, fault] : result.skipped) run.warn("skipped: " + fault);
  if (alignment) result.cloud = libmap::transform_cloud(result.cloud, *alignment);
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("poses", options.poses);
  manifest.frame = alignment ? "ground truth" : "poses";
  add_results(result, manifest);
  say_result(result, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, result.cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  FuseOptions options;
  graspmap_tools::Command command("fuse",
                                  "The depth images of a scan -> one oriented, coloured cloud.");
  command.input("SCAN", options.scan, "scan: a database of RTAB-Map, or a folder of images");
  command.output(options.output, "cloud (.pcd, .ply, .vtp, .csv)");
  command.option(
      "--poses", "auto|odometry|stored|ground-truth|FILE", options.poses,
      "where the frames were: by the scan, or a file of poses (.tum, .kitti, .g2o); auto: "
      "the first of stored, odometry and ground-truth that the scan has");
  command.parameters().add(
      "frame", options.frame,
      {{"poses", CloudFrame::poses}, {"ground-truth", CloudFrame::ground_truth}},
      "frame of the cloud; ground-truth: carried there by aligning the poses with the true ones");
  libmap::bind(command.parameters(), options.fusion);
  return command.run(argc, argv, [&](Run& run) { fuse(options, run); });
}
