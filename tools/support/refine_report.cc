#include "tools/support/refine_report.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "tools/support/results.h"

namespace graspmap_tools {

namespace {

using Json = nlohmann::ordered_json;

constexpr double degrees = 180.0 / M_PI;

template <typename Items, typename JsonOf>
Json array_of(const Items& items, const JsonOf& json_of) {
  Json array = Json::array();
  for (const auto& item : items) array.push_back(json_of(item));
  return array;
}

// Numbers of pairs of frames without a link by reason, with the names of both kinds of report.
std::vector<std::pair<const char*, std::size_t>> rejections_of(
    const libmap::RejectionCounts& counts) {
  return {{"too_few_matches", counts.too_few_matches}, {"too_few_inliers", counts.too_few_inliers},
          {"degenerate", counts.degenerate},           {"not_converged", counts.not_converged},
          {"against_graph", counts.against_graph},     {"unconfirmed", counts.unconfirmed}};
}

Json rejections_json(const libmap::RejectionCounts& counts) {
  Json json = {{"candidates", counts.candidates}, {"accepted", counts.accepted}};
  for (const auto& [reason, count] : rejections_of(counts)) json[reason] = count;
  return json;
}

Json groups_json(const std::map<std::string, libmap::LinkGroupResult>& groups) {
  Json json = Json::object();
  for (const auto& [name, group] : groups)
    json[name] = {{"links", group.links},
                  {"rejected", group.rejected},
                  {"translation_deviation_scale", group.translation_scale},
                  {"rotation_deviation_scale", group.rotation_scale},
                  {"redundancy", group.redundancy},
                  {"translation_rms_before_m", group.translation_rms_before_m},
                  {"rotation_rms_before_deg", group.rotation_rms_before_deg},
                  {"translation_rms_m", group.translation_rms_m},
                  {"rotation_rms_deg", group.rotation_rms_deg}};
  return json;
}

Json held_out_json(const libmap::HeldOutEvaluation& held_out) {
  const auto part = [](const libmap::HeldOutChange& change) -> Json {
    return {{"count", change.count},
            {"cost_before", change.before},
            {"cost_after", change.after},
            {"deviation_of_change", change.deviation}};
  };
  return {{"matches", part(held_out.matches)},
          {"surfaces", part(held_out.surfaces)},
          {"change", held_out.change()},
          {"deviation_of_change", held_out.deviation()}};
}

Json stage_json(const libmap::StageReport& stage) {
  Json json = {{"stage", stage.name}, {"rejected", stage.rejected}};
  if (stage.closures.candidates > 0) json["closures"] = rejections_json(stage.closures);
  if (stage.held_out.any()) json["held_out"] = held_out_json(stage.held_out);
  if (!stage.groups.empty()) json["links"] = groups_json(stage.groups);
  for (const auto& [name, value] : stage.metrics) json[name] = value;
  if (stage.error) {
    json["absolute_error"] = to_json(libmap::described(stage.error->absolute));
    json["relative_error"] = to_json(libmap::described(stage.error->relative));
  }
  if (stage.rejected_error)
    json["absolute_error_given_up"] = to_json(libmap::described(stage.rejected_error->absolute));
  return json;
}

// Standard deviations of a node relative to its part's gauge node.
Json node_json(int node, const libmap::Matrix6d& covariance) {
  Json rows = Json::array();
  for (int row = 0; row < 6; ++row)
    rows.push_back(std::vector<double>(covariance.row(row).begin(), covariance.row(row).end()));
  return {
      {"node", node},
      {"deviation_m", std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0)},
      {"deviation_deg", std::sqrt(covariance.bottomRightCorner<3, 3>().trace() / 3.0) * degrees},
      {"covariance", rows}};
}

std::string numbers_text(const std::vector<int>& numbers) {
  return numbers.empty() ? " none" : fmt::format(" {}", fmt::join(numbers, " "));
}

void add_held_out(const libmap::StageReport& stage, std::string& text) {
  const auto out = std::back_inserter(text);
  const auto line = [&](const char* what, const libmap::HeldOutChange& change) {
    if (change.count > 0)
      fmt::format_to(out, "  held-out {}: cost {:.5f} -> {:.5f}, +- {:.5f}, of {}\n", what,
                     change.before, change.after, change.deviation, change.count);
  };
  line("matches", stage.held_out.matches);
  line("surfaces", stage.held_out.surfaces);
  if (stage.held_out.any())
    fmt::format_to(out, "  together: {:+.6f}, +- {:.6f}\n", stage.held_out.change(),
                   stage.held_out.deviation());
}

void add_errors(const libmap::StageReport& stage, std::string& text) {
  const auto out = std::back_inserter(text);
  const auto line = [&](const char* what, const libmap::TrajectoryError& error) {
    fmt::format_to(out,
                   "  {} error: rmse {:.3f} mm, median {:.3f}, max {:.3f}; rotation mean {:.4f} "
                   "deg, max {:.4f}\n",
                   what, 1e3 * error.rmse_m, 1e3 * error.median_m, 1e3 * error.max_m,
                   error.mean_rotation_deg, error.max_rotation_deg);
  };
  if (stage.error) {
    line("absolute", stage.error->absolute);
    line("relative", stage.error->relative);
  }
  if (stage.rejected_error) line("rejected: absolute", stage.rejected_error->absolute);
}

void add_stage(const libmap::StageReport& stage, std::string& text) {
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{}{}\n", stage.name, stage.rejected ? ": rejected" : "");
  if (stage.closures.candidates > 0) {
    fmt::format_to(out, "  pairs: {} tried, {} linked", stage.closures.candidates,
                   stage.closures.accepted);
    for (const auto& [reason, count] : rejections_of(stage.closures))
      if (count > 0) fmt::format_to(out, ", {} {}", count, reason);
    fmt::format_to(out, "\n");
  }
  for (const auto& [name, group] : stage.groups)
    fmt::format_to(out,
                   "  links of {}: {}, {} rejected; residuals {:.2f} mm {:.3f} deg -> {:.2f} mm "
                   "{:.3f} deg; stated deviations x {:.3g} and x {:.3g}\n",
                   name, group.links, group.rejected, 1e3 * group.translation_rms_before_m,
                   group.rotation_rms_before_deg, 1e3 * group.translation_rms_m,
                   group.rotation_rms_deg, group.translation_scale, group.rotation_scale);
  for (const auto& [name, value] : stage.metrics)
    fmt::format_to(out, "  {}: {:.6g}\n", name, value);
  add_held_out(stage, text);
  add_errors(stage, text);
}

}  // namespace

