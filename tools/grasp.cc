// graspmap grasp: the virtual field test of a gripper at listed locations of a mesh.
#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/grasp_table.h"
#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/grasp_scenes.h"
#include "tools/support/map_frame.h"

namespace {

using graspmap_tools::Run;

struct GraspCommandOptions {
  std::string mesh;
  std::string points;
  std::string output;
  graspmap_tools::GraspScenesOptions scenes;
  std::string gripper = "scar-e";
  std::vector<std::pair<std::string, std::string>> overrides;
  libgtd::GraspOptions grasp;
  std::string more_loads;
  std::string prefix;
};

void bind(libmap::ParameterTable& table, GraspCommandOptions& options) {
  table.add("gripper", options.gripper, "scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  bind(table, options.grasp);
  table.add("more_loads", options.more_loads,
            "further loads with a verdict each, N, with commas between");
  table.add("prefix", options.prefix, "before the name of each column of the results");
}

// Of all that the results depend on but mesh, locations and seed.
std::string parameters_hash(const libgtd::Gripper& gripper, libgtd::GraspOptions options) {
  libgtd::Gripper measures = gripper;
  libgtd::GripperFingers fingers = *gripper.fingers;
  options.seed = 0;
  libmap::ParameterTable table;
  bind(table, measures);
  bind(table, fingers);
  bind(table, options);
  return libmap::sha256_of(to_yaml(table));
}

void note_results(const std::vector<libgtd::LocationResult>& results, Run& run) {
  std::int64_t holding = 0;
  double probability = 0.0;
  double unseen = 0.0;
  for (const libgtd::LocationResult& result : results) {
    holding += result.holds() ? 1 : 0;
    probability += result.hold_probability / static_cast<double>(results.size());
    unseen += result.unseen / static_cast<double>(results.size());
  }
  run.add_results({{"locations", results.size()},
                   {"holding", holding},
                   {"mean_hold_probability", probability},
                   {"mean_unseen", unseen}});
  run.say(
      "{} of {} locations hold; mean probability {:.2f}, {:.1f} % of the ground under the "
      "gripper unseen",
      holding, results.size(), probability, 100.0 * unseen);
}

void grasp(GraspCommandOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".csv")
    throw libmap::Error("results are written as .csv", {.file = options.output});
  run.claim_output(options.output, {options.mesh, options.points});
  for (const std::string& text : libmap::split_list(options.more_loads)) {
    const auto load = libmap::parse_double(text);
    if (!load || !(*load > 0.0))
      throw libmap::Error("is no load", {.field = "--more-loads", .value = text, .bound = "> 0"});
    options.grasp.more_loads_n.push_back(*load);
  }
  claim_scenes(options.scenes, run);
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = libgtd::read_gripper(file, options.overrides);
  if (!gripper.fingers)
    throw libmap::Error("missing: a gripper is closed by its fingers",
                        {.file = file.string(), .field = "fingers"});
  libmap::Table table = libmap::read_csv(options.points);
  const std::vector<Eigen::Vector3d> locations = graspmap_tools::positions_of(table);
  if (locations.empty()) throw libmap::Error("no locations", {.file = options.points});
  const auto scenes = graspmap_tools::scenes_of(table, options.scenes);
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.mesh).mesh;
  run.add_input(options.mesh);
  run.add_input(options.points);
  run.add_input(file);
  std::optional<libgtd::Ground> ground;
  std::vector<libgtd::LocationResult> results;
  try {
    ground.emplace(mesh);
    results = run.timed("grasp", [&] {
      return libgtd::test_grasps(*ground, gripper, locations, options.grasp, run.progress());
    });
  } catch (const libmap::Error& error) {
    const bool of_location = error.context().field.starts_with("location");
    throw error.in_file(of_location ? options.points : options.mesh);
  }
  for (const std::string& name : libgtd::grasp_columns(options.grasp.more_loads_n)) {
    const std::string column = options.prefix + name;
    if (table.find_column(column))
      throw libmap::Error("the locations have this column already",
                          {.file = options.points, .field = column});
    table.columns.push_back(column);
  }
  for (std::size_t row = 0; row < results.size(); ++row)
    for (std::string& cell : libgtd::grasp_cells(results[row]))
      table.rows[row].push_back(std::move(cell));
  run.add_results({{"parameters_sha256", parameters_hash(gripper, options.grasp)}});
  note_results(results, run);
  write_scenes(options.scenes, scenes, {mesh, *ground, gripper, options.grasp, results}, run);
  run.write_text(options.output, libmap::to_csv(table));
}

}  // namespace

int main(int argc, char** argv) {
  GraspCommandOptions options;
  graspmap_tools::Command command("grasp");
  command.input("MESH", options.mesh, "mesh of the terrain, z up");
  command.option("--points", "LOCATIONS.csv", options.points,
                 "CSV with the columns x, y, z in meters in the mesh's frame, and any others",
                 true);
  command.output(options.output, "CSV: the locations, each with the results of its trials");
  command.option("--scenes", "FOLDER", options.scenes.folder,
                 "pictures of one trial of each location, its force nearest to the median: "
                 "FOLDER/PLACE.ply, after the column 'place' or the row");
  command.option("--scene-of", "PLACES", options.scenes.places,
                 "the locations to draw; default: all");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { grasp(options, run); });
}
