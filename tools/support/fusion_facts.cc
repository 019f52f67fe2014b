#include "tools/support/fusion_facts.h"

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace graspmap_tools {

namespace {

std::array<double, 3> numbers_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Eigen::Vector3d vector_of(const nlohmann::json& json) {
  const auto numbers = json.get<std::array<double, 3>>();
  return Eigen::Vector3d(numbers.data());
}

// use(name, count) for each of them.
template <typename Counts, typename Use>
void each_count(Counts& counts, const Use& use) {
  use("pixels", counts.pixels.pixels);
  use("used", counts.pixels.used);
  use("unmeasured", counts.pixels.unmeasured);
  use("out_of_range", counts.pixels.out_of_range);
  use("without_ray", counts.pixels.without_ray);
  use("flying", counts.pixels.flying);
  use("grazing", counts.pixels.grazing);
  use("occupied_voxels", counts.occupied_voxels);
  use("elements", counts.elements);
  use("unconfirmed", counts.points.unconfirmed);
  use("seen_through", counts.points.seen_through);
  use("missed", counts.points.missed);
  use("beside", counts.points.beside);
  use("bent_away", counts.points.bent_away);
  use("merged", counts.points.merged);
  use("extended_points", counts.points.extended_points);
  use("max_views", counts.points.max_views);
  use("points_made", counts.points_made);
}

}  // namespace

nlohmann::json facts_of(const libmap::FusionSurvey& survey) {
  nlohmann::json frames = nlohmann::json::array();
  for (const libmap::FusionFrame& frame : survey.frames) {
    const Eigen::Matrix4d& pose = frame.grid_from_base.matrix();
    frames.push_back({{"node", frame.node},
                      {"grid_from_base", std::vector<double>(pose.data(), pose.data() + 16)},
                      {"image_pixels", frame.image_pixels},
                      {"reach_min_m", numbers_of(frame.reach.min())},
                      {"reach_max_m", numbers_of(frame.reach.max())},
                      {"max_ray_length", frame.max_ray_length},
                      {"max_pixel_pitch", frame.max_pixel_pitch}});
  }
  nlohmann::json skipped = nlohmann::json::array();
  for (const auto& [node, fault] : survey.skipped) skipped.push_back({node, fault.what()});
  return {{"grid_origin_m", numbers_of(survey.grid_origin)},
          {"frames", frames},
          {"skipped", skipped},
          {"registration_rounds", survey.registration_rounds},
          {"disagreement_before_m", survey.disagreement_before_m},
          {"disagreement_after_m", survey.disagreement_after_m}};
}

libmap::FusionSurvey fusion_survey_of(const nlohmann::json& facts) {
  libmap::FusionSurvey survey;
  survey.grid_origin = vector_of(facts.at("grid_origin_m"));
  for (const nlohmann::json& its : facts.at("frames")) {
    libmap::FusionFrame& frame = survey.frames.emplace_back();
    its.at("node").get_to(frame.node);
    const auto pose = its.at("grid_from_base").get<std::array<double, 16>>();
    frame.grid_from_base.matrix() = Eigen::Map<const Eigen::Matrix4d>(pose.data());
    its.at("image_pixels").get_to(frame.image_pixels);
    frame.reach = {vector_of(its.at("reach_min_m")), vector_of(its.at("reach_max_m"))};
    its.at("max_ray_length").get_to(frame.max_ray_length);
    its.at("max_pixel_pitch").get_to(frame.max_pixel_pitch);
  }
  for (const auto& [node, fault] :
       facts.at("skipped").get<std::vector<std::pair<int, std::string>>>())
    survey.skipped.emplace_back(node, libmap::Error(fault));
  facts.at("registration_rounds").get_to(survey.registration_rounds);
  facts.at("disagreement_before_m").get_to(survey.disagreement_before_m);
  facts.at("disagreement_after_m").get_to(survey.disagreement_after_m);
  return survey;
}

nlohmann::json facts_of(const libmap::FusionCounts& counts) {
  nlohmann::json facts;
  each_count(counts, [&](const char* name, auto value) { facts[name] = value; });
  return facts;
}

libmap::FusionCounts fusion_counts_of(const nlohmann::json& facts) {
  libmap::FusionCounts counts;
  each_count(counts, [&](const char* name, auto& value) { facts.at(name).get_to(value); });
  return counts;
}

}  // namespace graspmap_tools
