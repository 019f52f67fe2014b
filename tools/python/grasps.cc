#include "libgtd/grasp/grasp_table.h"
#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/error.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

using Result = libgtd::LocationResult;
using Results = std::vector<Result>;

struct GraspOptions {
  std::string gripper = "scar-e";
  std::vector<std::pair<std::string, std::string>> overrides;
  libgtd::GraspOptions trials;
};

void bind(libmap::ParameterTable& table, GraspOptions& options) {
  table.add("gripper", options.gripper,
            "gripper to test: scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  libgtd::bind(table, options.trials);
}

// Returns the errors of `mesh`; None: no errors; "mesh": from its vertex field expected_error; a
// number: standard deviation of all vertices, m. Throws Error for other values.
libgtd::GroundErrors errors_of(const libmap::TriangleMesh& mesh, const py::object& given,
                               const libgtd::SurfaceErrorOptions& bounds) {
  if (given.is_none()) return {};
  if (py::isinstance<py::str>(given) && given.cast<std::string>() == "mesh")
    return libgtd::errors_of(mesh, bounds);
  if (py::isinstance<py::float_>(given) || py::isinstance<py::int_>(given)) {
    const double error_m = given.cast<double>();
    if (error_m >= 0.0 && error_m <= bounds.max_error_m)
      return libgtd::constant_error(mesh, error_m, bounds);
  }
  throw libmap::Error("not a standard deviation",
                      {.field = "surface_error",
                       .value = py::repr(given).cast<std::string>(),
                       .bound = "None, \"mesh\", or 0 to max_surface_error_m, m"});
}

// Returns an array with a row of `width` numbers for each location.
template <typename NumbersOf>
py::array_t<double> table_of(const Results& results, std::size_t width,
                             const NumbersOf& numbers_of) {
  py::array_t<double> array(rows(results.size(), static_cast<py::ssize_t>(width)));
  double* to = array.mutable_data();
  for (const Result& result : results) {
    const auto& numbers = numbers_of(result);
    to = std::copy(numbers.begin(), numbers.end(), to);
  }
  return array;
}

py::dict cells_of(const Results& results, const std::vector<double>& extra_loads_n) {
  const std::vector<std::string> names = libgtd::grasp_columns(extra_loads_n);
  std::vector<py::list> lists(names.size());
  for (const Result& result : results) {
    const std::vector<std::string> cells = libgtd::grasp_cells(result);
    for (std::size_t n = 0; n < names.size(); ++n) lists[n].append(cells[n]);
  }
  py::dict dict;
  for (std::size_t n = 0; n < names.size(); ++n) dict[names[n].c_str()] = lists[n];
  return dict;
}

py::dict results_of(const Results& results, const libgtd::GraspOptions& options) {
  py::dict made;
  made["holds"] = column<bool>(results, [](const Result& r) { return r.holds(); });
  made["hold_probability"] =
      column<double>(results, [](const Result& r) { return r.hold_probability; });
  made["hold_low"] = column<double>(results, [](const Result& r) { return r.hold_low; });
  made["hold_high"] = column<double>(results, [](const Result& r) { return r.hold_high; });
  made["force_n"] = table_of(results, 3, [](const Result& r) { return r.force_n; });
  made["force_range_n"] = table_of(results, 2, [](const Result& r) { return r.force_range_n; });
  made["trial_spread"] = column<double>(results, [](const Result& r) { return r.trial_spread; });
  made["parameter_spread"] =
      column<double>(results, [](const Result& r) { return r.parameter_spread; });
  made["best_force_n"] = table_of(results, 3, [](const Result& r) { return r.best_force_n; });
  made["unseen"] = column<double>(results, [](const Result& r) { return r.unseen; });
  made["trials"] = column<std::int64_t>(results, [](const Result& r) { return r.trials; });
  std::vector<std::string> directions;
  for (const libgtd::PullDirection& direction : libgtd::pull_directions())
    directions.push_back(direction.name());
  made["directions"] = directions;
  made["pull_limits_n"] =
      options.pull_limits ? py::object(table_of(results, directions.size(),
                                                [](const Result& r) { return r.pull_limits_n; }))
                          : py::none();
  made["columns"] = cells_of(results, options.extra_loads_n);
  return made;
}

py::dict grasp(const libmap::TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& points,
               const py::object& surface_error, const std::vector<double>& extra_loads_n,
               bool sequential, bool pull_limits, const py::dict& values,
               const py::object& progress, unsigned threads) {
  GraspOptions options = options_from<GraspOptions>(values);
  options.trials.extra_loads_n = extra_loads_n;
  options.trials.sequential = sequential;
  options.trials.pull_limits = pull_limits;
  options.trials.check();
  const libgtd::Gripper gripper = libgtd::find_gripper(options.gripper, options.overrides);
  const libgtd::Ground ground(mesh, errors_of(mesh, surface_error, options.trials.surface));
  const Results results = run(threads, progress, [&](libmap::Progress& bar) {
    return libgtd::test_grasps(ground, gripper, points, options.trials, bar);
  });
  return results_of(results, options.trials);
}

}  // namespace

void add_grasps(py::module_& module) {
  define(module, "grasp", &grasp,
         {"mesh", "points", "surface_error", "more_loads_n", "sequential", "pull_limits", "options",
          "progress", "threads"});
  add_stage<GraspOptions>("grasp");
}

}  // namespace graspmap_python
