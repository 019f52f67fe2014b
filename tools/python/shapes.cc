#include <algorithm>

#include "class_documentation.h"
#include "libmap/core/error.h"
#include "libmap/core/manifest.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

namespace fs = std::filesystem;
using libmap::PointCloud;
using libmap::ScalarField;
using libmap::ScalarType;
using libmap::TriangleMesh;

// NumPy's name of each ScalarType, in the order of the enumeration.
constexpr const char* type_names[] = {"int8",  "uint8",  "int16",   "uint16",
                                      "int32", "uint32", "float32", "float64"};

py::object normals_of(const std::vector<Eigen::Vector3f>& normals, py::handle owner) {
  if (normals.empty()) return py::none();
  return view(normals.front().data(), rows(normals.size(), 3), owner);
}

py::object colors_of(const std::vector<libmap::Color>& colors, py::handle owner) {
  if (colors.empty()) return py::none();
  return view(colors.front().data(), rows(colors.size(), 3), owner);
}

py::array positions_of(const std::vector<Eigen::Vector3d>& positions, py::handle owner) {
  const double* data = positions.empty() ? nullptr : positions.front().data();
  return view(data, rows(positions.size(), 3), owner);
}

py::array triangles_of(const std::vector<libmap::Triangle>& triangles, py::handle owner) {
  const std::uint32_t* data = triangles.empty() ? nullptr : triangles.front().data();
  return view(data, rows(triangles.size(), 3), owner);
}

py::dict fields_of(const std::vector<ScalarField>& fields, py::handle owner) {
  py::dict dict;
  for (const ScalarField& field : fields)
    dict[field.name.c_str()] =
        view(field.values.data(), {static_cast<py::ssize_t>(field.values.size())}, owner);
  return dict;
}

py::dict types_of(const std::vector<ScalarField>& fields) {
  py::dict dict;
  for (const ScalarField& field : fields)
    dict[field.name.c_str()] = type_names[static_cast<std::size_t>(field.type)];
  return dict;
}

std::vector<Eigen::Vector3f> normals_from(const py::object& given, const std::string& name) {
  std::vector<Eigen::Vector3f> normals;
  if (given.is_none()) return normals;
  for (const Eigen::Vector3d& normal : positions_from(given, name, Finite::any))
    normals.push_back(normal.cast<float>());
  return normals;
}

std::vector<libmap::Color> colors_from(const py::object& given, const std::string& name) {
  std::vector<libmap::Color> colors;
  if (given.is_none()) return colors;
  const auto bytes =
      array_from<std::uint8_t>(given, name, byte_numbers, {any_length, 3}, "uint8 of shape (N, 3)");
  colors.resize(static_cast<std::size_t>(bytes.shape(0)));
  std::copy_n(bytes.data(), bytes.size(), colors.empty() ? nullptr : colors.front().data());
  return colors;
}

ScalarType type_of(const py::array& array) {
  const std::string name = py::str(array.dtype()).cast<std::string>();
  const auto* const found = std::find(std::begin(type_names), std::end(type_names), name);
  if (found != std::end(type_names)) return static_cast<ScalarType>(found - std::begin(type_names));
  if (name == "bool") return ScalarType::uint8;
  // Other integers become float64, because cloud files have no 64-bit integers.
  return array.dtype().kind() == 'f' ? ScalarType::float32 : ScalarType::float64;
}

std::vector<ScalarField> fields_from(const py::dict& given) {
  std::vector<ScalarField> fields;
  for (const auto& [name, values] : given) {
    ScalarField& field = fields.emplace_back();
    field.name = py::str(name).cast<std::string>();
    const py::array array =
        checked_array(py::reinterpret_borrow<py::object>(values), "field " + field.name,
                      real_or_truth, {any_length}, "numbers of shape (N,)");
    field.type = type_of(array);
    const auto numbers =
        py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
    field.values.assign(numbers.data(), numbers.data() + numbers.size());
  }
  return fields;
}

std::shared_ptr<PointCloud> make_cloud(const py::object& positions, const py::object& normals,
                                       const py::object& colors, const py::dict& fields,
                                       const std::optional<libmap::Pose>& viewpoint) {
  PointCloud cloud;
  cloud.positions = positions_from(positions, "positions");
  cloud.normals = normals_from(normals, "normals");
  cloud.colors = colors_from(colors, "colors");
  cloud.fields = fields_from(fields);
  if (viewpoint) cloud.viewpoint = *viewpoint;
  cloud.check();
  return shared(std::move(cloud));
}

