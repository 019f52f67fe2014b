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

// Describes shape and type of an array, the value of a text or number, or the type of an object.
std::string outline(py::handle given) {
  if (py::hasattr(given, "shape") || py::isinstance<py::list>(given) ||
      py::isinstance<py::tuple>(given)) {
    const auto array = py::array::ensure(given);
    PyErr_Clear();
    if (array && array.ndim() > 0)
      return "of shape " + py::str(array.attr("shape")).cast<std::string>() + " and type " +
             py::str(array.dtype()).cast<std::string>();
  }
  if (given.is_none() || py::isinstance<py::str>(given) || PyNumber_Check(given.ptr()) != 0)
    return short_repr(given);
  return "of type " + py::type::of(given).attr("__name__").cast<std::string>();
}

bool has_shape(const py::array& array, const Shape& shape) {
  if (array.ndim() != static_cast<py::ssize_t>(shape.size())) return false;
  for (std::size_t n = 0; n < shape.size(); ++n)
    if (shape[n] != any_length && shape[n] != array.shape(static_cast<py::ssize_t>(n)))
      return false;
  return true;
}

std::string text_of(const std::string& key, py::handle value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "true" : "false";
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (py::isinstance<py::int_>(value)) return py::str(value).cast<std::string>();
  if (py::isinstance<py::float_>(value)) return libmap::to_text(value.cast<double>());
  if (py::isinstance(value, py::module_::import("numpy").attr("generic")))
    return text_of(key, value.attr("item")());
  throw libmap::Error(
      "not a value of an option",
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

libmap::Error wrong_value(py::handle given, const std::string& name, const std::string& bound) {
  return libmap::Error("wrong type or shape",
                       {.field = name, .value = outline(given), .bound = bound});
}

std::string one_of(const std::vector<std::string>& names) {
  std::string text = "one of";
  for (const std::string& name : names) text += " " + name;
  return text;
}

void check_names(const std::vector<std::string>& parameters, const std::vector<std::string>& others,
                 const std::vector<std::string>& missing) {
  if (!others.empty())
    throw libmap::Error("unknown parameter" + libmap::did_you_mean(others.front(), parameters),
                        {.field = others.front(), .bound = one_of(parameters)});
  if (!missing.empty()) throw libmap::Error("is missing", {.field = missing.front()});
}

py::array checked_array(const py::object& given, const std::string& name, const Numbers& numbers,
                        const Shape& shape, const std::string& bound) {
  py::array array = py::array::ensure(given);
  PyErr_Clear();
  if (!array || !has_shape(array, shape)) throw wrong_value(given, name, bound);
  const char kind = array.dtype().kind();
  const bool has_type = numbers.kinds.find(kind) != std::string_view::npos &&
                        (numbers.bytes == 0 || numbers.bytes == array.itemsize());
  // NumPy converts an empty list to float64, whatever type is required.
  if (has_type || (array.size() == 0 && kind == 'f')) return array;
  throw wrong_value(array, name, bound);
}

std::vector<Eigen::Vector3d> positions_from(const py::object& given, const std::string& name,
                                            Finite finite, const std::string& bound) {
  const auto array = array_from<double>(given, name, real_numbers, {any_length, 3}, bound);
  std::vector<Eigen::Vector3d> positions(static_cast<std::size_t>(array.shape(0)));
  const double* from = array.data();
  for (std::size_t row = 0; row < positions.size(); ++row, from += 3) {
    positions[row] = Eigen::Vector3d(from[0], from[1], from[2]);
    if (finite == Finite::required && !positions[row].allFinite())
      throw libmap::Error("x, y and z must be finite",
                          {.field = name + ", row " + std::to_string(row)});
  }
  return positions;
}

Eigen::Vector3d vector_from(const py::object& given, const std::string& name) {
  const auto array = array_from<double>(given, name, real_numbers, {3}, "three numbers");
  return {array.at(0), array.at(1), array.at(2)};
}

libmap::Pose pose_from(const py::object& given, const std::string& name) {
  const char* const bound = "a rigid transform of shape (4, 4)";
  const auto array = array_from<double>(given, name, real_numbers, {4, 4}, bound);
  libmap::Pose pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  const Eigen::Matrix3d rotation = pose.linear();
  const bool is_rigid =
      pose.matrix().allFinite() && pose.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
      (rotation * rotation.transpose()).isIdentity(1e-6) && rotation.determinant() > 0.0;
  if (!is_rigid) throw libmap::Error("not a rigid transform", {.field = name, .bound = bound});
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
    one["type"] =
        std::string(types.at(result.type.index())) + (result.may_be_absent ? " | None" : "");
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

// No thread waits for mutex_ while it holds the interpreter's lock, which would allow a deadlock.
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
