#include "tools/support/scan_poses.h"

#include <set>

#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_source.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

namespace fs = std::filesystem;
using libmap::PoseSource;

namespace {

// Sources in the order of preference for "auto".
constexpr PoseSource sources[] = {PoseSource::optimized, PoseSource::odometry,
                                  PoseSource::ground_truth};

std::optional<PoseSource> source_named(const std::string& name) {
  for (const PoseSource source : sources)
    if (to_text(source) == name) return source;
  if (name == "stored") return PoseSource::optimized;  // alternative name
  return std::nullopt;
}

constexpr const char* camera_result = "camera";

bool is_input_of(const libmap::Manifest& manifest, const std::string& file) {
  const std::string hash = libmap::sha256_of_file(file);
  return std::any_of(manifest.inputs.begin(), manifest.inputs.end(),
                     [&](const libmap::ManifestInput& input) { return input.sha256 == hash; });
}

std::string sources_in(const libmap::PoseGraph& graph) {
  std::string names;
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(graph, source).empty())
      names += (names.empty() ? "" : ", ") + to_text(source);
  return names.empty() ? "none" : names;
}

libmap::Trajectory poses_in_file(const PosesOption& poses, const libmap::ScanSource& scan,
                                 Run& run) {
  const std::string& file = poses.source;
  if (!fs::exists(file) && !libmap::is_trajectory_path(file))
    throw libmap::Error("neither a file nor a source of poses" +
                            libmap::did_you_mean(file, {"odometry", "optimized", "ground-truth"}),
                        {.field = "--poses",
                         .value = file,
                         .bound = "auto, odometry, optimized, ground-truth or a file"});
  libmap::ImportedPoses imported = libmap::import_poses(file, scan, poses.file);
  run.add_input(libmap::file_of_trajectory(file));
  for (const std::string& warning : imported.warnings) run.warn("{}: {}", file, warning);
  run.info("{} of {} poses belong to nodes of the scan",
           imported.poses_in_file - imported.trajectory.unmatched, imported.poses_in_file);
  if (imported.scale != 1.0) run.info("poses scaled by {:.9g}", imported.scale);
  run.add_results(
      {{"poses_in_file", imported.poses_in_file}, {"poses_scale_taken", imported.scale}});
  if (imported.max_rig_deviation_m > 0.0) {
    run.info("camera poses of a node agree within {:.1f} mm", 1e3 * imported.max_rig_deviation_m);
    run.add_results({{"largest_rig_deviation_m", imported.max_rig_deviation_m}});
  }
  return std::move(imported.trajectory.poses);
}

std::string best_poses(const libmap::PoseGraph& graph, const std::string& scan) {
  for (const PoseSource source : sources)
    if (!libmap::trajectory_of(graph, source).empty()) return to_text(source);
  throw libmap::Error("the scan contains no poses; give a pose file with --poses", {.file = scan});
}

libmap::Trajectory wanted_poses(const libmap::ScanSource& scan, const PosesOption& wanted,
                                Run& run) {
  const std::optional<PoseSource> source = source_named(wanted.source);
  if (!source) return poses_in_file(wanted, scan, run);
  libmap::Trajectory poses = libmap::trajectory_of(scan.graph(), *source);
  if (poses.empty())
    throw libmap::Error("the scan does not contain these poses",
                        {.file = scan.path().string(),
                         .field = "--poses",
                         .value = wanted.source,
                         .bound = "one of those that it contains: " + sources_in(scan.graph())});
  return poses;
}

void report_nodes_without_pose(const std::string& scan, const std::string& wanted,
                               const libmap::PoseGraph& graph, const libmap::Trajectory& poses,
                               bool strict, Run& run) {
  const std::size_t nodes = count_valid_nodes(graph);
  if (poses.size() >= nodes) return;
  const std::string text =
      fmt::format("{} of {} nodes have no pose in this source", nodes - poses.size(), nodes);
  if (strict) throw libmap::Error(text, {.file = scan, .field = "--poses", .value = wanted});
  run.warn(scan + ": " + text + "; frames without a pose are skipped");
}

// Warns about odometry of several sessions, each of which has its own frame.
void report_sessions(const std::string& scan, const libmap::PoseGraph& graph,
                     const libmap::Trajectory& poses, Run& run) {
  std::set<int> sessions;
  for (const libmap::TrajectoryPose& pose : poses)
    if (const libmap::GraphNode* node = graph.find_node(pose.node)) sessions.insert(node->session);
  if (sessions.size() < 2) return;
  const std::string text = fmt::format(
      "odometry of {} sessions, each in a separate frame; refine joins sessions", sessions.size());
  run.warn(scan + ": " + text);
}

}  // namespace

void add_poses_option(Command& command, PosesOption& poses) {
  command.option("--poses", "auto|odometry|optimized|ground-truth|FILE", poses.source,
                 "poses of the frames: from the scan, or from a file (TUM, KITTI, g2o, TORO; a "
                 "folder: COLMAP); auto: the first of optimized, odometry and ground-truth that "
                 "the scan contains; stored: same as optimized");
  libmap::bind(command.parameters(), poses.file);
}

std::size_t count_valid_nodes(const libmap::PoseGraph& graph) {
  return static_cast<std::size_t>(
      std::count_if(graph.nodes.begin(), graph.nodes.end(), [](const libmap::GraphNode& node) {
        return node.weight != libmap::GraphNode::invalid_weight;
      }));
}

