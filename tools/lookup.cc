// graspmap lookup: the map's values at listed locations.
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "libgtd/evaluate/lookup.h"
#include "libgtd/score/graspability_map.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;

struct LookupCommandOptions {
  std::string map;
  std::string points;
  std::string output;
  libgtd::MapFrame points_frame = libgtd::MapFrame::input;
  libgtd::LookupOptions lookup;
};

std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table) {
  const std::size_t columns[] = {table.column("x"), table.column("y"), table.column("z")};
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    Eigen::Vector3d& position = positions.emplace_back();
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      position[axis] = table.number(row, columns[static_cast<std::size_t>(axis)]);
    if (!position.allFinite())
      throw libmap::Error("x, y and z must be finite",
                          {.file = table.file, .field = "row " + std::to_string(row + 1)});
  }
  return positions;
}

// From the frame of the points to that of the map's points.
libmap::Pose map_from_points(const LookupCommandOptions& options, Run& run) {
  const auto manifest = libmap::read_manifest_of(options.map);
  if (!manifest) {
    run.warn(options.map + ": no manifest beside it: the points are taken in the map's own frame");
    return libmap::Pose::Identity();
  }
  const bool map_in_terrain = manifest->frame != "input";
  const bool points_in_terrain = options.points_frame == libgtd::MapFrame::terrain;
  const libmap::Pose* terrain_from_input = manifest->find_transform("terrain_from_input");
  if (map_in_terrain == points_in_terrain) return libmap::Pose::Identity();
  if (terrain_from_input == nullptr)
    throw libmap::Error(
        "does not say how the map's frame lies in the input's",
        {.file = libmap::manifest_path(options.map).string(), .field = "terrain_from_input"});
  return map_in_terrain ? *terrain_from_input : terrain_from_input->inverse();
}

// Appends a column; one that the points already have (a verdict named "graspable") keeps its name.
void add_column(libmap::Table& table, const std::string& name) {
  table.columns.push_back(table.find_column(name) ? "map_" + name : name);
}

libmap::Table answer_table(libmap::Table table, const libmap::PointCloud& map,
                           const std::vector<libgtd::LookupAnswer>& answers) {
  add_column(table, "found");
  add_column(table, "distance_m");
  for (const libmap::ScalarField& field : map.fields) add_column(table, field.name);
  for (std::size_t row = 0; row < answers.size(); ++row) {
    const libgtd::LookupAnswer& answer = answers[row];
    std::vector<std::string>& cells = table.rows[row];
    cells.push_back(answer.found ? "1" : "0");
    cells.push_back(libmap::to_text(static_cast<float>(answer.distance_m)));
    // Shortest text of single precision: the map's files hold no more.
    for (std::size_t f = 0; f < map.fields.size(); ++f)
      cells.push_back(answer.found ? libmap::to_text(static_cast<float>(answer.values[f])) : "");
  }
  return table;
}

void lookup(const LookupCommandOptions& options, Run& run) {
  run.claim_output(options.output);
  const libmap::Table table = libmap::read_csv(options.points);
  std::vector<Eigen::Vector3d> positions = positions_of(table);
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  const libmap::Pose transform = map_from_points(options, run);
  for (Eigen::Vector3d& position : positions) position = transform * position;
  if (map.empty()) throw libmap::Error("the map has no points", {.file = options.map});
  if (run.dry_run()) return;
  const std::vector<libgtd::LookupAnswer> answers =
      run.timed("look-up", [&] { return libgtd::look_up(map, positions, options.lookup); });
  std::int64_t found = 0;
  for (const libgtd::LookupAnswer& answer : answers) found += answer.found ? 1 : 0;
  run.manifest().add_input(options.map);
  run.manifest().add_input(options.points);
  run.manifest().results.emplace_back("points", static_cast<std::int64_t>(answers.size()));
  run.manifest().results.emplace_back("found", found);
  run.say(fmt::format("{} of {} points lie on the map", found, answers.size()));
  const std::string text = libmap::to_csv(answer_table(table, map, answers));
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_text(temporary, text); });
}

}  // namespace

int main(int argc, char** argv) {
  LookupCommandOptions options;
  graspmap_tools::Command command("lookup", "The map's values at listed locations.");
  command.input("MAP", options.map, "graspability map");
  command.input("POINTS", options.points, "CSV with the columns x, y, z in metres, and any others");
  command.output(options.output, "CSV: the points, each with the map's values there");
  bind(command.parameters(), options.lookup);
  command.parameters().add("points_frame", options.points_frame, libgtd::map_frame_names(),
                           "frame of the points: of the cloud that was scored, or the terrain's");
  return command.run(argc, argv, [&](Run& run) { lookup(options, run); });
}
