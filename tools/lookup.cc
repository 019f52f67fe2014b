// graspmap lookup: the map's values at listed locations.
#include <fmt/format.h>

#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/evaluate/lookup.h"
#include "libgtd/evaluate/tile_lookup.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/table.h"
#include "tools/command_line.h"
#include "tools/map_frame.h"
#include "tools/map_tiles.h"

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

struct MapAnswers {
  std::vector<std::string> fields;  // of the map
  std::vector<libgtd::LookupAnswer> answers;
};

std::vector<std::string> field_names(const libmap::PointCloud& map) {
  std::vector<std::string> names;
  for (const libmap::ScalarField& field : map.fields) names.push_back(field.name);
  return names;
}

// To the frame of the map's points.
void carry(const LookupCommandOptions& options, std::vector<Eigen::Vector3d>& positions, Run& run) {
  const libmap::Pose transform =
      graspmap_tools::map_from_points(options.map, options.points_frame, run);
  for (Eigen::Vector3d& position : positions) position = transform * position;
}

MapAnswers ask_map(const LookupCommandOptions& options, std::vector<Eigen::Vector3d> positions,
                   Run& run) {
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  if (map.empty()) throw libmap::Error("the map has no points", {.file = options.map});
  run.add_input(options.map);
  carry(options, positions, run);
  return {field_names(map),
          run.timed("look-up", [&] { return libgtd::look_up(map, positions, options.lookup); })};
}

MapAnswers ask_tiles(const LookupCommandOptions& options, std::vector<Eigen::Vector3d> positions,
                     Run& run) {
  const graspmap_tools::MapTiles tiles(options.map);
  carry(options, positions, run);
  run.add_input(graspmap_tools::store_index_path(options.map));
  const auto load = [&](std::size_t tile) { return tiles.load(tile); };
  try {
    return {field_names(tiles.load(0)), run.timed("look-up", [&] {
              return libgtd::look_up_tiles(tiles.index(), load, positions, options.lookup,
                                           run.progress());
            })};
  } catch (const libmap::Error& error) {
    throw error.in_file(options.map);
  }
}

// The points, each with its answer; row by row, so that a million of them are never text at once.
void write_answers(std::ostream& out, libmap::Table table, const MapAnswers& map) {
  add_column(table, "found");
  add_column(table, "distance_m");
  for (const std::string& field : map.fields) add_column(table, field);
  out << libmap::csv_line(table.columns);
  for (std::size_t row = 0; row < map.answers.size(); ++row) {
    const libgtd::LookupAnswer& answer = map.answers[row];
    std::vector<std::string> cells = std::move(table.rows[row]);
    cells.push_back(answer.found ? "1" : "0");
    cells.push_back(libmap::to_text(static_cast<float>(answer.distance_m)));
    // Shortest text of single precision: the map's files hold no more.
    for (std::size_t f = 0; f < map.fields.size(); ++f)
      cells.push_back(answer.found ? libmap::to_text(static_cast<float>(answer.values[f])) : "");
    out << libmap::csv_line(cells);
  }
}

void lookup(LookupCommandOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".csv")
    throw libmap::Error("look-ups are written as .csv", {.file = options.output});
  options.map = graspmap_tools::without_trailing_slash(options.map);
  run.claim_output(options.output, {options.map, options.points});
  libmap::Table table = libmap::read_csv(options.points);
  std::vector<Eigen::Vector3d> positions = graspmap_tools::positions_of(table);
  const MapAnswers map = graspmap_tools::is_tile_store(options.map)
                             ? ask_tiles(options, std::move(positions), run)
                             : ask_map(options, std::move(positions), run);
  std::int64_t found = 0;
  for (const libgtd::LookupAnswer& answer : map.answers) found += answer.found ? 1 : 0;
  run.add_input(options.points);
  run.manifest().results.emplace_back("points", static_cast<std::int64_t>(map.answers.size()));
  run.manifest().results.emplace_back("found", found);
  run.say(fmt::format("{} of {} points lie on the map", found, map.answers.size()));
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_geometry_file(
        temporary, [&](std::ostream& out) { write_answers(out, std::move(table), map); });
  });
}

}  // namespace

int main(int argc, char** argv) {
  LookupCommandOptions options;
  graspmap_tools::Command command("lookup", "The map's values at listed locations.");
  command.input("MAP", options.map, "graspability map, or a tile store (.tiles)");
  command.input("POINTS", options.points, "CSV with the columns x, y, z in metres, and any others");
  command.output(options.output, "CSV: the points, each with the map's values there");
  bind(command.parameters(), options.lookup);
  command.parameters().add(
      "points_frame", options.points_frame, graspmap_tools::point_frame_names(),
      "frame of the points: of the cloud that was scored, the terrain's, or the map's "
      "before it was cropped");
  return command.run(argc, argv, [&](Run& run) { lookup(options, run); });
}