std::vector<libmap::Triangle> triangles_from(const py::object& given, const std::string& name) {
  const auto array = array_from<std::int64_t>(given, name, whole_numbers, {any_length, 3},
                                              "whole numbers of shape (T, 3)");
  std::vector<libmap::Triangle> triangles(static_cast<std::size_t>(array.shape(0)));
  const std::int64_t* from = array.data();
  for (libmap::Triangle& triangle : triangles)
    for (std::uint32_t& corner : triangle) {
      if (*from < 0 || *from > std::numeric_limits<std::uint32_t>::max())
        throw libmap::Error(
            "not an index of a vertex",
            {.field = name, .value = std::to_string(*from), .bound = ">= 0 and < 2^32"});
      corner = static_cast<std::uint32_t>(*from++);
    }
  return triangles;
}

std::shared_ptr<TriangleMesh> make_mesh(const py::object& vertices, const py::object& triangles,
                                        const py::object& normals, const py::object& colors,
                                        const py::dict& vertex_fields,
                                        const py::dict& face_fields) {
  TriangleMesh mesh;
  mesh.vertices = positions_from(vertices, "vertices");
  mesh.triangles = triangles_from(triangles, "triangles");
  mesh.vertex_normals = normals_from(normals, "vertex_normals");
  mesh.vertex_colors = colors_from(colors, "vertex_colors");
  mesh.vertex_fields = fields_from(vertex_fields);
  mesh.face_fields = fields_from(face_fields);
  mesh.check();
  return shared(std::move(mesh));
}

std::shared_ptr<PointCloud> selected(const PointCloud& cloud, const py::object& which) {
  const py::ssize_t size = static_cast<py::ssize_t>(cloud.size());
  const char* const bound = "a slice, a truth value for each point, or whole numbers of shape (K,)";
  const py::module_ numpy = py::module_::import("numpy");
  const py::object numbers_of_slice =
      py::isinstance<py::slice>(which) ? numpy.attr("arange")(size)[which] : which;
  py::array array = checked_array(numbers_of_slice, "index", indices_or_truth, {any_length}, bound);
  if (array.dtype().kind() == 'b') {
    if (array.size() != size)
      throw libmap::Error(
          "number of truth values differs from number of points",
          {.field = "index", .value = std::to_string(array.size()), .bound = std::to_string(size)});
    array = numpy.attr("flatnonzero")(array);
  }
  const auto numbers =
      py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  std::vector<std::size_t> indices;
  for (py::ssize_t n = 0; n < numbers.size(); ++n) {
    const std::int64_t index = numbers.at(n) < 0 ? numbers.at(n) + size : numbers.at(n);
    if (index < 0 || index >= size)
      throw py::index_error("index " + std::to_string(numbers.at(n)) + " of a cloud of " +
                            std::to_string(size) + " points");
    indices.push_back(static_cast<std::size_t>(index));
  }
  return shared(libmap::select_points(cloud, indices));
}

std::shared_ptr<PointCloud> transformed(const PointCloud& cloud, const libmap::Pose& pose) {
  return shared(libmap::transform_cloud(cloud, pose));
}

void add_cloud(py::module_& module) {
  py::class_<PointCloud, std::shared_ptr<PointCloud>> cloud(module, "Cloud", documentation::cloud);
  define_constructor(cloud, &make_cloud, py::arg("positions"), py::arg("normals") = py::none(),
                     py::arg("colors") = py::none(), py::arg("fields") = py::dict(),
                     py::arg("viewpoint") = py::none());
  cloud
      .def_property_readonly("positions", viewing(&PointCloud::positions, positions_of),
                             documentation::cloud_positions)
      .def_property_readonly("normals", viewing(&PointCloud::normals, normals_of),
                             documentation::cloud_normals)
      .def_property_readonly("colors", viewing(&PointCloud::colors, colors_of),
                             documentation::cloud_colors)
      .def_property_readonly("fields", viewing(&PointCloud::fields, fields_of),
                             documentation::cloud_fields)
      .def_property_readonly(
          "field_types", [](const PointCloud& self) { return types_of(self.fields); },
          documentation::cloud_field_types)
      .def_property_readonly(
          "viewpoint", [](const PointCloud& self) { return matrix_of(self.viewpoint); },
          documentation::cloud_viewpoint)
      .def("__len__", &PointCloud::size, documentation::cloud_len);
  define_method(cloud, "transformed", &transformed, documentation::cloud_transformed,
                py::arg("target_from_source"));
  define_method(cloud, "__getitem__", &selected, documentation::cloud_getitem, py::arg("index"));
}

