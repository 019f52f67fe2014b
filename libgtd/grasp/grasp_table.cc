#include "libgtd/grasp/grasp_table.h"

#include "libmap/core/text.h"

namespace libgtd {

namespace {

struct Column {
  const char* name;
  std::string (*cell)(const LocationResult&);
};

std::string number(double value) { return libmap::to_text(static_cast<float>(value)); }

template <TrialOutcome outcome>
std::string fraction_of(const LocationResult& result) {
  return number(static_cast<double>(result.outcomes[static_cast<std::size_t>(outcome)]) /
                static_cast<double>(result.trials));
}

constexpr Column columns[] = {
    {"graspable", [](const LocationResult& r) { return std::string(r.holds() ? "1" : "0"); }},
    {"hold_probability", [](const LocationResult& r) { return number(r.hold_probability); }},
    {"hold_low", [](const LocationResult& r) { return number(r.hold_low); }},
    {"hold_high", [](const LocationResult& r) { return number(r.hold_high); }},
    {"force_p10_n", [](const LocationResult& r) { return number(r.force_n[0]); }},
    {"force_median_n", [](const LocationResult& r) { return number(r.force_n[1]); }},
    {"force_p90_n", [](const LocationResult& r) { return number(r.force_n[2]); }},
    {"force_p05_n", [](const LocationResult& r) { return number(r.force_range_n[0]); }},
    {"force_p95_n", [](const LocationResult& r) { return number(r.force_range_n[1]); }},
    {"trial_spread", [](const LocationResult& r) { return number(r.trial_spread); }},
    {"parameter_spread", [](const LocationResult& r) { return number(r.parameter_spread); }},
    {"best_force_p10_n", [](const LocationResult& r) { return number(r.best_force_n[0]); }},
    {"best_force_median_n", [](const LocationResult& r) { return number(r.best_force_n[1]); }},
    {"best_force_p90_n", [](const LocationResult& r) { return number(r.best_force_n[2]); }},
    {"limiting_direction",
     [](const LocationResult& r) { return pull_directions()[r.limiting_direction].name(); }},
    {"spine_fingers", [](const LocationResult& r) { return number(r.spine_fingers); }},
    {"link_fingers", [](const LocationResult& r) { return number(r.link_fingers); }},
    {"free_fingers", [](const LocationResult& r) { return number(r.free_fingers); }},
    {"palm_share", [](const LocationResult& r) { return number(r.palm_fraction); }},
    {"clearance_m", [](const LocationResult& r) { return number(r.clearance_m); }},
    {"unseen", [](const LocationResult& r) { return number(r.unseen); }},
    {"fails_approach", fraction_of<TrialOutcome::approach>},
    {"fails_contact", fraction_of<TrialOutcome::contact>},
    {"fails_engagement", fraction_of<TrialOutcome::engagement>},
    {"fails_load", fraction_of<TrialOutcome::load>},
    {"fails_unseen", fraction_of<TrialOutcome::unseen>},
    {"shown_pose", [](const LocationResult& r) { return std::to_string(r.median_pose); }},
    {"shown_draw", [](const LocationResult& r) { return std::to_string(r.median_draw); }},
};

}  // namespace

std::vector<std::string> grasp_columns(const std::vector<double>& extra_loads_n) {
  std::vector<std::string> names;
  for (const Column& column : columns) names.emplace_back(column.name);
  for (const double load : extra_loads_n)
    for (const char* name : {"graspable_", "hold_probability_"})
      names.push_back(name + libmap::to_text(load));
  return names;
}

std::vector<std::string> grasp_cells(const LocationResult& result) {
  std::vector<std::string> cells;
  for (const Column& column : columns) cells.push_back(column.cell(result));
  for (const double probability : result.extra_load_probabilities) {
    cells.emplace_back(probability >= 0.5 ? "1" : "0");
    cells.push_back(number(probability));
  }
  return cells;
}

}  // namespace libgtd
