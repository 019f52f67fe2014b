#include "libmap/surface/mesh_components.h"

#include <gtest/gtest.h>

#include "tests/libmap/mesh/surface_samples.h"
#include "tests/support/test_support.h"

namespace mesh_components_test {

using graspmap_test::cubes_mesh;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;
using libmap::TriangleMesh;

TriangleMesh with_gaps(const TriangleMesh& mesh) {
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = uniform(0, 1) < 0.6;
  return libmap::select_triangles(mesh, keep);
}

void expect_those_of_a_hash_table(const TriangleMesh& mesh, std::size_t least) {
  const libmap::MeshComponents truth = libmap::connected_components(mesh);
  const libmap::MeshComponents found = libmap::components_of(mesh, libmap::opposites_of(mesh));
  EXPECT_GE(truth.areas_m2.size(), least);
  EXPECT_EQ(found.of_triangle, truth.of_triangle);
  EXPECT_EQ(found.areas_m2, truth.areas_m2);
}

TEST(MeshComponents, AreThoseOfSharedEdges) {
  expect_those_of_a_hash_table({}, 0);
  expect_those_of_a_hash_table(
      with_gaps(terrain_mesh(40, 1.0, [](double x, double y) { return x * y; })), 20);
}

TEST(MeshComponents, EdgesMayHaveManyTriangles) {
  // Two pairs of cubes with an edge in common, and a triangle that names a vertex twice.
  TriangleMesh mesh = cubes_mesh({{0, 0, 0}, {1, 1, 0}, {5, 0, 0}, {6, 1, 0}});
  mesh.triangles.push_back({0, 0, 1});
  expect_those_of_a_hash_table(mesh, 2);
  mesh.triangles.pop_back();
  expect_those_of_a_hash_table(mesh, 2);
}

}  // namespace mesh_components_test
