#include "tools/support/grasp_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "libgtd/grasp/trial_scene.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_io.h"

namespace graspmap_tools {

namespace {

constexpr std::size_t max_unlisted_scenes = 100;

// As a file's name: what a shell or a file system could take for anything else becomes '_'.
std::string file_of(const std::string& place) {
  std::string name = place.substr(0, 100);
  for (char& letter : name) {
    const bool is_plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                          (letter >= '0' && letter <= '9') || letter == '-' || letter == '.';
    if (!is_plain) letter = '_';
  }
  if (name.empty() || name.front() == '.' || name.front() == '-') name.insert(0, "_");
  return name + ".ply";
}

std::vector<std::string> places_of(const libmap::Table& locations) {
  const auto column = locations.find_column("place");
  std::vector<std::string> places;
  for (std::size_t row = 0; row < locations.rows.size(); ++row)
    places.push_back(column ? locations.rows[row][*column] : std::to_string(row + 1));
  return places;
}

std::vector<std::size_t> rows_of(const libmap::Table& locations,
                                 const std::vector<std::string>& listed) {
  const std::vector<std::string> places = places_of(locations);
  std::vector<std::size_t> rows;
  for (const std::string& place : listed) {
    const auto found = std::find(places.begin(), places.end(), place);
    if (found == places.end())
      throw libmap::Error("is no place of the locations" + libmap::did_you_mean(place, places),
                          {.file = locations.file, .field = "--scene-of", .value = place});
    const auto row = static_cast<std::size_t>(found - places.begin());
    if (std::find(rows.begin(), rows.end(), row) == rows.end()) rows.push_back(row);
  }
  return rows;
}

std::string name_of(libgtd::TrialEnd end) {
  for (const auto& [name, value] : libgtd::trial_end_names())
    if (value == end) return name;
  return "";
}

std::string description(const libgtd::LocationResult& result, const libgtd::Trial& trial,
                        double load_n) {
  const std::string verdict =
      fmt::format("{} (probability {:.2f}); the trial shown ",
                  result.holds() ? "holds" : "does not hold", result.hold_probability);
  const std::string direction = libgtd::pull_directions()[trial.direction].name();
  if (trial.end == libgtd::TrialEnd::holds)
    return verdict + fmt::format("bears {:.1f} N in its weakest direction, {}; the load is {} N",
                                 trial.force_n, direction, libmap::to_text(load_n));
  const std::string failure = "fails by " + name_of(trial.end);
  if (trial.gripper.approach != libgtd::ApproachEnd::on_ground) return verdict + failure;
  return verdict + failure +
         fmt::format(": {:.1f} N in its weakest direction, {}; the load is {} N", trial.force_n,
                     direction, libmap::to_text(load_n));
}

}  // namespace

void claim_scenes(const GraspScenesOptions& options, Run& run) {
  if (!options.folder.empty()) return run.claim_output_folder(options.folder);
  if (!options.places.empty())
    throw libmap::Error("is for --scenes, which is not given", {.field = "--scene-of"});
}

std::vector<GraspScene> scenes_of(const libmap::Table& locations,
                                  const GraspScenesOptions& options) {
  if (options.folder.empty()) return {};
  const std::vector<std::string> places = places_of(locations);
  std::vector<std::size_t> rows = rows_of(locations, options.places);
  if (options.places.empty()) {
    if (places.size() > max_unlisted_scenes)
      throw libmap::Error("too many locations for a picture of each: list some with --scene-of",
                          {.file = locations.file,
                           .field = "locations",
                           .value = std::to_string(places.size()),
                           .bound = "<= " + std::to_string(max_unlisted_scenes)});
    for (std::size_t row = 0; row < places.size(); ++row) rows.push_back(row);
  }
  std::vector<GraspScene> scenes;
  for (const std::size_t row : rows) {
    const std::string file = file_of(places[row]);
    for (const GraspScene& other : scenes)
      if (other.file == file)
        throw libmap::Error(
            fmt::format("the pictures of rows {} and {} have one name", other.row + 1, row + 1),
            {.file = locations.file, .field = "place", .value = "'" + places[row] + "'"});
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
                             result.shown_pose, result.shown_draw);
    run.add_results({{scene.file, description(result, trial, load_n)}});
    files.emplace_back(scene.file, [=, &input](const std::filesystem::path& temporary) {
      libmap::write_mesh(temporary, libgtd::trial_scene(input.mesh, input.gripper, trial, load_n));
    });
  }
  run.timed("scenes", [&] { run.write_output_folder(options.folder, files); });
}

}  // namespace graspmap_tools
