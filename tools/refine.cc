// graspmap refine: refines poses by loop closures, pose graph, bundle adjustment and depth.
#include <malloc.h>

#include "libmap/poses/trajectory_io.h"
#include "libmap/refine/refinement.h"
#include "libmap/scan/colmap_builder.h"
#include "libmap/scan/image_export.h"
#include "libmap/scan/rtabmap_writer.h"
#include "tools/support/command_line.h"
#include "tools/support/refine_report.h"
#include "tools/support/scan_poses.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct RefineOptions {
  std::vector<std::string> scans;
  std::string output;
  std::string links;
  std::string database;
  std::vector<std::string> reports;
  std::string feature_cache;
  CalibrationOption calibration{.source = "stored"};
  std::string new_calibration;
  std::vector<std::string> known_lengths;
  std::string board;
  bool nodes = false;
  bool strict = false;
  libmap::RefinementOptions refinement;
};

void say_stage(const libmap::StageReport& stage, Run& run) {
  std::string text = stage.name;
  if (stage.closures.candidates > 0)
    text +=
        fmt::format(": {} of {} pairs linked", stage.closures.accepted, stage.closures.candidates);
  const auto add_cost = [&](const char* what, const libmap::HeldOutChange& change) {
    if (change.count > 0)
      text += fmt::format(", held-out {} {:.4f} -> {:.4f}", what, change.before, change.after);
  };
  add_cost("matches", stage.held_out.matches);
  add_cost("surfaces", stage.held_out.surfaces);
  if (stage.rejected)
    text += stage.held_out.is_worse() ? ", rejected (validation got worse)"
                                      : ", rejected (no improvement)";
  if (stage.error)
    text += fmt::format("; error {:.2f} mm, {:.3f} deg", 1e3 * stage.error->absolute.rmse_m,
                        stage.error->absolute.mean_rotation_deg);
  run.info(text);
  for (const std::string& warning : stage.warnings) run.info("{}: {}", stage.name, warning);
  run.detail("{}: {:.2f} s", stage.name, stage.seconds);
  if (stage.rejected_error)
    run.detail("  rejected: {:.2f} mm, {:.3f} deg", 1e3 * stage.rejected_error->absolute.rmse_m,
               stage.rejected_error->absolute.mean_rotation_deg);
  for (const auto& [name, value] : stage.metrics) run.detail("  {} {:.6g}", name, value);
  for (const auto& [name, group] : stage.groups)
    run.detail(
        "  {}: {} links, {} rejected, deviations x {:.3g} and x {:.3g}, rms {:.2f} mm {:.3f} deg",
        name, group.links, group.rejected, group.translation_scale, group.rotation_scale,
        1e3 * group.translation_rms_m, group.rotation_rms_deg);
}

void add_results(const libmap::RefinementResult& result, Run& run) {
  run.add_results(libmap::described(result));
  for (const libmap::StageReport& stage : result.stages) {
    run.manifest().timings_s.emplace_back(stage.name, stage.seconds);
    run.manifest().timings_s.emplace_back(stage.name + ", processor", stage.processor_seconds);
  }
}

const std::vector<std::string> model_names = {"cameras.txt", "images.txt", "points3D.txt"};

bool is_model(const std::string& path) { return fs::path(path).extension() == ".colmap"; }

libmap::ColmapModel model_of(const libmap::Trajectory& poses, const libmap::ScanSource& scan,
                             Run& run) {
  libmap::ColmapBuilder builder;
  for (const libmap::TrajectoryPose& pose : poses) {
    try {
      const std::vector<libmap::CameraView> views =
          libmap::read_views(scan, pose.node, {.color = true, .depth = false});
      for (std::size_t c = 0; c < views.size(); ++c)
        builder.add_image(libmap::image_file_of(scan, pose.node, views, c).name, views[c],
                          pose.world_from_base * views[c].color_camera.base_from_camera);
    } catch (const libmap::Error& error) {
      run.warn(std::string(error.what()) + "; the COLMAP model does not contain this pose");
    }
  }
  return builder.model();
}

