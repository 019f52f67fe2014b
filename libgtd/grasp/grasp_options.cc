#include "libgtd/grasp/grasp_trials.h"
#include "libmap/core/error.h"

namespace libgtd {

void GraspOptions::check() const {
  libmap::check_parameters(*this);
  for (const double load : extra_loads_n)
    if (!(load > 0.0))
      throw libmap::Error(
          "out of range",
          {.field = "more_loads_n", .value = libmap::to_text(load), .bound = "> 0"});
}

void bind(libmap::ParameterTable& table, GraspOptions& options) {
  using libmap::not_negative;
  using libmap::positive;
  table.add("load_n", options.load_n, positive, "pull that the gripper must hold, N");
  table.add("safety", options.safety, positive, "safety factor by which the load is multiplied");
  table.add("approach", options.approach,
            {{"up", ApproachDirection::up}, {"normal", ApproachDirection::normal}},
            "approach direction; up: from above along z; normal: along the normal of the ground");
  table.add("trials", options.poses, {1, 100000}, "number of gripper poses at each location");
  table.add("draws", options.draws, {1, 100000}, "number of random asperity samples at each pose");
  table.add("best_draws", options.best_draws, {0, 100000},
            "number of asperity samples at each pose for which the holding force is also computed "
            "with the best load distribution over the spines");
  table.add("seed", options.seed, not_negative, "random seed");
  table.add("offset_m", options.offset_m, {0.0, 1.0},
            "standard deviation of the random offset of the palm from the location in x and y, m");
  table.add("tilt_deg", options.tilt_deg, {0.0, 15.0},
            "standard deviation of the random palm tilt about x and about y, degrees");
  table.add("max_distance_m", options.max_distance_m, positive,
            "maximum distance of a tested location from the mesh, m");
  table.add("ensemble", options.ensemble,
            "vary force parameters over the gripper's ensemble; false: values of the gripper file");
  bind(table, options.closing);
  bind(table, options.engagement);
  bind(table, options.surface);
}

const std::vector<std::pair<std::string, TrialOutcome>>& trial_outcome_names() {
  static const std::vector<std::pair<std::string, TrialOutcome>> names = {
      {"holds", TrialOutcome::holds},     {"approach", TrialOutcome::approach},
      {"contact", TrialOutcome::contact}, {"engagement", TrialOutcome::engagement},
      {"load", TrialOutcome::load},       {"unseen", TrialOutcome::unseen}};
  return names;
}

}  // namespace libgtd