void add_mesh(py::module_& module) {
  py::class_<TriangleMesh, std::shared_ptr<TriangleMesh>> mesh(module, "Mesh", documentation::mesh);
  define_constructor(mesh, &make_mesh, py::arg("vertices"), py::arg("triangles"),
                     py::arg("vertex_normals") = py::none(), py::arg("vertex_colors") = py::none(),
                     py::arg("vertex_fields") = py::dict(), py::arg("face_fields") = py::dict());
  mesh.def_property_readonly("vertices", viewing(&TriangleMesh::vertices, positions_of),
                             documentation::mesh_vertices)
      .def_property_readonly("triangles", viewing(&TriangleMesh::triangles, triangles_of),
                             documentation::mesh_triangles)
      .def_property_readonly("vertex_normals", viewing(&TriangleMesh::vertex_normals, normals_of),
                             documentation::mesh_vertex_normals)
      .def_property_readonly("vertex_colors", viewing(&TriangleMesh::vertex_colors, colors_of),
                             documentation::mesh_vertex_colors)
      .def_property_readonly("vertex_fields", viewing(&TriangleMesh::vertex_fields, fields_of),
                             documentation::mesh_vertex_fields)
      .def_property_readonly("face_fields", viewing(&TriangleMesh::face_fields, fields_of),
                             documentation::mesh_face_fields)
      .def_property_readonly("area_m2", &libmap::surface_area, documentation::mesh_area_m2);
}

}  // namespace

std::shared_ptr<PointCloud> cloud_from(const py::object& given, const std::string& name,
                                       const std::string& bound) {
  if (py::isinstance<PointCloud>(given)) return given.cast<std::shared_ptr<PointCloud>>();
  PointCloud cloud;
  cloud.positions = positions_from(given, name, Finite::required, bound);
  return shared(std::move(cloud));
}

bool is_pair_of_tables(const py::object& given) {
  if (!py::isinstance<py::tuple>(given) && !py::isinstance<py::list>(given)) return false;
  if (py::len(given) != 2) return false;
  for (const py::handle part : given) {
    const auto array = py::array::ensure(part);
    PyErr_Clear();
    if (!array || array.ndim() != 2) return false;
  }
  return true;
}

Kept<TriangleMesh> Argument<TriangleMesh>::from(const py::object& given, const std::string& name) {
  if (py::isinstance<TriangleMesh>(given)) return {given.cast<std::shared_ptr<TriangleMesh>>()};
  if (!is_pair_of_tables(given))
    throw wrong_value(given, name, "a Mesh, or vertices (V, 3) and triangles (T, 3)");
  return {libmap::in_field(name, [&] {
    TriangleMesh mesh;
    mesh.vertices = positions_from(given[py::int_(0)], "vertices");
    mesh.triangles = triangles_from(given[py::int_(1)], "triangles");
    mesh.check();
    return shared(std::move(mesh));
  })};
}

void add_shapes(py::module_& module) {
  add_cloud(module);
  add_mesh(module);
  const auto read_cloud = [](const fs::path& path) {
    return without_lock([&] { return shared(libmap::read_cloud(path).cloud); });
  };
  const auto read_mesh = [](const fs::path& path) {
    return without_lock([&] { return shared(libmap::read_mesh(path).mesh); });
  };
  const auto write_cloud = [](const fs::path& path, const PointCloud& cloud) {
    libmap::require_cloud_format(path);
    write_whole(path, [&](const fs::path& file) { libmap::write_cloud(file, cloud); });
  };
  const auto write_mesh = [](const fs::path& path, const TriangleMesh& mesh) {
    libmap::require_mesh_format(path);
    write_whole(path, [&](const fs::path& file) { libmap::write_mesh(file, mesh); });
  };
  const auto read_manifest = [](const fs::path& path) -> std::optional<std::string> {
    const auto manifest = libmap::read_manifest_of(path);
    if (!manifest) return std::nullopt;
    return libmap::to_json(*manifest);
  };
  define(module, "read_cloud", +read_cloud, {"path"});
  define(module, "read_mesh", +read_mesh, {"path"});
  define(module, "write_cloud", +write_cloud, {"path", "cloud"});
  define(module, "write_mesh", +write_mesh, {"path", "mesh"});
  define(module, "read_manifest", +read_manifest, {"path"});
}

}  // namespace graspmap_python
