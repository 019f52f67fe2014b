// graspmap refine: poses of a scan by loop closures, pose graph, bundle adjustment and depth.
#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/refine/refinement.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/trajectory/trajectory_io.h"
#include "tools/support/command_line.h"
#include "tools/support/poses_output.h"
#include "tools/support/refine_report.h"
#include "tools/support/result_counts.h"
#include "tools/support/scan_poses.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;

struct RefineOptions {
  std::string scan;
  std::string output;
  std::string links;
  std::string database;
  std::vector<std::string> reports;
  std::string feature_cache;
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
                                      : ", which is no better: rejected";
  if (stage.error)
    text += fmt::format("; error {:.2f} mm, {:.3f} deg", 1e3 * stage.error->absolute.rmse_m,
                        stage.error->absolute.mean_rotation_deg);
  run.say(text);
  run.detail(fmt::format("{}: {:.2f} s", stage.name, stage.seconds));
  if (stage.rejected_error)
    run.detail(fmt::format("  given up: {:.2f} mm, {:.3f} deg",
                           1e3 * stage.rejected_error->absolute.rmse_m,
                           stage.rejected_error->absolute.mean_rotation_deg));
  for (const auto& [name, value] : stage.figures)
    run.detail(fmt::format("  {} {:.6g}", name, value));
  for (const auto& [name, group] : stage.groups)
    run.detail(
        fmt::format("  {}: {} links, {} rejected, deviations x {:.3g} and x {:.3g}, rms "
                    "{:.2f} mm {:.3f} deg",
                    name, group.links, group.rejected, group.translation_scale,
                    group.rotation_scale, 1e3 * group.translation_rms_m, group.rotation_rms_deg));
}

void add_results(const libmap::RefinementResult& result, libmap::Manifest& manifest) {
  const graspmap_tools::ResultCounts count(manifest);
  count("poses", result.poses.size());
  count("links", result.links.size());
  count("closures_found", result.closures.size());
  count("parts", result.components.size());
  count("nodes_without_pose", result.without_pose.size());
  count("nodes_without_links", result.without_links.size());
  count("frames_skipped", result.skipped.size());
  count("features", result.features);
  std::size_t rejected = 0;
  for (const libmap::StageReport& stage : result.stages) rejected += stage.rejected ? 1 : 0;
  count("stages_undone", rejected);
  for (const libmap::StageReport& stage : result.stages) {
    manifest.timings_s.emplace_back(stage.name, stage.seconds);
    manifest.timings_s.emplace_back(stage.name + ", processor", stage.processor_seconds);
  }
  if (result.stages.back().error) {
    manifest.results.emplace_back("trajectory_rmse_m", result.stages.back().error->absolute.rmse_m);
    manifest.results.emplace_back("trajectory_rotation_error_deg",
                                  result.stages.back().error->absolute.mean_rotation_deg);
  }
}

void write_outputs(const RefineOptions& options, const libmap::RefinementResult& result,
                   const libmap::ScanSource& scan, Run& run) {
  // First: a database whose rest is broken cannot be copied.
  if (!options.database.empty())
    run.write_output(options.database, [&](const auto& temporary) {
      std::map<int, libmap::Pose> poses;
      for (const libmap::TrajectoryPose& pose : result.poses)
        poses.emplace(pose.node, pose.world_from_base);
      libmap::copy_with_optimized_poses(options.scan, temporary, poses, result.closures);
    });
  for (const std::string& report : options.reports)
    run.write_output(report, [&](const auto& temporary) {
      libmap::write_text(temporary, fs::path(report).extension() == ".txt"
                                        ? graspmap_tools::refinement_text(options.scan, result)
                                        : graspmap_tools::refinement_json(options.scan, result));
    });
  if (!options.links.empty())
    run.write_output(options.links, [&](const auto& temporary) {
      libmap::write_trajectory(temporary, {result.poses, result.links});
    });
  graspmap_tools::write_poses_output(options.output, {result.poses, result.links}, scan,
                                     options.nodes, run);
}

// Beside the output, unless another folder or none is asked for.
libmap::FeatureCache feature_cache_of(const RefineOptions& options, const Run& run) {
  if (options.feature_cache == "off" || run.options().dry_run) return {};
  return libmap::FeatureCache(options.feature_cache.empty() ? options.output + ".features"
                                                            : options.feature_cache);
}

void refine(const RefineOptions& options, Run& run) {
  graspmap_tools::claim_poses_output(options.output, {options.scan}, run);
  if (!options.links.empty()) {
    if (fs::path(options.links).extension() != ".g2o")
      throw libmap::Error(
          "unknown format of links",
          {.file = {}, .field = "--links", .value = options.links, .bound = "a file .g2o"});
    run.claim_output(options.links, {options.scan});
  }
  if (!options.database.empty()) {
    if (fs::is_directory(options.scan))
      throw libmap::Error("a copy of a database, which the scan is not",
                          {.file = {},
                           .field = "--write-database",
                           .value = options.database,
                           .bound = "left out where SCAN is a folder"});
    run.claim_output(options.database, {options.scan});
  }
  for (const std::string& report : options.reports) {
    const fs::path extension = fs::path(report).extension();
    if (extension != ".json" && extension != ".txt")
      throw libmap::Error(
          "unknown format of reports",
          {.file = {}, .field = "--report", .value = report, .bound = "a file .json or .txt"});
    run.claim_output(report, {options.scan});
  }
  const auto scan = graspmap_tools::open_scan(options.scan, options.strict, run);
  libmap::RefinementResult result;
  try {
    result = libmap::refine_poses(*scan, options.refinement, run.progress(),
                                  feature_cache_of(options, run));
  } catch (const libmap::Error& error) {
    throw error.in_file(options.scan);
  }
  for (const auto& [node, fault] : result.skipped)
    run.warn(fmt::format("no features: node {}: {}", node, fault.what()));
  for (const std::string& warning : result.warnings) run.warn(options.scan + ": " + warning);
  for (const libmap::StageReport& stage : result.stages) say_stage(stage, run);
  run.say(fmt::format("{} poses, {} links, of which {} were found", result.poses.size(),
                      result.links.size(), result.closures.size()));
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  run.manifest().frame = "poses";
  add_results(result, run.manifest());
  write_outputs(options, result, *scan, run);
}

}  // namespace

int main(int argc, char** argv) {
  RefineOptions options;
  graspmap_tools::Command command("refine");
  command.input("SCAN", options.scan, "scan: a database of RTAB-Map, or a folder of images");
  command.output(options.output, "poses (.tum, .kitti, .g2o, .toro, or a folder .colmap)");
  command.option("--links", "LINKS.g2o", options.links, "poses and links as a pose graph");
  command.option("--write-database", "OUT.db", options.database,
                 "a copy of the database with the refined poses and the links that were found");
  command.option("--report", "FILE.json|FILE.txt", options.reports,
                 "what each stage did, and how certain the poses are");
  command.option("--feature-cache", "FOLDER|off", options.feature_cache,
                 "where features of frames are kept for the next run; else OUTPUT.features");
  command.flag("--nodes", options.nodes, "write the node's id as a ninth column of .tum");
  libmap::bind(command.parameters(), options.refinement);
  command.parameters().add("strict", options.strict,
                           "what the scan's file lacks is an error, not a warning");
  return command.run(argc, argv, [&](Run& run) {
    // Of a folder .colmap, beside which other files lie.
    while (options.output.size() > 1 && options.output.ends_with('/')) options.output.pop_back();
    refine(options, run);
  });
}
