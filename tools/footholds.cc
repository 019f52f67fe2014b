// graspmap footholds: the best footholds of a map for a step planner.
#include "libgtd/score/footholds.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

using namespace graspmap_tools;

namespace {

// Options with fewer draws than `grasp` at listed locations, and with limits of all directions.
libgtd::GraspOptions foothold_grasp_options() {
  libgtd::GraspOptions options;
  options.draws = 8;
  options.best_draws = 0;
  options.pull_limits = true;
  return options;
}

struct FootholdTrialsOptions {
  std::string mesh;     // mesh of the terrain; empty: no test. Not bound
  std::string gripper;  // name or file; empty: from the map's manifest, else scar-e
  double min_probability = 0.5;
  libgtd::GraspOptions grasp = foothold_grasp_options();
};

std::string gripper_of(const FootholdTrialsOptions& options,
                       const std::optional<libmap::Manifest>& manifest) {
  if (!options.gripper.empty()) return options.gripper;
  const libmap::ManifestValue* value = manifest ? manifest->find_parameter("gripper") : nullptr;
  const std::string* name = value != nullptr ? std::get_if<std::string>(value) : nullptr;
  return name != nullptr ? *name : "scar-e";
}

// Drops footholds that are not on the mesh. Returns the positions of the others in its frame.
std::vector<Eigen::Vector3d> positions_on(const libgtd::Ground& ground,
                                          const libmap::Pose& mesh_from_map,
                                          const libmap::PointCloud& map, double max_distance_m,
                                          std::vector<libgtd::Foothold>& footholds) {
  std::vector<Eigen::Vector3d> positions;
  std::erase_if(footholds, [&](const libgtd::Foothold& foothold) {
    const Eigen::Vector3d position = mesh_from_map * map.positions[foothold.map_point];
    const bool is_on_mesh = ground.distance(position, max_distance_m).has_value();
    if (is_on_mesh) positions.push_back(position);
    return !is_on_mesh;
  });
  return positions;
}

void bind(libmap::ParameterTable& table, FootholdTrialsOptions& options) {
  table.add("gripper", options.gripper,
            "gripper of the test on --mesh: scar-e, hubrobo, limbero or a gripper file; default: "
            "gripper of the map");
  table.add("min_probability", options.min_probability, libmap::zero_to_one,
            "minimum probability that a foothold holds, by the test on --mesh");
  bind(table, options.grasp);
}

// Tests the footholds. Keeps at most `max_count` (0: all) of those in `result` with at least
// min_probability, sorted by hold_probability, then by holding_force_n, and returns their results
// in this order. Footholds that are not on the mesh are dropped with a warning. Throws Error for an
// invalid mesh or gripper, or if no foothold is on the mesh.
std::vector<libgtd::LocationResult> test_footholds(const FootholdTrialsOptions& options,
                                                   int max_count,
                                                   const std::optional<libmap::Manifest>& manifest,
                                                   const libmap::PointCloud& map,
                                                   libgtd::FootholdResult& result, Run& run) {
  const auto gripper_file = libmap::find_data_file("grippers", gripper_of(options, manifest));
  const libgtd::Gripper gripper = libgtd::read_gripper(gripper_file, {});
  in_file(gripper_file.string(), [&] { libgtd::require_fingers(gripper); });
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.mesh).mesh;
  run.add_input(options.mesh);
  for (const auto& input : libgtd::gripper_files(gripper_file)) run.add_input(input);
  const auto ground = in_file(options.mesh, [&] { return libgtd::Ground(mesh); });
  std::vector<libgtd::Foothold>& footholds = result.footholds;
  const std::size_t found = footholds.size();
  const std::vector<Eigen::Vector3d> positions = positions_on(
      ground, map_from_input(manifest).inverse(), map, options.grasp.max_distance_m, footholds);
  if (positions.empty() && found > 0)
    throw libmap::Error("no foothold is on the mesh; check the frames", {.file = options.mesh});
  if (positions.size() < found)
    run.warn("{}: {} of {} footholds are not on the mesh and are skipped", options.mesh,
             found - positions.size(), found);
  const std::vector<libgtd::LocationResult> trials = run.timed("grasp", [&] {
    return libgtd::test_grasps(ground, gripper, positions, options.grasp, run.progress());
  });
  std::vector<std::size_t> order(trials.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::erase_if(order, [&](std::size_t n) {
    return !(trials[n].hold_probability >= options.min_probability);
  });
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (trials[a].hold_probability != trials[b].hold_probability)
      return trials[a].hold_probability > trials[b].hold_probability;
    return trials[a].force_n[1] > trials[b].force_n[1];
  });
  run.add_results({{"footholds_tested", trials.size()}, {"footholds_holding", order.size()}});
  run.info("{} of {} footholds hold {} N with a probability of at least {}", order.size(),
           trials.size(), libmap::to_text(options.grasp.load_n),
           libmap::to_text(options.min_probability));
  if (max_count > 0 && order.size() > static_cast<std::size_t>(max_count))
    order.resize(static_cast<std::size_t>(max_count));
  std::vector<libgtd::Foothold> holding;
  std::vector<libgtd::LocationResult> of_holding;
  for (const std::size_t n : order) {
    holding.push_back(footholds[n]);
    of_holding.push_back(trials[n]);
  }
  footholds = std::move(holding);
  return of_holding;
}

