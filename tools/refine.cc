// graspmap refine: poses of a scan by loop closures, pose graph, bundle adjustment and depth.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/poses/refinement.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/rtabmap_writer.h"
#include "tools/command_line.h"
#include "tools/scan_poses.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;
using Json = nlohmann::ordered_json;

struct RefineOptions {
  std::string scan;
  std::string output;
  std::string links;
  std::string database;
  std::string report;
  bool nodes = false;
  bool strict = false;
  libmap::RefinementOptions refinement;
};

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json rejections_json(const libmap::RejectionCounts& counts) {
  return {{"candidates", counts.candidates},
          {"accepted", counts.accepted},
          {"too_few_matches", counts.too_few_matches},
          {"too_few_inliers", counts.too_few_inliers},
          {"narrow", counts.narrow},
          {"not_converged", counts.not_converged},
          {"against_graph", counts.against_graph},
          {"unconfirmed", counts.unconfirmed}};
}

Json groups_json(const std::map<std::string, libmap::LinkGroupResult>& groups) {
  Json json = Json::object();
  for (const auto& [name, group] : groups)
    json[name] = {{"links", group.links},
                  {"rejected", group.rejected},
                  {"translation_deviation_scale", group.translation_scale},
                  {"rotation_deviation_scale", group.rotation_scale},
                  {"redundancy", group.redundancy},
                  {"translation_rms_m", group.translation_rms_m},
                  {"rotation_rms_deg", group.rotation_rms_deg}};
  return json;
}

Json error_json(const libmap::TrajectoryError& error) {
  return {{"poses", error.poses},
          {"rmse_m", error.rmse_m},
          {"median_m", error.median_m},
          {"max_m", error.max_m},
          {"mean_rotation_deg", error.mean_rotation_deg},
          {"max_rotation_deg", error.max_rotation_deg}};
}

Json stage_json(const libmap::StageReport& stage) {
  Json json = {{"stage", stage.name}, {"undone", stage.undone}};
  if (stage.closures.candidates > 0) json["closures"] = rejections_json(stage.closures);
  if (stage.held_out.matches > 0)
    json["held_out"] = {{"matches", stage.held_out.matches},
                        {"cost_before", stage.held_out.before},
                        {"cost_after", stage.held_out.after},
                        {"deviation_of_change", stage.held_out.deviation}};
  if (!stage.groups.empty()) json["links"] = groups_json(stage.groups);
  for (const auto& [name, value] : stage.figures) json[name] = number(value);
  if (stage.error) {
    json["absolute_error"] = error_json(stage.error->absolute);
    json["relative_error"] = error_json(stage.error->relative);
  }
  if (stage.undone_error)
    json["absolute_error_given_up"] = error_json(stage.undone_error->absolute);
  return json;
}

Json link_json(const libmap::PoseLink& link) {
  return {{"from", link.from}, {"to", link.to}, {"type", to_text(link.type)}};
}

// Standard deviations of each node against its part's gauge node.
Json nodes_json(const libmap::RefinementResult& result) {
  Json json = Json::array();
  for (const auto& [node, covariance] : result.covariance) {
    Json rows = Json::array();
    for (int row = 0; row < 6; ++row) {
      Json values = Json::array();
      for (int column = 0; column < 6; ++column) values.push_back(covariance(row, column));
      rows.push_back(values);
    }
    json.push_back({{"node", node},
                    {"deviation_m", std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0)},
                    {"deviation_deg",
                     std::sqrt(covariance.bottomRightCorner<3, 3>().trace() / 3.0) * 180.0 / M_PI},
                    {"covariance", rows}});
  }
  return json;
}

std::string report_text(const RefineOptions& options, const libmap::RefinementResult& result) {
  Json stages = Json::array();
  for (const libmap::StageReport& stage : result.stages) stages.push_back(stage_json(stage));
  Json parts = Json::array();
  for (const libmap::GraphComponent& part : result.components)
    parts.push_back({{"nodes", part.nodes.size()}, {"gauge_node", part.gauge_node}});
  Json rejected = Json::array();
  for (const libmap::PoseLink& link : result.rejected_links) rejected.push_back(link_json(link));
  Json skipped = Json::array();
  for (const auto& [node, reason] : result.skipped)
    skipped.push_back({{"node", node}, {"reason", reason}});
  const Json json = {{"scan", options.scan},
                     {"poses", result.poses.size()},
                     {"links", result.links.size()},
                     {"closures_found", result.closures.size()},
                     {"stages", stages},
                     {"parts", parts},
                     {"nodes_without_links", result.without_links},
                     {"nodes_without_pose", result.without_pose},
                     {"frames_skipped", skipped},
                     {"stored_links_rejected", rejected},
                     {"warnings", result.warnings},
                     {"nodes", nodes_json(result)}};
  return json.dump(2) + "\n";
}

