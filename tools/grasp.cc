// graspmap grasp: virtual field test of a gripper at listed locations or map voxels of a mesh.
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/grasp_table.h"
#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/grasp/pull_fit.h"
#include "libgtd/grasp/surface_error.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/grasp_map.h"
#include "tools/support/grasp_scenes.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

using namespace graspmap_tools;

namespace {

enum class SequentialTest { automatic, on, off };

struct GraspCommandOptions {
  std::string mesh;
  std::string points;
  std::string map;
  std::string pulls;
  std::string plan;  // number of pulls
  std::string output;
  GraspScenesOptions scenes;
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
  table.add("gripper", options.gripper,
            "gripper to test: scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  bind(table, options.grasp);
  table.add("surface_error", options.surface_error,
            "random error of the mesh in the trials; none: no error; mesh: standard deviation from "
            "the vertex field expected_error; a number: standard deviation, m");
  table.add(
      "sequential", options.sequential,
      {{"auto", SequentialTest::automatic},
       {"on", SequentialTest::on},
       {"off", SequentialTest::off}},
      "end the trials at a location when it is certain whether most hold; auto: on with --map");
  table.add("map_draws", options.map_draws, {1, 100000},
            "with --map: number of random asperity samples at each pose, instead of --draws");
  table.add("more_loads", options.more_loads,
            "additional loads to test, N, separated by commas; each has its own result columns");
  table.add("prefix", options.prefix, "prefix added to the names of the result columns");
}

// Hash of all that affects the results, except mesh, locations and seed.
std::string parameters_hash(const libgtd::Gripper& gripper, const GraspCommandOptions& command) {
  libgtd::GraspOptions options = command.grasp;
  options.seed = 0;
  libmap::ParameterTable table;
  bind(table, options);
  return libmap::sha256_of(libgtd::to_yaml(gripper) + to_yaml(table) +
                           (options.sequential ? "sequential" : "") + command.surface_error);
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
  run.info(
      "{} of {} locations hold; mean probability {:.2f}, {:.1f} % of the ground under the "
      "gripper unseen",
      holding, results.size(), probability, 100.0 * unseen);
}

libgtd::Gripper read_with_fingers(const std::filesystem::path& file,
                                  const GraspCommandOptions& options) {
  const libgtd::Gripper gripper = libgtd::read_gripper(file, options.overrides);
  in_file(file.string(), [&] { libgtd::require_fingers(gripper); });
  return gripper;
}

// Limits per location of a pull, because the fit repeats the trials for each parameter set.
constexpr int max_pull_poses = 12;
constexpr int max_pull_draws = 2;
constexpr const char* level_mesh = "level";

libgtd::Ground ground_of(const libmap::TriangleMesh& mesh, const GraspCommandOptions& options) {
  const libgtd::SurfaceErrorOptions& bounds = options.grasp.surface;
  return in_file(options.mesh, [&] {
    if (options.surface_error == "none") return libgtd::Ground(mesh);
    if (options.surface_error == "mesh")
      return libgtd::Ground(mesh, libgtd::errors_of(mesh, bounds));
    const auto error_m = libmap::parse_double(options.surface_error);
    if (!error_m || !(*error_m >= 0.0 && *error_m <= bounds.max_error_m))
      throw libmap::Error("not a standard deviation",
                          {.field = "--surface-error",
                           .value = options.surface_error,
                           .bound = "none, mesh, or 0 to --max-surface-error, m"});
    return libgtd::Ground(mesh, libgtd::constant_error(mesh, *error_m, bounds));
  });
}

// Gripper and terrain of trials. Claims the output; `table` is the file of locations or pulls.
struct FieldTest {
  FieldTest(const GraspCommandOptions& options, const std::string& table, Run& run)
      : file((run.claim_output(options.output, {options.mesh, table}),
              libmap::find_data_file("grippers", options.gripper))),
        gripper(read_with_fingers(file, options)),
        rows(libmap::read_csv(table)),
        mesh(options.mesh == level_mesh ? libgtd::level_ground()
                                        : libmap::read_mesh(options.mesh).mesh),
        ground(ground_of(mesh, options)) {
    if (options.mesh != level_mesh) run.add_input(options.mesh);
    run.add_input(table);
    for (const auto& input : libgtd::gripper_files(file)) run.add_input(input);
  }

