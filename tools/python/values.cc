#include "tools/python/values.h"

#include <filesystem>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace graspmap_python {

namespace {

constexpr auto time_between_calls = std::chrono::milliseconds(100);

std::string short_repr(py::handle value) {
  constexpr std::size_t longest = 60;
  std::string text = py::repr(value).cast<std::string>();
  for (char& c : text)
    if (c == '\n') c = ' ';
  return text.size() <= longest ? text : text.substr(0, longest) + "...";
}

std::string text_of(const std::string& key, py::handle value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (py::isinstance<py::int_>(value)) return py::str(value).cast<std::string>();
  if (py::isinstance<py::float_>(value)) return libmap::to_text(value.cast<double>());
  if (py::isinstance(value, py::module_::import("numpy").attr("generic")))
    return text_of(key, value.attr("item")());
  throw libmap::Error(
      "is no value of an option",
      {.field = key, .value = short_repr(value), .bound = "a truth value, a number or a text"});
}

void set_section(const libmap::ParameterTable& table, const std::string& prefix,
                 const py::dict& values) {
  for (const auto& [name, value] : values) {
    const std::string key = prefix + py::str(name).cast<std::string>();
    if (py::isinstance<py::dict>(value))
      set_section(table, key + ".", py::reinterpret_borrow<py::dict>(value));
    else
      table.set(key, text_of(key, value));
  }
}

void raise_in_python(const libmap::Error& error) {
  const libmap::ErrorContext& context = error.context();
  const py::object type = py::module_::import("graspmap._error").attr("Error");
  const bool is_bad_input = error.kind() == libmap::ErrorKind::bad_input;
  const py::object raised =
      type(error.what(), error.reason(), context.file, context.field, context.value, context.bound,
           is_bad_input ? "bad_input" : "failed");
  PyErr_SetObject(type.ptr(), raised.ptr());
}

const char* type_name(libmap::ParameterType type) {
  switch (type) {
    case libmap::ParameterType::boolean:
      return "bool";
    case libmap::ParameterType::integer:
      return "int";
    case libmap::ParameterType::real:
      return "float";
    case libmap::ParameterType::text:
      break;
  }
  return "str";
}

}  // namespace

py::array checked_array(const py::object& given, const std::string& field, const std::string& kinds,
                        const std::string& bound, py::ssize_t columns) {
  const py::array array = py::array::ensure(given);
  if (!array) {
    PyErr_Clear();
    throw libmap::Error("is no array",
                        {.field = field, .value = short_repr(given), .bound = bound});
  }
  const bool has_shape =
      columns == 0 ? array.ndim() == 1 : array.ndim() == 2 && array.shape(1) == columns;
  if (has_shape && kinds.find(array.dtype().kind()) != std::string::npos) return array;
  const std::string shape = py::str(array.attr("shape")).cast<std::string>();
  const std::string type = py::str(array.dtype()).cast<std::string>();
  throw libmap::Error(
      "wrong shape or type",
      {.field = field, .value = "of shape " + shape + " and type " + type, .bound = bound});
}

std::vector<Eigen::Vector3d> positions_from(const py::object& given, const std::string& field,
                                            Finite finite) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(
      checked_array(given, field, "iuf", "numbers of shape (N, 3)", 3));
  std::vector<Eigen::Vector3d> positions(static_cast<std::size_t>(array.shape(0)));
  const double* from = array.data();
  for (std::size_t row = 0; row < positions.size(); ++row, from += 3) {
    positions[row] = Eigen::Vector3d(from[0], from[1], from[2]);
    if (finite == Finite::required && !positions[row].allFinite())
      throw libmap::Error("x, y and z must be finite",
                          {.field = field + ", row " + std::to_string(row)});
  }
  return positions;
}

