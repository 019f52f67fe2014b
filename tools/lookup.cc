// graspmap lookup: the map's values at listed locations.
#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "libgtd/evaluate/lookup.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "tools/command_line.h"
#include "tools/map_frame.h"

namespace {

using graspmap_tools::Run;

struct LookupCommandOptions {
  std::string map;
  std::string points;
  std::string output;
  graspmap_tools::PointFrame points_frame = graspmap_tools::PointFrame::input;
  libgtd::LookupOptions lookup;
};

// Appends a column; one that the points already have (a verdict named "graspable") keeps its name.
void add_column(libmap::Table& table, std::string name) {
  while (table.find_column(name)) name = "map_" + name;
  table.columns.push_back(std::move(name));
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
  if (libmap::format_of(options.output) != ".csv")
    throw libmap::Error("look-ups are written as .csv", {.file = options.output});
  run.claim_output(options.output, {options.map, options.points});
  const libmap::Table table = libmap::read_csv(options.points);
  std::vector<Eigen::Vector3d> positions = graspmap_tools::positions_of(table);
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  if (map.empty()) throw libmap::Error("the map has no points", {.file = options.map});
  const libmap::Pose transform =
      graspmap_tools::map_from_points(options.map, options.points_frame, run);
  for (Eigen::Vector3d& position : positions) position = transform * position;
  const std::vector<libgtd::LookupAnswer> answers =
      run.timed("look-up", [&] { return libgtd::look_up(map, positions, options.lookup); });
  std::int64_t found = 0;
  for (const libgtd::LookupAnswer& answer : answers) found += answer.found ? 1 : 0;
  run.add_input(options.map);
  run.add_input(options.points);
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
  command.parameters().add(
      "points_frame", options.points_frame, graspmap_tools::point_frame_names(),
      "frame of the points: of the cloud that was scored, the terrain's, or the map's "
      "before it was cropped");
  return command.run(argc, argv, [&](Run& run) { lookup(options, run); });
}