void warn_of_lost_nodes(const std::string& path, const libmap::Trajectory& poses,
                        const libmap::PoseGraph& graph, Run& run) {
  const std::size_t nodes = count_valid_nodes(graph);
  if (fs::path(path).extension() != ".kitti" || poses.size() == nodes) return;
  run.warn(
      "{}: this format has no node ids, and only {} of {} nodes have a pose; only .tum, .g2o and "
      ".toro can be assigned to the scan again",
      path, poses.size(), nodes);
}

// Claims the output before the work: a file .tum, .kitti, .g2o or .toro, or NAME.colmap, a folder
// with a model of COLMAP without points.
void claim_poses_output(const std::string& path, const std::vector<std::string>& inputs, Run& run) {
  if (is_model(path)) return run.claim_output_tree(path, model_names, inputs);
  if (!libmap::is_trajectory_path(path))
    throw libmap::Error("unknown format of poses",
                        {.file = path,
                         .field = "extension",
                         .value = fs::path(path).extension().string(),
                         .bound = "one of .tum .kitti .g2o .toro .colmap"});
  run.claim_output(path, inputs);
}

// Writes the poses. A model of COLMAP has the scan's calibrations and the image names of `convert
// --colmap`; frames without an image or a calibration are skipped with a warning.
void write_poses_output(const std::string& path, const libmap::TrajectoryFile& poses,
                        const libmap::ScanSource& scan, bool nodes, Run& run) {
  if (is_model(path))
    return run.write_output_tree(path, model_names, [&](const fs::path& folder) {
      const libmap::ColmapModel model = model_of(poses.poses, scan, run);
      if (!folder.empty()) libmap::write_colmap_model(folder, model);
    });
  warn_of_lost_nodes(path, poses.poses, scan.graph(), run);
  run.write_output(
      path, [&](const auto& temporary) { libmap::write_trajectory(temporary, poses, nodes); });
}

void write_outputs(const RefineOptions& options, const libmap::RefinementResult& result,
                   const libmap::ScanSource& scan, const std::optional<libmap::CameraFile>& known,
                   Run& run) {
  // The database is first, because copying may fail for a broken one.
  if (!options.database.empty())
    run.write_output(options.database, [&](const auto& temporary) {
      std::map<int, libmap::Pose> poses;
      for (const libmap::TrajectoryPose& pose : result.poses)
        poses.emplace(pose.node, pose.world_from_base);
      std::optional<libmap::CameraFile> camera;
      if (!result.calibration.empty()) camera = libmap::refined_camera(result, scan);
      libmap::copy_with_optimized_poses(options.scans.front(), temporary, poses, result.closures,
                                        camera);
    });
  if (!options.new_calibration.empty())
    run.write_text(options.new_calibration, libmap::to_yaml(libmap::refined_camera(result, scan)));
  for (const std::string& report : options.reports)
    run.write_text(report, fs::path(report).extension() == ".txt"
                               ? refinement_text(options.scans.front(), result)
                               : refinement_json(options.scans.front(), result));
  if (!options.links.empty())
    run.write_output(options.links, [&](const auto& temporary) {
      libmap::write_trajectory(temporary, {result.poses, result.links});
    });
  if (known)
    add_camera(*known, run);
  else if (!result.calibration.empty() && result.cameras.size() == 1)
    add_camera(libmap::refined_camera(result, scan), run);
  write_poses_output(options.output, {result.poses, result.links}, scan, options.nodes, run);
}

// Feature cache: OUTPUT.features, or another folder or none by --feature-cache.
libmap::FeatureCache feature_cache_of(const RefineOptions& options, const Run& run) {
  if (options.feature_cache == "off" || run.options().dry_run) return {};
  return libmap::FeatureCache(options.feature_cache.empty() ? options.output + ".features"
                                                            : options.feature_cache);
}