// Adds hold_probability, hold_low, hold_high, holding_force_n, holding_force_low_n and
// holding_force_high_n (quantiles 0.5, 0.05 and 0.95 of the force in the trials' weakest
// direction), trial_spread, parameter_spread, and for each direction pull_away_n, pull_45_0_n, ...,
// pull_90_315_n (force that nine of ten trials hold). Adds nothing without results.
void add_trial_fields(const std::vector<libgtd::LocationResult>& trials,
                      libmap::PointCloud& footholds) {
  if (trials.empty()) return;
  const auto add = [&](const std::string& name, const auto& value_of) {
    libmap::ScalarField* field = footholds.find_field(name);
    std::vector<double>& values =
        field != nullptr ? field->values
                         : footholds.add_field(name, libmap::ScalarType::float32).values;
    for (std::size_t n = 0; n < values.size(); ++n) values[n] = value_of(trials[n]);
  };
  using Result = libgtd::LocationResult;
  add("hold_probability", [](const Result& r) { return r.hold_probability; });
  add("hold_low", [](const Result& r) { return r.hold_low; });
  add("hold_high", [](const Result& r) { return r.hold_high; });
  add("holding_force_n", [](const Result& r) { return r.force_n[1]; });
  add("holding_force_low_n", [](const Result& r) { return r.force_range_n[0]; });
  add("holding_force_high_n", [](const Result& r) { return r.force_range_n[1]; });
  add("trial_spread", [](const Result& r) { return r.trial_spread; });
  add("parameter_spread", [](const Result& r) { return r.parameter_spread; });
  for (std::size_t d = 0; d < libgtd::pull_directions().size(); ++d) {
    std::string name = libgtd::pull_directions()[d].name();
    std::replace(name.begin(), name.end(), '@', '_');
    add("pull_" + name + "_n", [d](const Result& r) { return r.pull_limits_n[d]; });
  }
}

struct FootholdsCommandOptions {
  std::string map;
  std::string output;
  libgtd::FootholdOptions footholds;
  FootholdTrialsOptions trials;
};

void bind(libmap::ParameterTable& table, FootholdsCommandOptions& options) {
  bind(table, options.footholds);
  bind(table, options.trials);
}

libgtd::FootholdResult search(const FootholdsCommandOptions& options, const libmap::PointCloud& map,
                              const std::optional<libmap::Manifest>& manifest, Run& run) {
  libgtd::FootholdOptions wanted = options.footholds;
  // All footholds are tested, because some of the best may not hold.
  if (!options.trials.mesh.empty()) wanted.max_count = 0;
  return in_file(options.map, [&] {
    return run.timed("footholds", [&] {
      return libgtd::find_footholds(map, wanted, {.up = up_of_map(manifest)});
    });
  });
}

void find_footholds(const FootholdsCommandOptions& options, Run& run) {
  if (options.trials.mesh.empty()) reject_changed(options.trials, &bind, "requires --mesh");
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.map, options.trials.mesh});
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  const std::optional<libmap::Manifest> manifest = libmap::read_manifest_of(options.map);
  libgtd::FootholdResult result = search(options, map, manifest, run);
  if (manifest) {
    run.manifest().frame = manifest->frame;
    run.manifest().transforms = manifest->transforms;
  } else {
    run.warn(options.map + ": has no manifest; up is assumed to be the z axis");
  }
  run.add_input(options.map);
  run.add_results(libmap::described(result));
  std::vector<libgtd::LocationResult> trials;
  if (!options.trials.mesh.empty() && !run.options().dry_run)
    trials =
        test_footholds(options.trials, options.footholds.max_count, manifest, map, result, run);
  run.add_results({{"footholds", result.footholds.size()}});
  run.info("{} footholds of {} candidate voxels", result.footholds.size(), result.candidates);
  if (result.candidates == 0)
    run.warn("{}: no voxel is a candidate{}", options.map,
             result.at_border == 0
                 ? ""
                 : fmt::format("; {} at the border of the scan were skipped (--border)",
                               result.at_border));
  libmap::PointCloud cloud = libgtd::to_cloud(result, map);
  add_trial_fields(trials, cloud);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  FootholdsCommandOptions options;
  Command command("footholds");
  command.input("MAP", options.map, "graspability map");
  command.output(options.output,
                 "footholds, best first, with normals and directions of approach (.csv, .vtp, "
                 ".pcd, .ply)");
  command.option("--mesh", "MESH", options.trials.mesh,
                 "mesh of the terrain, on which each foothold is tested as by `graspmap grasp`; "
                 "footholds that do not hold are dropped");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { find_footholds(options, run); });
}
