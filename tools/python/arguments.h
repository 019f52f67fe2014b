// Conversion of a call's arguments from Python; errors name the parameter.
#pragma once

#include <array>
#include <tuple>
#include <type_traits>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"
#include "tools/python/values.h"

namespace graspmap_python {

// An argument of a type of the module, which lives during the call.
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

// from(given, name) converts an argument to a T, or to a Kept<T>. Throws Error with the parameter's
// name as field, the given value and the bound. Here: a number, a text or a path.
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

// An object of a class of the module, and nothing else.
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
// A tuple or list of two arrays of two dimensions, as vertices and triangles are.
bool is_pair_of_tables(const py::object& given);

// A Cloud, or its positions.
template <>
struct Argument<libmap::PointCloud> {
  static Kept<libmap::PointCloud> from(const py::object& given, const std::string& name) {
    return {cloud_from(given, name)};
  }
};

// A Mesh, or a pair of its vertices and its triangles.
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

// Any iterable but a text.
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

// None, or a T.
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

// The value of a required parameter that the call does not give.
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

// The function with its arguments as objects of Python.
template <typename Result, typename... Types>
auto checked(Result (*function)(Types...), std::array<const char*, sizeof...(Types)> names) {
  return [=](Given<Types>... given, const py::kwargs& others) -> Result {
    check_given<sizeof...(Types)>(names, {given...}, others);
    return call<std::remove_cvref_t<Types>...>(function, {given...}, names,
                                               std::index_sequence_for<Types...>{});
  };
}

// A method: its object is not an argument.
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

// Parameters are py::arg; those without a default value are required.
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