Eigen::Vector3d vector_from(const py::object& given, const std::string& field) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(
      checked_array(given, field, "iuf", "three numbers", 0));
  if (array.size() != 3)
    throw libmap::Error("wrong shape", {.field = field,
                                        .value = "of " + std::to_string(array.size()) + " numbers",
                                        .bound = "three numbers"});
  return {array.at(0), array.at(1), array.at(2)};
}

libmap::Pose pose_from(const py::object& given, const std::string& field) {
  const char* const bound = "a rigid transform of shape (4, 4)";
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(
      checked_array(given, field, "iuf", bound, 4));
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
  if (array.shape(0) == 4)
    matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool is_rigid = matrix.allFinite() && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
                        (rotation * rotation.transpose()).isIdentity(1e-6) &&
                        rotation.determinant() > 0.0;
  if (!is_rigid) throw libmap::Error("is none", {.field = field, .value = {}, .bound = bound});
  libmap::Pose pose;
  pose.matrix() = matrix;
  return pose;
}

py::array matrix_of(const libmap::Pose& pose) {
  py::array_t<double> array({4, 4});
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.mutable_data()) = pose.matrix();
  return array;
}

void set_options(const libmap::ParameterTable& table, const py::dict& values) {
  set_section(table, "", values);
}

py::dict dict_of(const libmap::ResultTable& table) {
  py::dict dict;
  for (const libmap::NamedResult& result : table.results()) {
    py::object value = py::cast(result.value);
    if (py::isinstance<py::list>(value)) value = py::tuple(value);
    dict[result.key.c_str()] = value;
  }
  return dict;
}

py::list list_of(const libmap::ResultTable& table, const std::vector<std::string>& objects) {
  constexpr std::array types = {"bool", "int", "float", "str", "tuple[float, ...]"};
  static_assert(types.size() == std::variant_size_v<libmap::ManifestValue>);
  py::list list;
  for (const libmap::NamedResult& result : table.results()) {
    if (std::find(objects.begin(), objects.end(), result.key) != objects.end()) continue;
    py::dict one;
    one["key"] = result.key;
    one["type"] = std::string(types.at(result.type.index())) + (result.may_be_absent ? " | None" : "");
    one["description"] = result.description;
    list.append(one);
  }
  return list;
}

py::list list_of(const libmap::ParameterTable& table) {
  py::list list;
  for (const libmap::Parameter& parameter : table.parameters()) {
    py::dict one;
    one["key"] = parameter.key;
    one["type"] = type_name(parameter.type);
    one["default"] = parameter.get();
    one["choices"] = parameter.choices;
    one["description"] = parameter.description;
    list.append(one);
  }
  return list;
}

std::vector<Stage>& stages() {
  static std::vector<Stage> all;
  return all;
}

void CallProgress::begin(std::string_view stage, std::size_t total) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  total_ = total;
  done_ = 0;
  call();
}

void CallProgress::advance(std::size_t steps) {
  const std::lock_guard lock(mutex_);
  done_ += steps;
  if (std::chrono::steady_clock::now() - last_call_ >= time_between_calls) call();
}

void CallProgress::end() {
  const std::lock_guard lock(mutex_);
  if (!stage_.empty()) call();
  stage_.clear();
}

// Nobody waits for the mutex with the interpreter's lock in hand.
void CallProgress::call() {
  const py::gil_scoped_acquire acquired;
  last_call_ = std::chrono::steady_clock::now();
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  if (!callback_.is_none()) callback_(stage_, done_, total_);
}

py::dict numbers_of(const std::vector<std::pair<std::string, double>>& numbers) {
  py::dict dict;
  for (const auto& [name, number] : numbers) dict[name.c_str()] = number;
  return dict;
}

void translate_errors() {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const libmap::Error& error) {
      raise_in_python(error);
    } catch (const std::filesystem::filesystem_error& error) {
      raise_in_python(libmap::Error(error.code().message(), {.file = error.path1().string()}));
    }
  });
}

}  // namespace graspmap_python
