// graspmap grasp: the virtual field test of a gripper at listed locations of a mesh.
#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/grasp_table.h"
#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/grasp/surface_error.h"
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
#include "tools/support/grasp_map.h"
#include "tools/support/grasp_scenes.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

namespace {

using graspmap_tools::Run;

enum class SequentialTest { automatic, on, off };

struct GraspCommandOptions {
  std::string mesh;
  std::string points;
  std::string map;
  std::string output;
  graspmap_tools::GraspScenesOptions scenes;
  std::string gripper = "scar-e";
  std::vector<std::pair<std::string, std::string>> overrides;
  libgtd::GraspOptions grasp;
  SequentialTest sequential = SequentialTest::automatic;
  int map_draws = 8;
  std::string more_loads;
  std::string prefix;
  std::string surface_error = "none";
  std::string tile = "1/1";
};

void bind(libmap::ParameterTable& table, GraspCommandOptions& options) {
  table.add("gripper", options.gripper, "scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  bind(table, options.grasp);
  table.add("surface_error", options.surface_error,
            "of the mesh: none; mesh, the field expected_error of its vertices; or a standard "
            "deviation, m");
  table.add("sequential", options.sequential,
            {{"auto", SequentialTest::automatic},
             {"on", SequentialTest::on},
             {"off", SequentialTest::off}},
            "a location's test ends as soon as its verdict is clear; auto: with --map");
  table.add("map_draws", options.map_draws, {1, 100000},
            "with --map: the draws of each pose, instead of 'draws'");
  table.add("more_loads", options.more_loads,
            "further loads with a verdict each, N, with commas between");
  table.add("prefix", options.prefix, "before the name of each column of the results");
}

// Of all that the results depend on but mesh, locations and seed.
std::string parameters_hash(const libgtd::Gripper& gripper, const GraspCommandOptions& command) {
  libgtd::GraspOptions options = command.grasp;
  libgtd::Gripper measures = gripper;
  libgtd::GripperFingers fingers = *gripper.fingers;
  options.seed = 0;
  libmap::ParameterTable table;
  bind(table, measures);
  bind(table, fingers);
  bind(table, options);
  return libmap::sha256_of(to_yaml(table) + (options.sequential ? "sequential" : "") +
                           command.surface_error);
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

libgtd::Gripper read_with_fingers(const std::filesystem::path& file,
                                  const GraspCommandOptions& options) {
  libgtd::Gripper gripper = libgtd::read_gripper(file, options.overrides);
  if (!gripper.fingers)
    throw libmap::Error("missing: a gripper is closed by its fingers",
                        {.file = file.string(), .field = "fingers"});
  return gripper;
}

libgtd::Ground ground_of(const libmap::TriangleMesh& mesh, const GraspCommandOptions& options) {
  const libgtd::SurfaceErrorOptions& bounds = options.grasp.surface;
  return graspmap_tools::in_file(options.mesh, [&] {
    if (options.surface_error == "none") return libgtd::Ground(mesh);
    if (options.surface_error == "mesh")
      return libgtd::Ground(mesh, libgtd::errors_of(mesh, bounds));
    const auto error_m = libmap::parse_double(options.surface_error);
    if (!error_m || !(*error_m >= 0.0 && *error_m <= bounds.max_error_m))
      throw libmap::Error("no error of a surface",
                          {.field = "--surface-error",
                           .value = options.surface_error,
                           .bound = "none, mesh, or 0 to --max-surface-error, m"});
    return libgtd::Ground(mesh, libgtd::constant_error(mesh, *error_m, bounds));
  });
}

void grasp_voxels(GraspCommandOptions& options, Run& run) {
  graspmap_tools::refuse_given({{"--scenes", !options.scenes.folder.empty()},
                                {"--scene-of", !options.scenes.places.empty()},
                                {"--more-loads", !options.more_loads.empty()},
                                {"--prefix", !options.prefix.empty()}},
                               "is for --points");
  graspmap_tools::GraspMapInput input{.mesh_file = options.mesh,
                                      .map_file = options.map,
                                      .output = options.output,
                                      .share = libmap::parse_share(options.tile),
                                      .parameters_hash = {}};
  require_map_output(input, run);
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = read_with_fingers(file, options);
  graspmap_tools::GroundPieces ground(
      options.mesh, gripper, options.grasp.closing.start_height_m,
      [&](const libmap::TriangleMesh& mesh) { return ground_of(mesh, options); });
  run.add_input(options.mesh);
  run.add_input(graspmap_tools::is_tile_store(options.map)
                    ? graspmap_tools::store_index_path(options.map).string()
                    : options.map);
  for (const auto& used : libgtd::gripper_files(file)) run.add_input(used);
  options.grasp.draws = options.map_draws;
  options.grasp.best_draws = 0;
  options.grasp.sequential = options.sequential != SequentialTest::off;
  input.parameters_hash = parameters_hash(gripper, options);
  run.add_results({{"parameters_sha256", input.parameters_hash}});
  options.grasp.check();
  grasp_map(input, ground, gripper, options.grasp, run);
}

void grasp_places(GraspCommandOptions& options, Run& run) {
  graspmap_tools::refuse_given({{"--tile", options.tile != GraspCommandOptions{}.tile}},
                               "is for --map");
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
  options.grasp.sequential = options.sequential == SequentialTest::on;
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = read_with_fingers(file, options);
  libmap::Table table = libmap::read_csv(options.points);
  const std::vector<Eigen::Vector3d> locations = graspmap_tools::positions_of(table);
  if (locations.empty()) throw libmap::Error("no locations", {.file = options.points});
  const auto scenes = graspmap_tools::scenes_of(table, options.scenes);
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.mesh).mesh;
  run.add_input(options.mesh);
  run.add_input(options.points);
  for (const auto& input : libgtd::gripper_files(file)) run.add_input(input);
  options.grasp.check();
  const libgtd::Ground ground = ground_of(mesh, options);
  std::vector<libgtd::LocationResult> results;
  try {
    results = run.timed("grasp", [&] {
      return libgtd::test_grasps(ground, gripper, locations, options.grasp, run.progress());
    });
  } catch (const libmap::Error& error) {
    throw error.in_file(options.points);
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
  run.add_results({{"parameters_sha256", parameters_hash(gripper, options)}});
  note_results(results, run);
  write_scenes(options.scenes, scenes, {mesh, ground, gripper, options.grasp, results}, run);
  run.write_text(options.output, libmap::to_csv(table));
}

void grasp(GraspCommandOptions& options, Run& run) {
  if (options.points.empty() == options.map.empty())
    throw graspmap_tools::UsageError(options.map.empty()
                                         ? "--points LOCATIONS.csv or --map MAP is missing"
                                         : "--points and --map exclude each other");
  options.map.empty() ? grasp_places(options, run) : grasp_voxels(options, run);
}

}  // namespace

int main(int argc, char** argv) {
  GraspCommandOptions options;
  graspmap_tools::Command command("grasp");
  command.input("MESH", options.mesh, "mesh or DEM (.tif) of the terrain, z up");
  command.option("--points", "LOCATIONS.csv", options.points,
                 "CSV with the columns x, y, z in meters in the mesh's frame, and any others");
  command.option(
      "--map", "MAP", options.map,
      "instead of it: a graspability map of the mesh (.pcd, .ply, .csv, .tiles), each of whose "
      "voxels is a location");
  command.output(
      options.output,
      "with --points a CSV: the locations, each with the results of its trials; with "
      "--map the map with more fields (.pcd, .ply, .vtp, .csv), or a tile store (.tiles)");
  command.option("--tile", "K/N", options.tile,
                 "with --map: test only share K of N of the tiles, into a tile store");
  command.option("--scenes", "FOLDER", options.scenes.folder,
                 "pictures of one trial of each location, its force nearest to the median: "
                 "FOLDER/PLACE.ply, after the column 'place' or the row");
  command.option("--scene-of", "PLACES", options.scenes.places,
                 "the locations to draw; default: all");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { grasp(options, run); });
}