std::string refinement_json(const std::string& scan, const libmap::RefinementResult& result) {
  const Json parts = array_of(result.components, [](const auto& part) -> Json {
    return {{"nodes", part.nodes.size()}, {"gauge_node", part.gauge_node}};
  });
  const Json losses = array_of(result.losses, [](const auto& loss) -> Json {
    return {{"node", loss.node},
            {"key_frame", loss.key_frame},
            {"reason", loss.reason},
            {"found_node", loss.relocalized_node},
            {"found_at", loss.relocalized_at}};
  });
  const Json skipped = array_of(result.skipped, [](const auto& frame) -> Json {
    return {{"node", frame.first}, {"reason", frame.second.what()}};
  });
  const Json rejected = array_of(result.rejected_links, [](const auto& link) -> Json {
    return {{"from", link.from}, {"to", link.to}, {"type", to_text(link.type)}};
  });
  const Json nodes = array_of(result.covariance, [](const auto& of_node) {
    return node_json(of_node.first, of_node.second);
  });
  const Json json = {{"scan", scan},
                     {"poses", result.poses.size()},
                     {"links", result.links.size()},
                     {"closures_found", result.closures.size()},
                     {"stages", array_of(result.stages, stage_json)},
                     {"parts", parts},
                     {"nodes_without_links", result.without_links},
                     {"nodes_without_pose", result.without_pose},
                     {"nodes_lost_by_odometry", losses},
                     {"frames_skipped", skipped},
                     {"stored_links_rejected", rejected},
                     {"sensor", result.findings},
                     {"scale", result.scale},
                     {"warnings", result.warnings},
                     {"nodes", nodes}};
  return json.dump(2) + "\n";
}

std::string refinement_text(const std::string& scan, const libmap::RefinementResult& result) {
  std::string text = fmt::format("{}: {} poses, {} links, of which {} were found\n\n", scan,
                                 result.poses.size(), result.links.size(), result.closures.size());
  const auto out = std::back_inserter(text);
  for (const libmap::StageReport& stage : result.stages) add_stage(stage, text);
  fmt::format_to(out, "\n");
  for (const libmap::GraphComponent& part : result.components)
    fmt::format_to(out, "part of {} nodes, relative to node {}\n", part.nodes.size(),
                   part.gauge_node);
  fmt::format_to(out, "nodes without links:{}\nnodes without pose:{}\n",
                 numbers_text(result.without_links), numbers_text(result.without_pose));
  for (const auto& [node, fault] : result.skipped)
    fmt::format_to(out, "node {} skipped: {}\n", node, fault.what());
  for (const libmap::TrackingLoss& loss : result.losses)
    fmt::format_to(out, "odometry lost at node {}: {}\n", loss.node, loss.reason);
  for (const libmap::PoseLink& link : result.rejected_links)
    fmt::format_to(out, "stored link {} -> {} rejected: {}\n", link.from, link.to,
                   to_text(link.type));
  for (const std::string& finding : result.findings) fmt::format_to(out, "sensor: {}\n", finding);
  fmt::format_to(out, "{}\n", result.scale);
  for (const std::string& warning : result.warnings) fmt::format_to(out, "warning: {}\n", warning);
  fmt::format_to(
      out,
      "\nstandard deviations of each pose relative to its part's fixed node, in its own axes\n"
      "  node     x mm     y mm     z mm    x deg    y deg    z deg\n");
  for (const auto& [node, covariance] : result.covariance) {
    fmt::format_to(out, "{:6}", node);
    for (int n = 0; n < 6; ++n)
      fmt::format_to(out, " {:8.4f}", std::sqrt(covariance(n, n)) * (n < 3 ? 1e3 : degrees));
    fmt::format_to(out, "\n");
  }
  return text;
}

}  // namespace graspmap_tools
