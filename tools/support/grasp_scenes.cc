#include "tools/support/grasp_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "libgtd/grasp/trial_scene.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/io/mesh_io.h"

namespace graspmap_tools {

namespace {

constexpr std::size_t max_unlisted_scenes = 100;

// File name of a location: special characters become '_'.
std::string file_of(const std::string& location) {
  std::string name = location.substr(0, 100);
  for (char& letter : name) {
    const bool is_plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '-' || letter == '.';
    if (!is_plain) letter = '_';
  }
  if (name.empty() || name.front() == '.' || name.front() == '-') name.insert(0, "_");
  return name + ".ply";
}

std::vector<std::size_t> rows_of(const libmap::Table& locations,
                                 const std::vector<std::string>& listed) {
  const std::vector<std::string> names = names_of(locations);
  std::vector<std::size_t> rows;
  for (const std::string& location : listed) {
    const auto found = std::find(names.begin(), names.end(), location);
    if (found == names.end())
      throw libmap::Error(
          "not a listed location" + libmap::did_you_mean(location, names),
          {.file = locations.file, .field = "--scene-locations", .value = location});
    const auto row = static_cast<std::size_t>(found - names.begin());
    if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
  }
  return rows;
}

std::string name_of(libgtd::TrialOutcome outcome) {
  for (const auto& [name, value] : libgtd::trial_outcome_names())
    if (value == outcome) return name;
  return "";
}

std::string description(const libgtd::LocationResult& result, const libgtd::Trial& trial,
                        double load_n) {
  const std::string verdict =
      fmt::format("{} (probability {:.2f}); the shown trial ",
                  result.holds() ? "holds" : "does not hold", result.hold_probability);
  const std::string direction = libgtd::pull_directions()[trial.direction].name();
  if (trial.outcome == libgtd::TrialOutcome::holds)
    return verdict + fmt::format("holds {:.1f} N in its weakest direction, {}; the load is {} N",
                                 trial.force_n, direction, libmap::to_text(load_n));
  const std::string failure = "fails by " + name_of(trial.outcome);
  if (trial.gripper.approach != libgtd::ApproachOutcome::on_ground) return verdict + failure;
  return verdict + failure +
         fmt::format(": {:.1f} N in its weakest direction, {}; the load is {} N", trial.force_n,
                     direction, libmap::to_text(load_n));
}

}  // namespace

std::vector<std::string> names_of(const libmap::Table& locations) {
  const auto column = locations.find_column("place");
  std::vector<std::string> names;
  for (std::size_t row = 0; row < locations.rows.size(); ++row)
    names.push_back(column ? locations.rows[row][*column] : std::to_string(row + 1));
  return names;
}

void claim_scenes(const GraspScenesOptions& options, Run& run) {
  if (!options.folder.empty()) return run.claim_output_folder(options.folder);
  if (!options.locations.empty())
    throw libmap::Error("can only be used with --scenes", {.field = "--scene-locations"});
}

std::vector<GraspScene> scenes_of(const libmap::Table& locations,
                                  const GraspScenesOptions& options) {
  if (options.folder.empty()) return {};
  const std::vector<std::string> names = names_of(locations);
  std::vector<std::size_t> rows = rows_of(locations, options.locations);
  if (options.locations.empty()) {
    if (names.size() > max_unlisted_scenes)
      throw libmap::Error(
          "too many scenes, one per location; select locations with --scene-locations",
          {.file = locations.file,
           .field = "locations",
           .value = std::to_string(names.size()),
           .bound = "<= " + std::to_string(max_unlisted_scenes)});
    for (std::size_t row = 0; row < names.size(); ++row) rows.push_back(row);
  }
  std::vector<GraspScene> scenes;
  for (const std::size_t row : rows) {
    const std::string file = file_of(names[row]);
    for (const GraspScene& other : scenes)
      if (other.file == file)
        throw libmap::Error(
            fmt::format("the scenes of rows {} and {} have the same name", other.row + 1, row + 1),
            {.file = locations.file, .field = "place", .value = "'" + names[row] + "'"});
    scenes.push_back({row, file});
  }
  return scenes;
}

void write_scenes(const GraspScenesOptions& options, const std::vector<GraspScene>& scenes,
                  const GraspScenesInput& input, Run& run) {
  if (options.folder.empty()) return;
  const double load_n = input.options.load_n * input.options.safety;
  Run::Files files;
  for (const GraspScene& scene : scenes) {
    const libgtd::LocationResult& result = input.results[scene.row];
    const libgtd::Trial trial =
        libgtd::repeat_trial(input.ground, input.gripper, result.location, input.options,
                             result.median_pose, result.median_draw);
    run.add_results({{scene.file, description(result, trial, load_n)}});
    files.emplace_back(scene.file, [=, &input](const std::filesystem::path& temporary) {
      libmap::write_mesh(temporary, libgtd::trial_scene(input.mesh, input.gripper, trial, load_n));
    });
  }
  run.timed("scenes", [&] { run.write_output_folder(options.folder, files); });
}

}  // namespace graspmap_tools
