#include "libgtd/terrain/planar_delaunay.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/property_map.h>
#include <CGAL/spatial_sort.h>

#include <numeric>

namespace libgtd {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;  // index
using Triangulation =
    CGAL::Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase>>;
using Face = Triangulation::Face_handle;
using Points = std::vector<Eigen::Vector3d>;

// Keeps the highest of points with the same x and y.
Triangulation triangulate(const Points& points) {
  std::vector<Kernel::Point_2> plane_points;
  plane_points.reserve(points.size());
  for (const Eigen::Vector3d& point : points) plane_points.emplace_back(point.x(), point.y());
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  auto positions = CGAL::make_property_map(plane_points);
  CGAL::spatial_sort(
      order.begin(), order.end(),
      CGAL::Spatial_sort_traits_adapter_2<Kernel, decltype(positions)>(positions, Kernel()));
  Triangulation triangulation;
  Face hint;
  for (const std::size_t n : order) {
    const std::size_t before = triangulation.number_of_vertices();
    const auto vertex = triangulation.insert(plane_points[n], hint);
    const bool added = triangulation.number_of_vertices() > before;
    if (added || points[n].z() > points[vertex->info()].z())
      vertex->info() = static_cast<std::uint32_t>(n);
    hint = vertex->face();
  }
  return triangulation;
}

std::array<std::uint32_t, 3> corners_of(const Face& face) {
  const auto corner = [&](int n) { return face->vertex(n % 3)->info(); };
  const auto comes_before = [&](int a, int b) {
    const auto &p = face->vertex(a)->point(), &q = face->vertex(b)->point();
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  };
  const int least = comes_before(0, 1) ? (comes_before(0, 2) ? 0 : 2) : comes_before(1, 2) ? 1 : 2;
  return {corner(least), corner(least + 1), corner(least + 2)};
}

}  // namespace

PlanarTriangulation triangulate_in_plane(const Points& points) {
  const Triangulation triangulation = triangulate(points);
  PlanarTriangulation whole;
  whole.vertices = triangulation.number_of_vertices();
  if (triangulation.dimension() < 2) return whole;
  whole.triangles.reserve(triangulation.number_of_faces());
  for (const Face face : triangulation.finite_face_handles())
    whole.triangles.push_back(corners_of(face));
  return whole;
}

}  // namespace libgtd