  std::filesystem::path file;
  libgtd::Gripper gripper;
  libmap::Table rows;  // of `table`
  libmap::TriangleMesh mesh;
  libgtd::Ground ground;
};

void grasp_voxels(GraspCommandOptions& options, Run& run) {
  reject_given({{"--scenes", !options.scenes.folder.empty()},
                {"--scene-locations", !options.scenes.locations.empty()},
                {"--more-loads", !options.more_loads.empty()},
                {"--prefix", !options.prefix.empty()}},
               "requires --points");
  GraspMapInput input{.mesh_file = options.mesh,
                      .map_file = options.map,
                      .output = options.output,
                      .share = libmap::parse_share(options.tile),
                      .parameters_hash = {}};
  require_map_output(input, run);
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = read_with_fingers(file, options);
  GroundTiles ground(options.mesh, gripper, options.grasp.closing.start_height_m,
                     [&](const libmap::TriangleMesh& mesh) { return ground_of(mesh, options); });
  run.add_input(options.mesh);
  run.add_input(is_tile_store(options.map) ? store_index_path(options.map).string() : options.map);
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
  reject_given({{"--tile", options.tile != GraspCommandOptions{}.tile}}, "requires --map");
  if (libmap::format_of(options.output) != ".csv")
    throw libmap::Error("results are written as .csv", {.file = options.output});
  for (const std::string& text : libmap::split_list(options.more_loads)) {
    const auto load = libmap::parse_double(text);
    if (!load || !(*load > 0.0))
      throw libmap::Error("not a load", {.field = "--more-loads", .value = text, .bound = "> 0 N"});
    options.grasp.extra_loads_n.push_back(*load);
  }
  claim_scenes(options.scenes, run);
  options.grasp.sequential = options.sequential == SequentialTest::on;
  FieldTest test(options, options.points, run);
  libmap::Table& table = test.rows;
  const std::vector<Eigen::Vector3d> locations = positions_of(table);
  if (locations.empty()) throw libmap::no_elements("locations", options.points);
  const auto scenes = scenes_of(table, options.scenes);
  options.grasp.check();
  std::vector<libgtd::LocationResult> results;
  try {
    results = run.timed("grasp", [&] {
      return libgtd::test_grasps(test.ground, test.gripper, locations, options.grasp,
                                 run.progress());
    });
  } catch (const libmap::Error& error) {
    throw error.in_file(options.points);
  }
  for (const std::string& name : libgtd::grasp_columns(options.grasp.extra_loads_n)) {
    const std::string column = options.prefix + name;
    if (table.find_column(column))
      throw libmap::Error("the locations already have this column; set another --prefix",
                          {.file = options.points, .field = column});
    table.columns.push_back(column);
  }
  for (std::size_t row = 0; row < results.size(); ++row)
    for (std::string& cell : libgtd::grasp_cells(results[row]))
      table.rows[row].push_back(std::move(cell));
  run.add_results({{"parameters_sha256", parameters_hash(test.gripper, options)}});
  note_results(results, run);
  write_scenes(options.scenes, scenes,
               {test.mesh, test.ground, test.gripper, options.grasp, results}, run);
  run.write_text(options.output, libmap::to_csv(table));
}

libgtd::PullFitOptions pull_options(const GraspCommandOptions& command) {
  libgtd::PullFitOptions options;
  options.grasp = command.grasp;
  options.grasp.poses = std::min(options.grasp.poses, max_pull_poses);
  options.grasp.draws = std::min(options.grasp.draws, max_pull_draws);
  return options;
}

void say_fit(const libgtd::PullFit& fit, std::size_t tests, Run& run) {
  const auto text = [](const libgtd::PredictedForce& force) {
    return fmt::format("{:.2g} N (90 %: {:.2g} to {:.2g})", force.median_n, force.low_n,
                       force.high_n);
  };
  run.info("{} pull tests; force on level ground {}, before the fit {}", tests,
           text(fit.level_after), text(fit.level_before));
  for (const libgtd::FittedParameter& one : fit.parameters)
    run.info("{}: {:.3g} ({:.3g} to {:.3g}), before {:.3g} ({:.3g} to {:.3g}); {}", one.name,
             one.fitted[1], one.fitted[0], one.fitted[2], one.prior[1], one.prior[0], one.prior[2],
             one.is_determined() ? "determined by the tests" : "not determined by the tests");
  std::string rows;
  for (const std::size_t row : fit.outliers)
    rows += (rows.empty() ? "" : ", ") + std::to_string(row);
  if (!fit.explains_tests())
    run.warn(
        "the model does not explain the tests: the mean squared standard score of predicting each "
        "from the others is {:.2f} instead of 1 (probability {:.1g}){}; the ranges are too narrow",
        fit.mean_squared_score, fit.p_value, rows.empty() ? "" : ", worst rows " + rows);
  else if (!rows.empty())
    run.warn("the tests in rows {} contradict the predictions from the other tests", rows);
  constexpr double few_sets = 8.0;
  if (fit.effective_sets < few_sets)
    run.warn("the fit has only {:.1f} effective parameter sets; the fitted ranges are too narrow",
             fit.effective_sets);
  for (const auto& [name, force] :
       {std::pair{"level_before", &fit.level_before}, {"level_after", &fit.level_after}})
    run.add_results({{std::string(name) + "_low_n", force->low_n},
                     {std::string(name) + "_median_n", force->median_n},
                     {std::string(name) + "_high_n", force->high_n}});
  for (const libgtd::FittedParameter& one : fit.parameters)
    run.add_results({{one.name + ".low", one.fitted[0]},
                     {one.name + ".median", one.fitted[1]},
                     {one.name + ".high", one.fitted[2]},
                     {one.name + ".spread_ratio", one.spread_ratio}});
  run.add_results({{"pull_tests", tests},
                   {"effective_sets", fit.effective_sets},
                   {"mean_squared_score", fit.mean_squared_score},
                   {"chance", fit.p_value},
                   {"outlier_rows", rows}});
}

void fit_gripper(const GraspCommandOptions& options, Run& run) {
  FieldTest test(options, options.pulls, run);
  const auto tests = libgtd::pull_tests_of(test.rows);
  const libgtd::PullFit fit = run.timed("fit", [&] {
    return in_file(options.pulls, [&] {
      return libgtd::fit_pulls(options.mesh == level_mesh ? nullptr : &test.ground, test.gripper,
                               tests, pull_options(options), run.progress());
    });
  });
  say_fit(fit, tests.size(), run);
  test.gripper.ensemble = fit.ensemble;
  run.write_text(options.output, libgtd::to_yaml(test.gripper));
}

void plan_next_pulls(const GraspCommandOptions& options, Run& run) {
  const auto count = libmap::parse_integer(options.plan);
  if (!count || *count < 1)
    throw libmap::Error("not a number of pull tests",
                        {.field = "--plan", .value = options.plan, .bound = ">= 1"});
  const FieldTest test(options, options.points, run);
  const libmap::Table& table = test.rows;
  const std::vector<Eigen::Vector3d> locations = positions_of(table);
  const auto plans = run.timed("plan", [&] {
    return libgtd::plan_pulls(test.ground, test.gripper, locations,
                              static_cast<std::size_t>(*count), pull_options(options),
                              run.progress());
  });
  if (plans.empty()) throw libmap::Error("no pull test is informative", {.file = options.points});
  libmap::Table planned;
  planned.columns = {"place",    "x",           "y",      "z",
                     "tilt_deg", "azimuth_deg", "load_n", "information_bits"};
  const std::vector<std::string> names = names_of(table);
  for (const libgtd::PlannedPull& plan : plans) {
    std::vector<std::string> row{names[plan.location]};
    for (const double value : locations[plan.location]) row.push_back(libmap::to_text(value));
    row.push_back(std::to_string(plan.direction.tilt_deg));
    row.push_back(std::to_string(plan.direction.azimuth_deg));
    row.push_back(fmt::format("{:.2g}", plan.load_n));
    row.push_back(fmt::format("{:.3f}", plan.information_bits));
    planned.rows.push_back(std::move(row));
  }
  run.info("{} pull tests; the first gives {:.2f} bits", plans.size(),
           plans.front().information_bits);
  run.write_text(options.output, libmap::to_csv(planned));
}

void grasp(GraspCommandOptions& options, Run& run) {
  if (!options.pulls.empty()) {
    reject_given({{"--points", !options.points.empty()},
                  {"--map", !options.map.empty()},
                  {"--plan", !options.plan.empty()}},
                 "cannot be combined with --fit");
    return fit_gripper(options, run);
  }
  if (options.points.empty() == options.map.empty())
    throw UsageError(options.map.empty()
                         ? "--points LOCATIONS.csv, --map MAP or --fit PULLS.csv is missing"
                         : "--points and --map cannot be combined");
  if (!options.plan.empty()) {
    reject_given({{"--map", !options.map.empty()}}, "cannot be combined with --plan");
    return plan_next_pulls(options, run);
  }
  options.map.empty() ? grasp_places(options, run) : grasp_voxels(options, run);
}

}  // namespace

int main(int argc, char** argv) {
  GraspCommandOptions options;
  Command command("grasp");
  command.input("MESH", options.mesh,
                "terrain: mesh or elevation model (.tif), z up; level: level ground, for --fit");
  command.option("--points", "LOCATIONS.csv", options.points,
                 "locations to test: CSV with columns x, y, z (mesh frame, m) and any others");
  command.option("--map", "MAP", options.map,
                 "instead of --points: graspability map of the mesh (.pcd, .ply, .csv, .tiles), "
                 "whose voxels are tested");
  command.output(
      options.output,
      "with --points: CSV of the locations with test results; with --map: the map with test "
      "results as fields (.pcd, .ply, .vtp, .csv), or a tile store (.tiles); with --fit: gripper "
      "file (.yaml) with fitted force parameters; with --plan: CSV of planned pull tests");
  command.option(
      "--fit", "PULLS.csv", options.pulls,
      "pull tests to which force parameters are fitted: CSV with x, y, z (m) or ground = level; "
      "tilt_deg, azimuth_deg of the pull; force_n at slip, or load_n and held (0 or 1)");
  command.option("--plan", "N", options.plan,
                 "with --points: number of most informative pull tests to plan");
  command.option(
      "--tile", "K/N", options.tile,
      "with --map and a tile store as output: test only share K of N (1/N) of the tiles");
  command.option("--scenes", "FOLDER", options.scenes.folder,
                 "output folder for one mesh per location, which shows the trial with the median "
                 "force; file name: column 'place' of LOCATIONS.csv, or the row number");
  command.option("--scene-locations", "LOCATIONS", options.scenes.locations,
                 "names of the locations that --scenes writes, separated by commas; default: all");
  command.renamed_flag("--scene-of", "--scene-locations");
  for (const char* key : {"friction", "asperity-min", "asperity-max", "engagement-rate", "drag"}) {
    std::string name = key;
    std::replace(name.begin(), name.end(), '-', '_');
    name += name.starts_with("asperity") ? "_deg" : name == "drag" ? "_mm" : "";
    command.former_flag(std::string("--") + key, "--set gripper.engagement." + name + "=VALUE");
  }
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { grasp(options, run); });
}
