#include "libmap/mesh/reference_surface.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

struct ReferenceSurface::Shape {
  Bounds3d bounds{};
  bool is_oriented = true;

  Shape() = default;
  Shape(const Shape&) = delete;
  Shape& operator=(const Shape&) = delete;
  virtual ~Shape() = default;
  virtual NearestSurfacePoint nearest(const Eigen::Vector3d& point) const = 0;
};

namespace {

constexpr std::size_t points_per_chunk = 4096;

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

struct ReferenceSurface::MeshShape : Shape {
  SurfaceDistance surface;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<HalfEdge> opposite;
  std::vector<Eigen::Vector3d> vertex_normals;  // angle-weighted, not unit
  std::vector<char> is_border_vertex;

  explicit MeshShape(const TriangleMesh& mesh)
      : surface(mesh),
        vertices(mesh.vertices),
        triangles(mesh.triangles),
        opposite(opposites_of(triangles, edges_of(triangles, vertices.size()))),
        vertex_normals(vertices.size(), Eigen::Vector3d::Zero()),
        is_border_vertex(vertices.size(), 0) {
    bounds = bounds_of(vertices);
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const Eigen::Vector3d normal = normal_of(t);
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d& corner = at(t, k);
        vertex_normals[triangles[t][k]] +=
            angle_between(at(t, (k + 1) % 3) - corner, at(t, (k + 2) % 3) - corner) * normal;
        if (opposite[3 * std::size_t{t} + k] != open_edge) continue;
        is_border_vertex[triangles[t][k]] = 1;
        is_border_vertex[triangles[t][(k + 1) % 3]] = 1;
      }
    }
  }

  const Eigen::Vector3d& at(std::uint32_t t, std::size_t k) const {
    return vertices[triangles[t][k]];
  }
  Eigen::Vector3d normal_of(std::uint32_t t) const {
    return (at(t, 1) - at(t, 0)).cross(at(t, 2) - at(t, 0)).normalized();
  }

  // Barycentric coordinates of a position in the triangle; all zero if it has no area.
  std::array<double, 3> barycentric_coordinates(std::uint32_t t,
                                                const Eigen::Vector3d& position) const {
    const Eigen::Vector3d normal = (at(t, 1) - at(t, 0)).cross(at(t, 2) - at(t, 0));
    std::array<double, 3> result{};
    if (!(normal.squaredNorm() > 0.0)) return result;
    for (std::size_t k = 0; k < 3; ++k)
      result[k] = (at(t, (k + 1) % 3) - position).cross(at(t, (k + 2) % 3) - position).dot(normal) /
                  normal.squaredNorm();
    return result;
  }

  NearestSurfacePoint nearest(const Eigen::Vector3d& point) const override {
    constexpr double on_edge = 1e-6;  // barycentric coordinates below this are on the edge
    const SurfacePoint found = surface.nearest(point);
    NearestSurfacePoint found_point{found.position, Eigen::Vector3d::Zero(), found.distance_m,
                                    false};
    const std::uint32_t t = found.triangle;
    const std::array<double, 3> coordinates = barycentric_coordinates(t, found.position);
    std::size_t zeros = 0;
    std::size_t zero = 0;     // last corner with a coordinate of zero
    std::size_t largest = 0;  // corner with the largest coordinate
    for (std::size_t k = 0; k < 3; ++k) {
      if (coordinates[k] < on_edge) {
        ++zeros;
        zero = k;
      }
      if (coordinates[k] > coordinates[largest]) largest = k;
    }
    if (zeros == 0) {
      found_point.normal = normal_of(t);
    } else if (zeros == 1) {
      // The edge from the next corner to the one after it.
      const HalfEdge other = opposite[3 * std::size_t{t} + (zero + 1) % 3];
      found_point.on_border = other == open_edge;
      found_point.normal = normal_of(t);
      if (is_joined(other)) found_point.normal += normal_of(other / 3);
    } else {
      found_point.normal = vertex_normals[triangles[t][largest]];
      found_point.on_border = is_border_vertex[triangles[t][largest]] != 0;
    }
    found_point.normal.normalize();
    return found_point;
  }
};

struct ReferenceSurface::CloudShape : Shape {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;  // unit or zero, one per point
  double disc_radius_m = 0.0;
  std::unique_ptr<PointTree> tree;

  explicit CloudShape(const PointCloud& cloud)
      : points(cloud.positions), normals(points.size(), Eigen::Vector3d::Zero()) {
    if (points.empty()) throw no_elements("points of the cloud");
    for (const Eigen::Vector3d& point : points)
      if (!point.allFinite()) throw Error("one is not finite", {.field = "points"});
    bounds = bounds_of(points);
    disc_radius_m = 2.0 * median_spacing(points);
    tree = std::make_unique<PointTree>(points);
    is_oriented = cloud.has_normals();
    for (std::size_t n = 0; n < cloud.normals.size(); ++n) {
      const Eigen::Vector3d normal = cloud.normals[n].cast<double>();
      if (normal.allFinite() && normal.squaredNorm() > 0.0)
        normals[n] = normal.normalized();
      else
        is_oriented = false;
    }
  }

  NearestSurfacePoint nearest(const Eigen::Vector3d& point) const override {
    const NeighborPoint neighbor = tree->nearest(point);
    const Eigen::Vector3d& center = points[neighbor.index];
    const Eigen::Vector3d& normal = normals[neighbor.index];
    NearestSurfacePoint found_point{center, normal, 0.0, false};
    if (normal.squaredNorm() > 0.0) {
      const Eigen::Vector3d offset = point - center;
      const Eigen::Vector3d along = offset - offset.dot(normal) * normal;
      const double reach = along.norm();
      found_point.on_border = reach > disc_radius_m;
      found_point.position +=
          found_point.on_border ? Eigen::Vector3d(disc_radius_m / reach * along) : along;
    }
    found_point.distance_m = (point - found_point.position).norm();
    return found_point;
  }
};

ReferenceSurface::ReferenceSurface(const TriangleMesh& mesh)
    : shape_(std::make_unique<MeshShape>(mesh)) {}
ReferenceSurface::ReferenceSurface(const PointCloud& cloud)
    : shape_(std::make_unique<CloudShape>(cloud)) {}
ReferenceSurface::~ReferenceSurface() = default;
ReferenceSurface::ReferenceSurface(ReferenceSurface&&) noexcept = default;
ReferenceSurface& ReferenceSurface::operator=(ReferenceSurface&&) noexcept = default;

bool ReferenceSurface::is_oriented() const { return shape_->is_oriented; }
const Bounds3d& ReferenceSurface::bounds() const { return shape_->bounds; }
NearestSurfacePoint ReferenceSurface::nearest(const Eigen::Vector3d& point) const {
  return shape_->nearest(point);
}

PointDistances distances_to(const ReferenceSurface& surface,
                            const std::vector<Eigen::Vector3d>& points) {
  PointDistances distances{std::vector<double>(points.size()), std::vector<double>(points.size())};
  parallel_each(points.size(), points_per_chunk, [&](std::size_t n) {
    const NearestSurfacePoint found_point = surface.nearest(points[n]);
    distances.distance_m[n] = found_point.distance_m;
    distances.signed_distance_m[n] =
        surface.is_oriented() ? found_point.signed_distance_m(points[n]) : found_point.distance_m;
  });
  return distances;
}

}  // namespace libmap
