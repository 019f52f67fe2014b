// graspmap lookup: looks up a map's values at listed locations.
#include <ostream>

#include "libgtd/evaluate/lookup.h"
#include "libgtd/evaluate/roc.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

using namespace graspmap_tools;

namespace {

struct LookupCommandOptions {
  std::string map;
  std::string points;
  std::string output;
  PointFrame points_frame = PointFrame::automatic;
  libgtd::LookupOptions lookup;
  std::string columns;  // empty: found, distance_m and every field
  std::string visible;  // a cloud, if not empty
  double visible_radius_m = 0.02;
};

void bind(libmap::ParameterTable& table, LookupCommandOptions& options) {
  bind(table, options.lookup);
  table.add("points_frame", options.points_frame, listed_point_frame_names(),
            "frame of POINTS; input: frame of the scored cloud; terrain: frame of scoring, z up; "
            "map: frame before `graspmap crop`, or of a simulated robot's mesh; auto: from the "
            "manifest of POINTS, else input");
  table.add("column", options.columns,
            "columns to add, separated by commas: NAME=FIELD (field of the map), or "
            "NAME=FIELD>=VALUE (1 or 0); empty: found, distance_m and all fields");
  table.add("visible_radius_m", options.visible_radius_m, libmap::positive,
            "with --visible: maximum distance of a location from the nearest measured point, m");
}

// Appends a column; its name gets the prefix map_ if the table already has this column.
void add_column(libmap::Table& table, std::string name) {
  while (table.find_column(name)) name.insert(0, "map_");
  table.columns.push_back(std::move(name));
}

// A column that is added to the table of points.
struct AddedColumn {
  std::string name;
  std::string field;             // field of the map, found or distance_m
  std::optional<double> cutoff;  // the value is 1 if the field reaches the cutoff, else 0
};

// Parses NAME=FIELD or NAME=FIELD>=VALUE, separated by commas.
std::vector<AddedColumn> parse_columns(const std::string& text) {
  std::vector<AddedColumn> columns;
  for (const std::string& part : libmap::split_list(text)) {
    const std::size_t equals = part.find('=');
    const std::string_view rest =
        equals == std::string::npos ? "" : std::string_view(part).substr(equals + 1);
    const std::size_t comparison = rest.find(">=");
    AddedColumn column;
    column.name = libmap::trim(std::string_view(part).substr(0, equals));
    column.field = libmap::trim(rest.substr(0, comparison));
    if (comparison != std::string_view::npos)
      column.cutoff = libmap::parse_double(rest.substr(comparison + 2));
    if (column.name.empty() || column.name.ends_with('>') || column.field.empty() ||
        (comparison != std::string_view::npos && !column.cutoff))
      throw libmap::Error(
          "not a definition of a column",
          {.field = "--column", .value = part, .bound = "NAME=FIELD or NAME=FIELD>=VALUE"});
    columns.push_back(std::move(column));
  }
  return columns;
}

struct MapAnswers {
  std::vector<std::string> fields;         // fields of the map
  std::vector<Eigen::Vector3d> positions;  // listed points in the frame of the map's points
  std::vector<libgtd::LookupAnswer> answers;
};

std::vector<std::string> field_names(const libmap::PointCloud& map) {
  std::vector<std::string> names;
  for (const libmap::ScalarField& field : map.fields) names.push_back(field.name);
  return names;
}

// Transforms positions to the frame of the map's points.
std::vector<Eigen::Vector3d> carried(const LookupCommandOptions& options,
                                     std::vector<Eigen::Vector3d> positions, Run& run) {
  const libmap::Pose transform = map_from_points(options.map, options.points_frame, run);
  for (Eigen::Vector3d& position : positions) position = transform * position;
  return positions;
}

MapAnswers ask_map(const LookupCommandOptions& options, std::vector<Eigen::Vector3d> positions,
                   Run& run) {
  const libmap::PointCloud map = libmap::read_cloud(options.map).cloud;
  if (map.empty()) throw libmap::no_elements("points of the map", options.map);
  run.add_input(options.map);
  positions = carried(options, std::move(positions), run);
  MapAnswers asked = {field_names(map), std::move(positions), {}};
  asked.answers =
      run.timed("look-up", [&] { return libgtd::look_up(map, asked.positions, options.lookup); });
  return asked;
}

MapAnswers ask_tiles(const LookupCommandOptions& options, std::vector<Eigen::Vector3d> positions,
                     Run& run) {
  const MapTiles tiles(options.map);
  positions = carried(options, std::move(positions), run);
  run.add_input(store_index_path(options.map));
  const auto load = [&](std::size_t tile) { return tiles.load(tile); };
  return in_file(options.map, [&] {
    MapAnswers asked = {field_names(tiles.load(0)), std::move(positions), {}};
    asked.answers = run.timed("look-up", [&] {
      return libgtd::look_up_tiles(tiles.index(), load, asked.positions, options.lookup,
                                   run.progress());
    });
    return asked;
  });
}

// Removes the answers at locations without a near point of the --visible cloud, where the map has
// only interpolated values. Returns their number.
std::int64_t hide_unseen(const LookupCommandOptions& options, MapAnswers& map, Run& run) {
  const libmap::PointCloud seen = libmap::read_cloud(options.visible).cloud;
  if (seen.empty()) throw libmap::no_elements("points of the cloud", options.visible);
  run.add_input(options.visible);
  const libmap::Pose input_from_map =
      map_from_input(libmap::read_manifest_of(options.map)).inverse();
  std::vector<Eigen::Vector3d> positions = map.positions;
  for (Eigen::Vector3d& position : positions) position = input_from_map * position;
  const libgtd::LookupOptions near_by = {.max_distance_m = options.visible_radius_m};
  const std::vector<libgtd::LookupAnswer> sights =
      run.timed("visibility", [&] { return libgtd::look_up(seen, positions, near_by); });
  std::int64_t visible = 0;
  for (std::size_t n = 0; n < sights.size(); ++n) {
    visible += sights[n].found ? 1 : 0;
    map.answers[n].found = map.answers[n].found && sights[n].found;
  }
  return visible;
}

// A cell of an output row: found, distance_m or a field by index, optionally with a cutoff.
struct Cell {
  std::size_t field;
  std::optional<double> cutoff;
};

std::vector<Cell> add_columns(libmap::Table& table, const std::vector<AddedColumn>& columns,
                              const MapAnswers& map, const std::string& map_file) {
  std::vector<std::string> fields = {"found", "distance_m"};
  fields.insert(fields.end(), map.fields.begin(), map.fields.end());
  std::vector<Cell> cells;
  if (columns.empty())
    for (const std::string& field : fields) {
      cells.push_back({cells.size(), std::nullopt});
      add_column(table, field);
    }
  for (const AddedColumn& column : columns) {
    const auto field = std::find(fields.begin(), fields.end(), column.field);
    if (field == fields.end())
      throw libmap::Error("the map has no such field" + libmap::did_you_mean(column.field, fields),
                          {.file = map_file, .field = "--column", .value = column.field});
    if (table.find_column(column.name))
      throw libmap::Error("the points already have this column; choose another name",
                          {.file = table.file, .field = "--column", .value = column.name});
    cells.push_back({static_cast<std::size_t>(field - fields.begin()), column.cutoff});
    table.columns.push_back(column.name);
  }
  return cells;
}

std::string text_of(const libgtd::LookupAnswer& answer, const Cell& cell) {
  if (!answer.found && cell.field > 1) return "";
  const double value = cell.field == 0   ? (answer.found ? 1.0 : 0.0)
                       : cell.field == 1 ? answer.distance_m
                                         : answer.values[cell.field - 2];
  if (cell.cutoff) return libgtd::reaches_cutoff(value, *cell.cutoff) ? "1" : "0";
  // Shortest text of single precision, which is that of the map's files.
  return libmap::to_text(static_cast<float>(value));
}

// Writes the points with their answers row by row, which limits the memory for text.
void write_answers(std::ostream& out, libmap::Table& table, const std::vector<Cell>& cells,
                   const MapAnswers& map) {
  out << libmap::csv_line(table.columns);
  for (std::size_t row = 0; row < map.answers.size(); ++row) {
    std::vector<std::string> line = std::move(table.rows[row]);
    for (const Cell& cell : cells) line.push_back(text_of(map.answers[row], cell));
    out << libmap::csv_line(line);
  }
}

void lookup(LookupCommandOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".csv")
    throw libmap::Error("look-ups are written as .csv", {.file = options.output});
  const std::vector<AddedColumn> columns = parse_columns(options.columns);
  options.map = without_trailing_slash(options.map);
  run.claim_output(options.output, {options.map, options.points, options.visible});
  options.points_frame = frame_of_points(options.points, options.points_frame, options.map, run);
  if (options.points_frame == PointFrame::terrain) copy_terrain_transform(options.map, run);
  libmap::Table table = libmap::read_csv(options.points);
  MapAnswers map = is_tile_store(options.map) ? ask_tiles(options, positions_of(table), run)
                                              : ask_map(options, positions_of(table), run);
  const std::vector<Cell> cells = add_columns(table, columns, map, options.map);
  if (!options.visible.empty()) run.add_results({{"visible", hide_unseen(options, map, run)}});
  const auto found = std::count_if(map.answers.begin(), map.answers.end(),
                                   [](const auto& answer) { return answer.found; });
  run.add_input(options.points);
  run.add_results({{"points", map.answers.size()}, {"found", found}});
  run.info("{} of {} points are on the map", found, map.answers.size());
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_geometry_file(temporary,
                                [&](std::ostream& out) { write_answers(out, table, cells, map); });
  });
}

}  // namespace

int main(int argc, char** argv) {
  LookupCommandOptions options;
  Command command("lookup");
  command.input("MAP", options.map, "graspability map, or a tile store (.tiles)");
  command.input("POINTS", options.points,
                "table of locations: CSV with the columns x, y, z in meters, and any others");
  command.output(options.output, "POINTS with the map's values as added columns (.csv)");
  command.option("--visible", "CLOUD", options.visible,
                 "measured cloud in the frame of the scored cloud, usually this cloud itself; "
                 "locations farther than --visible-radius from all its points get no values");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { lookup(options, run); });
}