void say_stage(const libmap::StageReport& stage, Run& run) {
  std::string text = stage.name;
  if (stage.closures.candidates > 0)
    text +=
        fmt::format(": {} of {} pairs linked", stage.closures.accepted, stage.closures.candidates);
  if (stage.held_out.matches > 0)
    text += fmt::format(", held-out cost {:.4f} -> {:.4f}", stage.held_out.before,
                        stage.held_out.after);
  if (stage.undone)
    text += stage.held_out.is_worse() ? ", which is worse: undone" : ", which is no better: undone";
  if (stage.error)
    text += fmt::format("; error {:.2f} mm, {:.3f} deg", 1e3 * stage.error->absolute.rmse_m,
                        stage.error->absolute.mean_rotation_deg);
  run.say(text);
  run.detail(fmt::format("{}: {:.2f} s", stage.name, stage.seconds));
  if (stage.undone_error)
    run.detail(fmt::format("  given up: {:.2f} mm, {:.3f} deg",
                           1e3 * stage.undone_error->absolute.rmse_m,
                           stage.undone_error->absolute.mean_rotation_deg));
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
  const auto count = [&](const char* name, std::size_t value) {
    manifest.results.emplace_back(name, static_cast<std::int64_t>(value));
  };
  count("poses", result.poses.size());
  count("links", result.links.size());
  count("closures_found", result.closures.size());
  count("parts", result.components.size());
  count("nodes_without_pose", result.without_pose.size());
  count("nodes_without_links", result.without_links.size());
  count("frames_skipped", result.skipped.size());
  count("features", result.features);
  std::size_t undone = 0;
  for (const libmap::StageReport& stage : result.stages) undone += stage.undone ? 1 : 0;
  count("stages_undone", undone);
  for (const libmap::StageReport& stage : result.stages)
    manifest.timings_s.emplace_back(stage.name, stage.seconds);
  if (result.stages.back().error) {
    manifest.results.emplace_back("trajectory_rmse_m", result.stages.back().error->absolute.rmse_m);
    manifest.results.emplace_back("trajectory_rotation_error_deg",
                                  result.stages.back().error->absolute.mean_rotation_deg);
  }
}

void write_outputs(const RefineOptions& options, const libmap::RefinementResult& result, Run& run) {
  if (!options.report.empty())
    run.write_output(options.report, [&](const auto& temporary) {
      libmap::write_text(temporary, report_text(options, result));
    });
  if (!options.links.empty())
    run.write_output(options.links, [&](const auto& temporary) {
      libmap::write_trajectory(temporary, {result.poses, result.links});
    });
  if (!options.database.empty())
    run.write_output(options.database, [&](const auto& temporary) {
      std::map<int, libmap::Pose> poses;
      for (const libmap::TrajectoryPose& pose : result.poses)
        poses.emplace(pose.node, pose.world_from_base);
      libmap::copy_with_optimized_poses(options.scan, temporary, poses, result.closures);
    });
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_trajectory(temporary, {result.poses, result.links}, options.nodes);
  });
}

void refine(const RefineOptions& options, Run& run) {
  libmap::require_trajectory_format(options.output);
  run.claim_output(options.output, {options.scan});
  if (!options.links.empty()) {
    if (fs::path(options.links).extension() != ".g2o")
      throw libmap::Error(
          "unknown format of links",
          {.file = {}, .field = "--links", .value = options.links, .bound = "a file .g2o"});
    run.claim_output(options.links, {options.scan});
  }
  if (!options.database.empty()) run.claim_output(options.database, {options.scan});
  if (!options.report.empty()) run.claim_output(options.report, {options.scan});
  const auto scan = graspmap_tools::open_scan(options.scan, options.strict, run);
  libmap::RefinementResult result;
  try {
    result = libmap::refine_poses(*scan, options.refinement, run.progress());
  } catch (const libmap::Error& error) {
    if (std::string_view(error.what()).starts_with(options.scan)) throw;
    throw error.in_file(options.scan);
  }
  for (const auto& [node, fault] : result.skipped)
    run.warn(fmt::format("no features: node {}: {}", node, fault));
  for (const std::string& warning : result.warnings) run.warn(options.scan + ": " + warning);
  for (const libmap::StageReport& stage : result.stages) say_stage(stage, run);
  run.say(fmt::format("{} poses, {} links, of which {} were found", result.poses.size(),
                      result.links.size(), result.closures.size()));
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  run.manifest().frame = "poses";
  add_results(result, run.manifest());
  write_outputs(options, result, run);
}

}  // namespace

int main(int argc, char** argv) {
  RefineOptions options;
  graspmap_tools::Command command(
      "refine", "Poses of a scan by loop closures, pose graph, bundle adjustment and depth.");
  command.input("SCAN", options.scan, "scan: a database of RTAB-Map, or a folder of images");
  command.output(options.output, "poses (.tum, .kitti, .g2o)");
  command.option("--links", "LINKS.g2o", options.links, "poses and links as a pose graph");
  command.option("--write-database", "OUT.db", options.database,
                 "a copy of the database with the refined poses and the links that were found");
  command.option("--report", "FILE.json", options.report,
                 "what each stage did, and how certain the poses are");
  command.flag("--nodes", options.nodes, "write the node's id as a ninth column of .tum");
  libmap::bind(command.parameters(), options.refinement);
  command.parameters().add("strict", options.strict,
                           "what the scan's file lacks is an error, not a warning");
  return command.run(argc, argv, [&](Run& run) { refine(options, run); });
}