struct ScanCounts {
  std::size_t nodes = 0;
  std::size_t poses = 0;
};
std::map<fs::path, ScanCounts> count_by_scan(const libmap::Trajectory& poses,
                                             const libmap::ScanSource& scan) {
  std::map<fs::path, ScanCounts> counts;
  for (const libmap::GraphNode& node : scan.graph().nodes)
    if (node.weight != libmap::GraphNode::invalid_weight)
      ++counts[scan.source_of(node.id).path].nodes;
  for (const libmap::TrajectoryPose& pose : poses) ++counts[scan.source_of(pose.node).path].poses;
  return counts;
}

// Reports the number of poses of each of several scans.
void say_scans(const libmap::RefinementResult& result, const libmap::ScanSource& scan, Run& run) {
  const auto counts = count_by_scan(result.poses, scan);
  if (counts.size() < 2) return;
  for (const auto& [path, count] : counts) {
    if (count.poses == 0)
      run.warn("{}: has no poses, because no link connects it to the other scans", path.string());
    else
      run.info("{}: {} of {} nodes have a pose", path.string(), count.poses, count.nodes);
  }
}

void claim_text(const std::string& flag, const std::string& what, const std::string& path,
                const std::vector<std::string>& extensions, const RefineOptions& options,
                Run& run) {
  if (std::find(extensions.begin(), extensions.end(), fs::path(path).extension()) ==
      extensions.end())
    throw libmap::Error("unknown format of " + what,
                        {.field = flag,
                         .value = path,
                         .bound = fmt::format("a file {}", fmt::join(extensions, " or "))});
  run.claim_output(path, options.scans);
}

void claim_database(const RefineOptions& options, Run& run) {
  const std::string& first = options.scans.front();
  const bool is_file = options.scans.size() == 1 && fs::is_regular_file(first);
  if (!is_file && fs::exists(first))
    throw libmap::Error("can only be used if SCAN is a single database",
                        {.field = "--write-database",
                         .value = options.database,
                         .bound = "omitted for a folder or several scans"});
  run.claim_output(options.database, options.scans);
}

// Claims the outputs before the work. Returns the camera of --calibration.
std::optional<libmap::CameraFile> claim_outputs(const RefineOptions& options, Run& run) {
  claim_poses_output(options.output, options.scans, run);
  if (!options.links.empty()) claim_text("--links", "links", options.links, {".g2o"}, options, run);
  if (!options.new_calibration.empty()) {
    std::vector<std::string> inputs = options.scans;
    inputs.push_back(options.calibration.source);
    run.claim_output(options.new_calibration, inputs);
  }
  auto camera = known_camera(options.calibration, options.scans.front(), {}, run);
  if (camera)
    reject_given({{"--write-calibration", !options.new_calibration.empty()},
                  {"--write-database", !options.database.empty()}},
                 "cannot be combined with --calibration: it starts from the stored camera");
  if (!options.database.empty()) claim_database(options, run);
  for (const std::string& report : options.reports)
    claim_text("--report", "reports", report, {".json", ".txt"}, options, run);
  return camera;
}

void say_result(const RefineOptions& options, const libmap::RefinementResult& result,
                bool with_known_camera, Run& run) {
  const std::string& first = options.scans.front();
  for (const auto& [node, fault] : result.skipped)
    run.warn("node {} has no features: {}", node, fault.what());
  for (const std::string& warning : result.warnings) run.warn(first + ": " + warning);
  for (const libmap::StageReport& stage : result.stages) say_stage(stage, run);
  for (const std::string& finding : result.findings) run.info(finding);
  if (!result.noise.empty()) run.detail("{}", result.noise);
  if (!result.calibration.empty() && (with_known_camera || result.cameras.size() > 1) &&
      options.database.empty())
    run.warn("{}: the estimated correction of the camera is not written: {}", first,
             with_known_camera ? "use --write-calibration without --calibration"
                               : "with several cameras, only --write-database stores it");
  const bool is_depth_scale = options.refinement.known_lengths.empty() &&
                              !options.refinement.board && options.refinement.scale == 1.0 &&
                              options.refinement.scale_from == libmap::ScaleSource::depth;
  if (is_depth_scale && result.findings.empty())
    run.detail("{}", result.scale);
  else
    run.info(result.scale);
  run.info("{} poses, {} links, of which {} were found", result.poses.size(), result.links.size(),
           result.closures.size());
}

