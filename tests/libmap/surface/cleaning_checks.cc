#include "tests/libmap/surface/cleaning_checks.h"

#include <algorithm>
#include <stdexcept>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/mesh_report.h"
#include "tests/libmap/scenes/mesh_topology.h"

namespace graspmap_test {

using libmap::clean_mesh;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::MeshReport;
using libmap::report_mesh;
using libmap::TriangleMesh;

MeshCleaningOptions repairs() { return {.min_island_area_m2 = 0.0, .max_hole_m = 0.0}; }

MeshCleaningOptions holes_up_to(double diameter_m) {
  MeshCleaningOptions options = repairs();
  options.max_hole_m = diameter_m;
  return options;
}

TriangleMesh mesh_of(std::vector<Eigen::Vector3d> vertices,
                     std::vector<libmap::Triangle> triangles) {
  TriangleMesh mesh;
  mesh.vertices = std::move(vertices);
  mesh.triangles = std::move(triangles);
  return mesh;
}

TriangleMesh with_values(TriangleMesh mesh) {
  libmap::ScalarField height{"height", libmap::ScalarType::float64, {}};
  libmap::ScalarField label{"label", libmap::ScalarType::int32, {}};
  for (const Eigen::Vector3d& v : mesh.vertices) {
    height.values.push_back(v.z() + 2.0 * v.x());
    label.values.push_back(v.x() > 0.0 ? 7.0 : -3.0);
    const auto red = static_cast<std::uint8_t>(std::clamp(128.0 + 60.0 * v.x(), 0.0, 255.0));
    mesh.vertex_colors.push_back({red, 50, 200});
  }
  mesh.vertex_fields = {height, label};
  libmap::ScalarField number{"number", libmap::ScalarType::uint32, {}};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    number.values.push_back(static_cast<double>(t));
  mesh.face_fields = {number};
  return mesh;
}

const libmap::ScalarField& field_of(const std::vector<libmap::ScalarField>& fields,
                                    const std::string& name) {
  for (const libmap::ScalarField& field : fields)
    if (field.name == name) return field;
  throw std::runtime_error("no field " + name);
}

TriangleMesh kept_where(const TriangleMesh& mesh,
                        const std::function<bool(const Eigen::Vector3d&)>& keep) {
  std::vector<bool> marks;
  for (const libmap::Triangle& t : mesh.triangles)
    marks.push_back(keep((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3.0));
  return libmap::select_triangles(mesh, marks);
}

testing::AssertionResult same_geometry(const TriangleMesh& a, const TriangleMesh& b) {
  if (a.triangles != b.triangles)
    return testing::AssertionFailure()
           << "triangles differ: " << a.triangles.size() << ", " << b.triangles.size();
  if (a.vertices != b.vertices) return testing::AssertionFailure() << "vertices differ";
  return testing::AssertionSuccess();
}

testing::AssertionResult same_mesh(const TriangleMesh& a, const TriangleMesh& b) {
  if (const auto same = same_geometry(a, b); !same) return same;
  if (a.vertex_normals != b.vertex_normals || a.vertex_colors != b.vertex_colors)
    return testing::AssertionFailure() << "normals or colors differ";
  if (a.vertex_fields != b.vertex_fields || a.face_fields != b.face_fields)
    return testing::AssertionFailure() << "fields differ";
  return testing::AssertionSuccess();
}

void expect_clean(const TriangleMesh& mesh) {
  EXPECT_NO_THROW(mesh.check());
  const MeshReport report = report_mesh(mesh);
  EXPECT_EQ(report.non_manifold_edges, 0U);
  EXPECT_EQ(report.non_manifold_vertices, 0U);
  EXPECT_EQ(report.misoriented_edges, 0U);
  EXPECT_EQ(report.degenerate_triangles, 0U);
  EXPECT_EQ(report.duplicate_triangles, 0U);
  EXPECT_EQ(report.unused_vertices, 0U);
  EXPECT_EQ(report.self_intersections, 0U);
  const auto topology = topology_of(mesh.vertices.size(), mesh.triangles);
  EXPECT_EQ(topology.bad_edges, 0U);
  EXPECT_EQ(topology.unused_vertices, 0U);
  EXPECT_EQ(topology.parts, report.components);
  EXPECT_EQ(topology.open_edges, report.boundary_edges);
  EXPECT_EQ(mesh.vertex_normals.size(), mesh.vertices.size());
  EXPECT_EQ(field_of(mesh.face_fields, "filled").values.size(), mesh.triangles.size());
}

MeshCleaningResult cleaned(const TriangleMesh& mesh, const MeshCleaningOptions& options) {
  MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  const MeshCleaningResult again = clean_mesh(result.mesh, options);
  EXPECT_TRUE(same_mesh(again.mesh, result.mesh));
  EXPECT_EQ(again.merged_vertices + again.split_vertices + again.intersecting_triangles, 0U);
  return result;
}

}  // namespace graspmap_test
