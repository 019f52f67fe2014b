// Conversions between Python and the libraries: arrays, options, errors, progress.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/Core>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parallel.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"

namespace graspmap_python {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

// A read-only array on memory of `owner`, which lives as long as the array does. Strides in bytes;
// none: rows one after the other.
template <typename Number>
py::array view(const Number* data, Shape shape, py::handle owner, Shape strides = {}) {
  py::array array(py::dtype::of<Number>(), std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

// Gets `view_of` a member of an object, which lives as long as the view does.
template <typename Object, typename Member, typename ViewOf>
auto viewing(Member Object::*member, ViewOf view_of) {
  return [=](const py::object& self) { return view_of(self.cast<Object&>().*member, self); };
}

// An array of one number for each item.
template <typename Number, typename Items, typename NumberOf>
py::array_t<Number> column(const Items& items, const NumberOf& number_of) {
  py::array_t<Number> array(static_cast<py::ssize_t>(items.size()));
  Number* to = array.mutable_data();
  for (const auto& item : items) *to++ = static_cast<Number>(number_of(item));
  return array;
}

inline Shape rows(std::size_t count, py::ssize_t width) {
  return {static_cast<py::ssize_t>(count), width};
}

// Error of a parameter whose value has a wrong type or shape.
libmap::Error wrong_value(py::handle given, const std::string& name, const std::string& bound);

// Throws Error for the first of `others`, keywords that no parameter has, or else for the first of
// `missing`, parameters without a value.
void check_names(const std::vector<std::string>& parameters, const std::vector<std::string>& others,
                 const std::vector<std::string>& missing);

// Bound of a name, as in "one of a b".
std::string one_of(const std::vector<std::string>& names);

// Types of numbers: NumPy's letters, and their size (0: any).
struct Numbers {
  std::string_view kinds;
  py::ssize_t bytes = 0;
};
constexpr Numbers byte_numbers = {"u", 1}, whole_numbers = {"iu"}, real_numbers = {"iuf"};
constexpr Numbers indices_or_truth = {"biu"}, real_or_truth = {"biuf"};
constexpr py::ssize_t any_length = -1;

// The array itself after a check of its type and shape.
py::array checked_array(const py::object& given, const std::string& name, const Numbers& numbers,
                        const Shape& shape, const std::string& bound);
template <typename Number>
auto array_from(const py::object& given, const std::string& name, const Numbers& numbers,
                const Shape& shape, const std::string& bound) {
  return py::array_t<Number, py::array::c_style | py::array::forcecast>::ensure(
      checked_array(given, name, numbers, shape, bound));
}

enum class Finite { required, any };
std::vector<Eigen::Vector3d> positions_from(const py::object& given, const std::string& name,
                                            Finite finite = Finite::required,
                                            const std::string& bound = "numbers of shape (N, 3)");
Eigen::Vector3d vector_from(const py::object& given, const std::string& name);
libmap::Pose pose_from(const py::object& given, const std::string& name);  // 4 x 4, rigid
py::array matrix_of(const libmap::Pose& pose);

// Sets the table's parameters by their keys; a dict in a dict is a section, as in YAML. Throws what
// ParameterTable::set throws, and Error for a value that is no truth value, number or text.
void set_options(const libmap::ParameterTable& table, const py::dict& values);

template <typename Options>
Options options_from(const py::dict& values, Options options = {}) {
  libmap::ParameterTable table;
  bind(table, options);
  set_options(table, values);
  return options;
}

// By key; none is None.
py::dict dict_of(const libmap::ResultTable& table);

// One dict for each parameter: key, type, default, choices, description; for each result: key,
// type, description.
py::list list_of(const libmap::ParameterTable& table);
py::list list_of(const libmap::ResultTable& table, const std::vector<std::string>& objects);

struct Stage {
  std::string name;
  std::function<py::list()> options;
  std::function<py::list()> results;
};
std::vector<Stage>& stages();
// `objects`: described results that Python has as something else than a number or a text.
template <typename Options, typename... Results>
void add_stage(const std::string& name, const std::vector<std::string>& objects = {}) {
  const auto options = [] {
    Options defaults;
    libmap::ParameterTable table;
    bind(table, defaults);
    return list_of(table);
  };
  const auto results = [objects] {
    libmap::ResultTable table;
    (table.append("", libmap::described(Results{})), ...);
    return list_of(table, objects);
  };
  stages().push_back({name, options, results});
}

// Calls callback(stage, done, total) when a stage begins, at most ten times a second, and when it
// ends; sees to Ctrl-C. What the callback raises ends the work.
class CallProgress : public libmap::Progress {
 public:
  explicit CallProgress(py::object callback) : callback_(std::move(callback)) {}
  void begin(std::string_view stage, std::size_t total) override;
  void advance(std::size_t steps) override;
  void end() override;

 private:
  void call();

  py::object callback_;  // may be None
  std::mutex mutex_;
  std::string stage_;
  std::size_t total_ = 0;
  std::size_t done_ = 0;
  std::chrono::steady_clock::time_point last_call_{};
};

// step(progress) without the interpreter's lock, on at most `threads` threads (0: all).
template <typename Step>
auto run(unsigned threads, const py::object& callback, const Step& step) {
  constexpr unsigned max_threads = 4096;
  if (threads > max_threads)
    throw libmap::Error(
        "not a number of threads",
        {.field = "threads", .value = std::to_string(threads), .bound = ">= 0 and <= 4096"});
  if (!callback.is_none() && PyCallable_Check(callback.ptr()) == 0)
    throw wrong_value(callback, "progress", "None or a function of (stage, done, total)");
  CallProgress progress(callback);
  const py::gil_scoped_release released;
  const libmap::ThreadLimit limit(threads);
  return step(progress);
}

template <typename Step>
auto without_lock(const Step& step) {
  const py::gil_scoped_release released;
  return step();
}

// write(temporary) writes the file, which appears whole or not at all. Throws Error where a
// manifest is beside it: that would go on saying how an earlier output was made.
template <typename Write>
void write_whole(const std::filesystem::path& path, const Write& write) {
  if (std::filesystem::exists(libmap::manifest_path(path)))
    throw libmap::Error("an earlier output has a manifest there: remove both, or write elsewhere",
                        {.file = libmap::manifest_path(path).string()});
  without_lock([&] {
    libmap::OutputFile output(path);
    write(output.temporary_path());
    output.commit();
  });
}

template <typename T>
std::shared_ptr<T> shared(T&& value) {
  return std::make_shared<T>(std::forward<T>(value));
}

py::dict numbers_of(const std::vector<std::pair<std::string, double>>& numbers);

// libmap::Error becomes graspmap.Error.
void translate_errors();

// The module's parts.
void add_shapes(py::module_& module);    // Cloud, Mesh, their files and manifests
void add_scans(py::module_& module);     // Scan, Frame, Camera, Poses, refine, fuse
void add_surfaces(py::module_& module);  // estimate_normals, mesh, resample
void add_maps(py::module_& module);      // score, lookup, footholds, evaluate
void add_grasps(py::module_& module);    // grasp
void add_images(py::module_& module);    // render, to_png

}  // namespace graspmap_python