void refine(RefineOptions& options, Run& run) {
  const auto camera = claim_outputs(options, run);
  const auto scan = open_scan(options.scans, options.strict, run, camera);
  // Nodes of several scans may have the same stamps.
  if (count_by_scan({}, *scan).size() > 1) options.refinement.one_map = options.nodes = true;
  const libmap::RefinementResult result = in_file(options.scans.front(), [&] {
    return libmap::refine_poses(*scan, options.refinement, run.progress(),
                                feature_cache_of(options, run));
  });
  say_result(options, result, camera.has_value(), run);
  say_scans(result, *scan, run);
  for (const std::string& path : options.scans)
    if (fs::is_regular_file(path)) run.add_input(path);
  run.manifest().frame = "poses";
  add_results(result, run);
  write_outputs(options, result, *scan, camera, run);
}

}  // namespace

int main(int argc, char** argv) {
  RefineOptions options;
  Command command("refine");
  command.inputs("SCAN", options.scans,
                 "scan: an RTAB-Map database, or a folder of images; several scans of overlapping "
                 "ground, or a folder of databases, are joined");
  command.output(options.output,
                 "refined poses (.tum, .kitti, .g2o, .toro, or a folder NAME.colmap)");
  command.option("--links", "LINKS.g2o", options.links, "output for the refined pose graph");
  command.option(
      "--write-database", "OUT.db", options.database,
      "output for a copy of the database with refined poses, found links, and corrected camera "
      "and depth");
  add_calibration_option(command, options.calibration);
  command.option("--write-calibration", "OUT.yaml", options.new_calibration,
                 "output for the estimated camera calibration, which --calibration reads");
  command.option("--known-length", "NODE:X:Y-NODE:X:Y=METERS", options.known_lengths,
                 "measured distance between two points, each at a pixel of a node's image; sets "
                 "the scale of the map; repeatable");
  command.option("--board", "COLUMNSxROWS:METERS", options.board,
                 "static chessboard in the scene, by inner corners and square side; sets the scale "
                 "of the map");
  command.option("--report", "FILE.json|FILE.txt", options.reports,
                 "output for a report on each stage and the standard deviations of the poses");
  command.option("--feature-cache", "FOLDER|off", options.feature_cache,
                 "folder in which image features are kept for later runs; off: none; default: "
                 "OUTPUT.features");
  command.flag("--nodes", options.nodes, "add the node id as a ninth column of a .tum output");
  libmap::bind(command.parameters(), options.refinement);
  command.parameters().add("strict", options.strict,
                           "fail if parts of the scan cannot be read, instead of warning");
  // Image pyramids are allocated for each frame. Returning them to the system costs 12 % of the
  // time of features.
  mallopt(M_TRIM_THRESHOLD, 1 << 28);
  mallopt(M_MMAP_THRESHOLD, 1 << 25);
  return command.run(argc, argv, [&](Run& run) {
    for (const std::string& text : options.known_lengths)
      options.refinement.known_lengths.push_back(libmap::parse_known_length(text));
    if (!options.board.empty()) options.refinement.board = libmap::parse_known_board(options.board);
    // A folder .colmap may be given with a slash.
    options.output = without_trailing_slash(options.output);
    refine(options, run);
  });
}