std::vector<std::string> scan_inputs(const std::string& scan, const PosesOption& poses) {
  std::vector<std::string> inputs = {scan};
  if (poses.source != "auto" && !source_named(poses.source)) inputs.push_back(poses.source);
  return inputs;
}

void add_calibration_option(Command& command, CalibrationOption& calibration) {
  command.option(
      "--calibration", "auto|stored|FILE.yaml", calibration.source,
      "camera calibration; stored: from the scan; a file: by refine --write-calibration; auto: "
      "the calibration with which the poses were estimated, else the stored one");
}

std::optional<libmap::CameraFile> known_camera(const CalibrationOption& calibration,
                                               const std::string& scan, const PosesOption& poses,
                                               Run& run) {
  if (calibration.source == "stored") return std::nullopt;
  std::string name = calibration.source;
  libmap::CameraFile camera;
  if (calibration.source != "auto") {
    camera = libmap::read_camera(name);
    run.add_input(name);
  } else {
    if (poses.source == "auto" || source_named(poses.source)) return std::nullopt;
    name = poses.source;
    const std::optional<libmap::Manifest> made = libmap::read_manifest_of(name);
    const auto* text = made ? std::get_if<std::string>(made->find_result(camera_result)) : nullptr;
    if (text == nullptr) return std::nullopt;
    if (fs::is_regular_file(scan) && !is_input_of(*made, scan)) {
      run.info("camera of {}: not applied, because the poses are from another scan", name);
      return std::nullopt;
    }
    camera = libmap::parse_camera(*text, libmap::manifest_path(name).string());
  }
  run.info("camera of {}: {}", name,
           !camera.findings.empty() ? fmt::format("{}", fmt::join(camera.findings, "; "))
           : camera.depth.empty()   ? "intrinsics"
                                    : "intrinsics and depth correction");
  return camera;
}

void add_camera(const libmap::CameraFile& camera, Run& run) {
  run.add_results({{camera_result, libmap::to_yaml(camera)}});
}

std::unique_ptr<libmap::ScanSource> open_scan(const std::string& path, bool strict, Run& run,
                                              const std::optional<libmap::CameraFile>& camera) {
  return open_scan(std::vector<std::string>{path}, strict, run, camera);
}

std::unique_ptr<libmap::ScanSource> open_scan(const std::vector<std::string>& scans, bool strict,
                                              Run& run,
                                              const std::optional<libmap::CameraFile>& camera) {
  const std::string& path = scans.front();
  auto scan = run.timed("open", [&] { return libmap::open_scans({scans.begin(), scans.end()}); });
  for (const std::string& warning : scan->warnings()) {
    if (strict && !libmap::is_about_unknown_part(warning))
      throw libmap::Error(warning).in_file(path);
    run.warn("{}: {}", path, warning);
  }
  if (scan->graph().nodes.empty())
    throw libmap::Error("the scan has no nodes: nothing was recorded, or recording was interrupted",
                        {.file = path});
  return camera ? libmap::with_calibration(std::move(scan), *camera) : std::move(scan);
}

libmap::Trajectory find_poses(const libmap::ScanSource& scan, PosesOption& poses, bool strict,
                              Run& run) {
  const std::string path = scan.path().string();
  if (poses.source == "auto") {
    poses.source = best_poses(scan.graph(), path);
    run.info("poses: " + poses.source);
  } else if (const auto source = source_named(poses.source)) {
    poses.source = to_text(*source);
  }
  libmap::Trajectory found = wanted_poses(scan, poses, run);
  report_nodes_without_pose(path, poses.source, scan.graph(), found, strict, run);
  if (poses.source == to_text(PoseSource::odometry))
    report_sessions(path, scan.graph(), found, run);
  run.manifest().parameters.emplace_back("poses", poses.source);
  return found;
}

bool are_refined(const PosesOption& poses) {
  if (poses.source == "auto" || source_named(poses.source)) return false;
  const std::optional<libmap::Manifest> made = libmap::read_manifest_of(poses.source);
  return made && made->command == "refine";
}

libmap::Trajectory require_truth(const libmap::ScanSource& scan) {
  libmap::Trajectory truth = libmap::trajectory_of(scan.graph(), PoseSource::ground_truth);
  if (truth.empty())
    throw libmap::Error(
        "the scan has no ground truth",
        {.file = scan.path().string(), .field = "--frame", .value = "ground-truth"});
  return truth;
}

libmap::Pose truth_from_poses(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                              const PosesOption& taken, Run& run) {
  const std::string path = scan.path().string();
  const libmap::Trajectory truth = require_truth(scan);
  if (taken.source == to_text(PoseSource::ground_truth)) {
    run.manifest().transforms.emplace_back(truth_from_poses_name, libmap::Pose::Identity());
    return libmap::Pose::Identity();
  }
  const libmap::AbsoluteTrajectoryError error =
      in_file(path, [&] { return libmap::absolute_trajectory_error(poses, truth); });
  run.info("aligned with {} true poses: RMSE {:.1f} mm, {:.2f} deg", error.poses,
           1e3 * error.rmse_m, error.mean_rotation_deg);
  run.add_results({{"trajectory_rmse_m", error.rmse_m}});
  run.manifest().transforms.emplace_back(truth_from_poses_name, error.truth_from_estimate);
  return error.truth_from_estimate;
}

}  // namespace graspmap_tools
