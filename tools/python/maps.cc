#include <algorithm>
#include <cmath>

#include "libgtd/detect.h"
#include "libgtd/evaluate/lookup.h"
#include "libgtd/evaluate/roc_tables.h"
#include "libgtd/scenario_io.h"
#include "libgtd/score/footholds.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/table.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

using libmap::PointCloud;

struct ScoreOptions {
  libgtd::DetectionOptions detection;
  libgtd::MapFrame frame = libgtd::MapFrame::terrain;
};

void bind(libmap::ParameterTable& table, ScoreOptions& options) {
  libgtd::bind(table, options.detection);
  table.add("frame", options.frame, libgtd::map_frame_names(),
            "frame of the map's points; terrain: as set by --plane; input: frame of the cloud");
}

ScoreOptions score_options(const std::optional<std::string>& scenario,
                           const std::optional<Eigen::Vector3d>& up, const py::dict& values) {
  ScoreOptions options;
  if (scenario) options.detection = libgtd::read_scenario(*scenario);
  options.detection.gripper.reset();  // `values` may name another gripper
  options = options_from(values, std::move(options));
  options.detection.scenario.check();
  if (!up) return options;
  options.detection.up = *up;
  if (options.detection.plane == libgtd::PlaneSource::none)
    throw libmap::Error("requires a fitted plane; with plane none, up is z", {.field = "up"});
  return options;
}

py::dict score(const PointCloud& terrain, const std::optional<std::string>& scenario,
               const std::optional<Eigen::Vector3d>& up, const py::dict& values,
               const py::object& progress, unsigned threads) {
  const ScoreOptions options = score_options(scenario, up, values);
  PointCloud map;
  const libgtd::DetectionResult result = run(threads, progress, [&](libmap::Progress& bar) {
    libgtd::DetectionResult found = libgtd::detect(terrain, options.detection, bar);
    map = libgtd::to_cloud(found.map, options.frame);
    return found;
  });
  py::dict made = dict_of(libmap::described(result));
  made["map"] = shared(std::move(map));
  made["frame"] = options.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
  made["terrain_from_input"] = matrix_of(result.map.terrain_from_input);
  made["zero_plane_m"] = std::isfinite(result.map.zero_plane_m)
                             ? py::object(py::float_(result.map.zero_plane_m))
                             : py::none();
  made["voxel_size_m"] = result.map.lattice.voxel_size_m;
  made["obstacle_voxels"] = result.obstacle_voxels;
  made["timings_s"] = numbers_of(result.timings_s);
  return made;
}

// Returns an array of values for each field of the map; NaN for an answer that is not `found`.
py::dict values_of(const PointCloud& map, const std::vector<libgtd::LookupAnswer>& answers) {
  py::dict dict;
  for (std::size_t field = 0; field < map.fields.size(); ++field)
    dict[map.fields[field].name.c_str()] =
        column<double>(answers, [&](const libgtd::LookupAnswer& answer) {
          return answer.found ? answer.values[field] : std::numeric_limits<double>::quiet_NaN();
        });
  return dict;
}

py::dict lookup(const PointCloud& map, const std::vector<Eigen::Vector3d>& points,
                const py::dict& values, unsigned threads) {
  const auto options = options_from<libgtd::LookupOptions>(values);
  using Answer = libgtd::LookupAnswer;
  const std::vector<Answer> answers = run(threads, py::none(), [&](libmap::Progress& /*bar*/) {
    return libgtd::look_up(map, points, options);
  });
  py::dict made;
  made["found"] = column<bool>(answers, [](const Answer& answer) { return answer.found; });
  made["distance_m"] =
      column<double>(answers, [](const Answer& answer) { return answer.distance_m; });
  made["map_point"] =
      column<std::int64_t>(answers, [](const Answer& answer) { return answer.map_point; });
  made["values"] = values_of(map, answers);
  return made;
}

py::dict footholds(const PointCloud& map, const Eigen::Vector3d& up, const py::dict& values,
                   unsigned threads) {
  const auto options = options_from<libgtd::FootholdOptions>(values);
  const libgtd::FootholdFrame frame = {.up = up};
  PointCloud cloud;
  const libgtd::FootholdResult result = run(threads, py::none(), [&](libmap::Progress& /*bar*/) {
    libgtd::FootholdResult found = libgtd::find_footholds(map, options, frame);
    cloud = libgtd::to_cloud(found, map);
    return found;
  });
  py::dict made = dict_of(libmap::described(result));
  made["cloud"] = shared(std::move(cloud));
  made["map_point"] = column<std::int64_t>(
      result.footholds, [](const libgtd::Foothold& foothold) { return foothold.map_point; });
  return made;
}

// Returns the cells of each column, as texts.
py::dict columns_of(const libmap::Table& table) {
  py::dict dict;
  for (std::size_t column = 0; column < table.columns.size(); ++column) {
    py::list cells;
    for (const std::vector<std::string>& row : table.rows) cells.append(row[column]);
    dict[table.columns[column].c_str()] = cells;
  }
  return dict;
}

libmap::Table table_from(const py::dict& columns) {
  libmap::Table table;
  for (const auto& [name, given] : columns) {
    const std::string column = "column " + table.columns.emplace_back(py::str(name));
    if (!py::isinstance<py::list>(given)) throw wrong_value(given, column, "values of shape (N,)");
    const auto cells = given.cast<std::vector<std::string>>();
    if (table.columns.size() == 1) table.rows.resize(cells.size());
    if (cells.size() != table.rows.size())
      throw libmap::Error("the columns have different numbers of values",
                          {.field = column,
                           .value = std::to_string(cells.size()),
                           .bound = std::to_string(table.rows.size())});
    for (std::size_t row = 0; row < cells.size(); ++row) table.rows[row].push_back(cells[row]);
  }
  return table;
}

py::dict evaluate(const py::dict& columns, const std::vector<std::string>& scores,
                  const py::dict& values, unsigned threads) {
  auto options = options_from<libgtd::TableEvaluationOptions>(values);
  options.score_columns = scores;
  const libmap::Table table = table_from(columns);
  const libgtd::TableEvaluation evaluation =
      run(threads, py::none(),
          [&](libmap::Progress& /*bar*/) { return libgtd::evaluate_table(table, options); });
  py::dict areas;
  for (const libgtd::ColumnEvaluation& column : evaluation.columns)
    areas[column.name.c_str()] =
        column.result.auc ? py::cast(column.result.auc->trapezoid) : py::none();
  py::dict made;
  made["areas"] = areas;
  made["summary_json"] = libgtd::to_json(evaluation);
  made["roc"] = columns_of(libgtd::roc_table(evaluation));
  made["rates"] = columns_of(libgtd::rates_table(evaluation));
  made["accuracy"] = columns_of(libgtd::accuracy_table(evaluation));
  return made;
}

}  // namespace

void add_maps(py::module_& module) {
  define(module, "score", &score, {"terrain", "scenario", "up", "options", "progress", "threads"});
  define(module, "lookup", &lookup, {"map", "points", "options", "threads"});
  define(module, "footholds", &footholds, {"map", "up", "options", "threads"});
  define(module, "evaluate", &evaluate, {"table", "scores", "options", "threads"});
  add_stage<ScoreOptions, libgtd::DetectionResult>("score", {"obstacle_voxels"});
  add_stage<libgtd::LookupOptions>("lookup");
  add_stage<libgtd::FootholdOptions, libgtd::FootholdResult>("footholds");
  add_stage<libgtd::TableEvaluationOptions>("evaluate");
}

}  // namespace graspmap_python
