// Converts values between Python and the libraries: arrays, options, results, errors, progress, and
// arguments of calls. Errors name the parameter.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parallel.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/triangle_mesh.h"

namespace graspmap_python {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

// Returns a read-only array of the numbers at `data`, which `owner` owns and the array keeps alive.
// `strides`: bytes per step along each axis; empty: dense, row by row.
template <typename Number>
py::array view(const Number* data, Shape shape, py::handle owner, Shape strides = {}) {
  py::array array(py::dtype::of<Number>(), std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

// Returns a property getter: view_of(object.*member, object), for example a call of view().
template <typename Object, typename Member, typename ViewOf>
auto viewing(Member Object::*member, ViewOf view_of) {
  return [=](const py::object& self) { return view_of(self.cast<Object&>().*member, self); };
}

// Returns the array of number_of(item) for each of `items`.
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

// Returns the error of a parameter whose value `given` has a wrong type or shape.
libmap::Error wrong_value(py::handle given, const std::string& name, const std::string& bound);

// Throws Error for the first of `others`, keywords that are not names of `parameters`, or else for
// the first of `missing`, required parameters without a value.
void check_names(const std::vector<std::string>& parameters, const std::vector<std::string>& others,
                 const std::vector<std::string>& missing);

// Returns the bound "one of NAME NAME ...".
std::string one_of(const std::vector<std::string>& names);

// Accepted types of an array: NumPy's kind letters, and the size of a number in bytes (0: any).
struct Numbers {
  std::string_view kinds;
  py::ssize_t bytes = 0;
};
constexpr Numbers byte_numbers = {"u", 1}, whole_numbers = {"iu"}, real_numbers = {"iuf"};
constexpr Numbers indices_or_truth = {"biu"}, real_or_truth = {"biuf"};
constexpr py::ssize_t any_length = -1;

// Returns `given` as an array. Throws Error with `name` and `bound` for another type or shape.
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

// Returns a dict of the results by key; a missing value is None.
py::dict dict_of(const libmap::ResultTable& table);

// Return one dict per parameter (key, type, default, choices, description), or per result (key,
// type, description) whose key is not in `objects`.
py::list list_of(const libmap::ParameterTable& table);
py::list list_of(const libmap::ResultTable& table, const std::vector<std::string>& objects);

struct Stage {
  std::string name;
  std::function<py::list()> options;
  std::function<py::list()> results;
};
std::vector<Stage>& stages();
// Registers a stage with its options and results for the documentation and the stubs. `objects`:
// keys of results that Python returns as objects, not as numbers or texts.
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

// Calls callback(stage, done, total) when a stage begins and ends, and between at most ten times a
// second. An exception of the callback, or KeyboardInterrupt after Ctrl-C, ends the work.
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

// Returns step(progress), called without the interpreter's lock on at most `threads` threads (0:
// all processors). Throws Error for more than 4096 threads or a callback that is not callable.
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

// Calls write(temporary), then moves the file to `path`. Throws Error if the path has a manifest,
// which would describe an earlier output.
template <typename Write>
void write_whole(const std::filesystem::path& path, const Write& write) {
  if (std::filesystem::exists(libmap::manifest_path(path)))
    throw libmap::Error("is the manifest of an earlier output; remove both, or write elsewhere",
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

// Registers the conversion of C++ errors of libraries and file system to graspmap.Error.
void translate_errors();

// Add classes and functions to the module.
void add_shapes(py::module_& module);    // Cloud, Mesh, their files and manifests
void add_scans(py::module_& module);     // Scan, Frame, Camera, Poses, refine, fuse
void add_surfaces(py::module_& module);  // estimate_normals, mesh, resample
void add_maps(py::module_& module);      // score, lookup, footholds, evaluate
void add_grasps(py::module_& module);    // grasp
void add_images(py::module_& module);    // render, to_png

// Argument that is an object of the module; the object lives at least as long as the call.
template <typename Object>
struct Kept {
  std::shared_ptr<Object> object;
  operator const Object&() const { return *object; }
};

template <typename T>
constexpr const char* bound_of() {
  if constexpr (std::is_same_v<T, bool>) return "True or False";
  if constexpr (std::is_unsigned_v<T>) return "a whole number >= 0";
  if constexpr (std::is_integral_v<T>) return "a whole number";
  if constexpr (std::is_floating_point_v<T>) return "a number";
  if constexpr (std::is_same_v<T, std::filesystem::path>) return "a path";
  return "a str";
}

// Argument<T>::from(given, name) converts an argument to a T, or to a Kept<T>. Throws Error with
// the parameter's name as field, the given value and the bound. This default converts numbers,
// texts and paths.
template <typename T>
struct Argument {
  static T from(const py::object& given, const std::string& name) {
    try {
      return given.cast<T>();
    } catch (const py::cast_error&) {
      throw wrong_value(given, name, bound_of<T>());
    }
  }
};

template <>
struct Argument<py::object> {
  static py::object from(const py::object& given, const std::string& /*name*/) { return given; }
};

template <>
struct Argument<py::dict> {
  static py::dict from(const py::object& given, const std::string& name) {
    if (!py::isinstance<py::dict>(given)) throw wrong_value(given, name, "a dict");
    return py::reinterpret_borrow<py::dict>(given);
  }
};

// Accepts only an object of a class of the module.
template <typename Object>
struct ObjectArgument {
  static Kept<Object> from(const py::object& given, const std::string& name) {
    if (py::isinstance<Object>(given)) return {given.cast<std::shared_ptr<Object>>()};
    const auto type_name = py::type::of<Object>().attr("__name__").template cast<std::string>();
    throw wrong_value(given, name, "an object of class " + type_name);
  }
};

constexpr const char* cloud_bound = "a Cloud, or numbers of shape (N, 3)";
std::shared_ptr<libmap::PointCloud> cloud_from(const py::object& given, const std::string& name,
                                               const std::string& bound = cloud_bound);
// Returns true for a tuple or list of two 2-D arrays, such as vertices and triangles.
bool is_pair_of_tables(const py::object& given);

// Accepts a Cloud, or an array of positions (N, 3).
template <>
struct Argument<libmap::PointCloud> {
  static Kept<libmap::PointCloud> from(const py::object& given, const std::string& name) {
    return {cloud_from(given, name)};
  }
};

// Accepts a Mesh, or a pair of vertices (V, 3) and triangles (T, 3).
template <>
struct Argument<libmap::TriangleMesh> {
  static Kept<libmap::TriangleMesh> from(const py::object& given, const std::string& name);
};

template <>
struct Argument<Eigen::Vector3d> {
  static constexpr auto from = vector_from;
};
template <>
struct Argument<libmap::Pose> {
  static constexpr auto from = pose_from;
};
template <>
struct Argument<std::vector<Eigen::Vector3d>> {
  static std::vector<Eigen::Vector3d> from(const py::object& given, const std::string& name) {
    return positions_from(given, name);
  }
};

// Converts each item of any iterable except a text.
template <typename T>
struct Argument<std::vector<T>> {
  static std::vector<T> from(const py::object& given, const std::string& name) {
    if (py::isinstance<py::str>(given) || !py::isinstance<py::iterable>(given))
      throw wrong_value(given, name, std::string("a list, each item ") + bound_of<T>());
    std::vector<T> items;
    for (const py::handle item : given)
      items.push_back(Argument<T>::from(py::reinterpret_borrow<py::object>(item),
                                        name + ", item " + std::to_string(items.size())));
    return items;
  }
};

// Accepts None, which becomes nullopt or nullptr, or a value of the type.
template <typename T>
struct Argument<std::optional<T>> {
  static std::optional<T> from(const py::object& given, const std::string& name) {
    if (given.is_none()) return std::nullopt;
    return Argument<T>::from(given, name);
  }
};
template <typename Object>
struct Argument<std::shared_ptr<Object>> {
  static std::shared_ptr<Object> from(const py::object& given, const std::string& name) {
    if (given.is_none()) return nullptr;
    return Argument<Object>::from(given, name).object;
  }
};

template <typename... Types, typename Function, std::size_t... At>
decltype(auto) call(const Function& function, const std::array<py::object, sizeof...(Types)>& given,
                    const std::array<const char*, sizeof...(Types)>& names,
                    std::index_sequence<At...> /*each*/) {
  // Braces convert the arguments in their order.
  const std::tuple<decltype(Argument<Types>::from(given[At], names[At]))...> arguments{
      Argument<Types>::from(given[At], names[At])...};
  return function(std::get<At>(arguments)...);
}

template <typename>
using Given = const py::object&;

// Default that marks a required parameter without an argument in the call.
inline py::object missing_value() { return py::reinterpret_borrow<py::object>(Py_NotImplemented); }
inline py::arg_v with_default(const py::arg& required) {
  return {required.name, missing_value(), "..."};
}
inline py::arg_v with_default(const py::arg_v& optional) { return optional; }

template <std::size_t count>
void check_given(const std::array<const char*, count>& names,
                 const std::array<py::object, count>& given, const py::kwargs& others) {
  std::vector<std::string> unknown;
  for (const auto& other : others) unknown.push_back(other.first.cast<std::string>());
  std::vector<std::string> missing;
  for (std::size_t n = 0; n < count; ++n)
    if (given[n].is(missing_value())) missing.emplace_back(names[n]);
  check_names({names.begin(), names.end()}, unknown, missing);
}

// Wraps a function for pybind11: checks the names of the arguments and converts their values.
template <typename Result, typename... Types>
auto checked(Result (*function)(Types...), std::array<const char*, sizeof...(Types)> names) {
  return [=](Given<Types>... given, const py::kwargs& others) -> Result {
    check_given<sizeof...(Types)>(names, {given...}, others);
    return call<std::remove_cvref_t<Types>...>(function, {given...}, names,
                                               std::index_sequence_for<Types...>{});
  };
}

// Wraps a method likewise; `self` has no name and is not converted.
template <typename Result, typename Self, typename... Types>
auto checked(Result (*method)(const Self&, Types...),
             std::array<const char*, sizeof...(Types)> names) {
  return [=](const Self& self, Given<Types>... given, const py::kwargs& others) -> Result {
    check_given<sizeof...(Types)>(names, {given...}, others);
    const auto bound = [&](const auto&... arguments) { return method(self, arguments...); };
    return call<std::remove_cvref_t<Types>...>(bound, {given...}, names,
                                               std::index_sequence_for<Types...>{});
  };
}

template <typename Result, typename... Types>
void define(py::module_& module, const char* name, Result (*function)(Types...),
            const std::array<const char*, sizeof...(Types)>& parameters) {
  module.def(name, checked(function, parameters));
}

// Each of `parameters` is a py::arg, which is required unless it has a default value.
template <typename Class, typename Method, typename... Parameters>
void define_method(Class& type, const char* name, Method method, const char* documentation,
                   const Parameters&... parameters) {
  const std::array<const char*, sizeof...(Parameters)> names{parameters.name...};
  type.def(name, checked(method, names), documentation, with_default(parameters)...);
}

template <typename Class, typename Function, typename... Parameters>
void define_constructor(Class& type, Function make, const Parameters&... parameters) {
  const std::array<const char*, sizeof...(Parameters)> names{parameters.name...};
  type.def(py::init(checked(make, names)), with_default(parameters)...);
}

}  // namespace graspmap_python
