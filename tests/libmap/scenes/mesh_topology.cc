#include "mesh_topology.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include <iterator>

namespace graspmap_test {

std::size_t self_intersections(const std::vector<Eigen::Vector3d>& vertices,
                               const std::vector<libmap::Triangle>& triangles) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
  Mesh mesh;
  for (const Eigen::Vector3d& vertex : vertices)
    mesh.add_vertex({vertex.x(), vertex.y(), vertex.z()});
  for (const libmap::Triangle& triangle : triangles)
    mesh.add_face(Mesh::Vertex_index(triangle[0]), Mesh::Vertex_index(triangle[1]),
                  Mesh::Vertex_index(triangle[2]));
  std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> pairs;
  CGAL::Polygon_mesh_processing::self_intersections(mesh, std::back_inserter(pairs));
  return pairs.size();
}

}  // namespace graspmap_test
