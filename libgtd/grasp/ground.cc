#include "libgtd/grasp/ground.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "libmap/core/error.h"
#include "libmap/core/point_tree.h"

namespace libgtd {

namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

// Square of the distance from a point to a triangle (Ericson 2005, 5.1.5: by the region that the
// point projects to).
double square_distance(const Eigen::Vector3d& p, const Corners& corners) {
  const auto& [a, b, c] = corners;
  const auto to_edge = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    const Eigen::Vector3d edge = to - from;
    const double length = edge.squaredNorm();
    const double share = length > 0.0 ? std::clamp((p - from).dot(edge) / length, 0.0, 1.0) : 0.0;
    return (p - from - share * edge).squaredNorm();
  };
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  const auto inside = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    return normal.dot((to - from).cross(p - from)) >= 0.0;
  };
  if (square > 0.0 && inside(a, b) && inside(b, c) && inside(c, a)) {
    const double height = normal.dot(p - a);
    return height * height / square;
  }
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

Corners corners_of(const std::vector<Eigen::Vector3d>& vertices, const libmap::Triangle& triangle) {
  return {vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]};
}

double radius_about(const Eigen::Vector3d& center, const Corners& corners) {
  double square = 0.0;
  for (const Eigen::Vector3d& corner : corners)
    square = std::max(square, (corner - center).squaredNorm());
  return std::sqrt(square);
}

// Triangles up to this size are found by their centers, larger ones one by one.
constexpr double small_radius_m = 0.02;

}  // namespace

std::optional<Eigen::Vector3d> GroundPatch::normal_at(const Eigen::Vector3d& point,
                                                      double radius_m) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const double square_radius = radius_m * radius_m;
  for (std::size_t n = 0; n < triangles.size(); ++n) {
    const double reach = radius_m + radii[n];
    if ((point - centers[n]).squaredNorm() > reach * reach) continue;
    const Corners corners = corners_of(vertices, triangles[n]);
    const double nearness = 1.0 - square_distance(point, corners) / square_radius;
    if (nearness > 0.0) sum += nearness * area_normals[n];
  }
  const double length = sum.norm();
  if (!(length > 0.0)) return std::nullopt;
  return sum / length;
}

Eigen::Isometry3d patch_frame(const Eigen::Vector3d& location, const Eigen::Vector3d& away) {
  const Eigen::Vector3d z = away.normalized();
  Eigen::Vector3d x = Eigen::Vector3d::UnitX() - z.x() * z;
  if (x.norm() < 0.1) x = Eigen::Vector3d::UnitY() - z.y() * z;
  x.normalize();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear().col(0) = x;
  frame.linear().col(1) = z.cross(x);
  frame.linear().col(2) = z;
  frame.translation() = location;
  return frame;
}

struct Ground::Index {
  explicit Index(const libmap::TriangleMesh& of) : mesh(of) {}

  const libmap::TriangleMesh& mesh;
  std::vector<std::uint32_t> small;      // triangles, as `centers`
  std::vector<Eigen::Vector3d> centers;  // of the small ones
  std::vector<std::uint32_t> large;
  std::optional<libmap::PointTree> tree;
  Eigen::AlignedBox3d box;

  // The triangles that may come within the radius, in the mesh's order.
  std::vector<std::uint32_t> near(const Eigen::Vector3d& point, double radius_m) const {
    std::vector<std::uint32_t> found = large;
    if (tree)
      for (const libmap::NeighborPoint& center : tree->within(point, radius_m + small_radius_m))
        found.push_back(small[center.index]);
    const double square = radius_m * radius_m;
    std::erase_if(found, [&](std::uint32_t triangle) {
      return square_distance(point, corners_of(mesh.vertices, mesh.triangles[triangle])) > square;
    });
    std::sort(found.begin(), found.end());
    return found;
  }
};

Ground::Ground(const libmap::TriangleMesh& mesh) : index_(std::make_unique<Index>(mesh)) {
  mesh.check();
  if (mesh.triangles.empty()) throw libmap::Error("the mesh has no triangles");
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (vertex.allFinite())
      index_->box.extend(vertex);
    else
      throw libmap::Error("a vertex of the mesh is not finite");
  for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
    const Corners corners = corners_of(mesh.vertices, mesh.triangles[n]);
    const Eigen::Vector3d center = (corners[0] + corners[1] + corners[2]) / 3.0;
    if (radius_about(center, corners) > small_radius_m) {
      index_->large.push_back(n);
      continue;
    }
    index_->small.push_back(n);
    index_->centers.push_back(center);
  }
  if (!index_->centers.empty()) index_->tree.emplace(index_->centers);
}

Ground::~Ground() = default;
Ground::Ground(Ground&&) noexcept = default;
Ground& Ground::operator=(Ground&&) noexcept = default;

GroundPatch Ground::patch(const Eigen::Vector3d& location, const Eigen::Vector3d& away,
                          double radius_m, double above_m) const {
  GroundPatch patch;
  patch.mesh_from_patch = patch_frame(location, away);
  const Eigen::Isometry3d patch_from_mesh = patch.mesh_from_patch.inverse();
  const Eigen::Vector3d axis = patch.mesh_from_patch.linear().col(2);
  const libmap::TriangleMesh& mesh = index_->mesh;
  // Spheres along the axis that cover the cylinder.
  double lowest = 0.0;
  for (const auto corner :
       {Eigen::AlignedBox3d::BottomLeftFloor, Eigen::AlignedBox3d::BottomRightFloor,
        Eigen::AlignedBox3d::TopLeftFloor, Eigen::AlignedBox3d::TopRightFloor,
        Eigen::AlignedBox3d::BottomLeftCeil, Eigen::AlignedBox3d::BottomRightCeil,
        Eigen::AlignedBox3d::TopLeftCeil, Eigen::AlignedBox3d::TopRightCeil})
    lowest = std::min(lowest, axis.dot(index_->box.corner(corner) - location));
  std::vector<std::uint32_t> triangles;
  const double half = std::max(radius_m, above_m);
  for (double height = 0.0; height + half > lowest; height -= 2.0 * half) {
    const auto found = index_->near(location + height * axis, std::hypot(radius_m, half));
    triangles.insert(triangles.end(), found.begin(), found.end());
  }
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  std::unordered_map<std::uint32_t, std::uint32_t> number;  // of the mesh's vertices in the patch
  for (const std::uint32_t n : triangles) {
    Eigen::AlignedBox3d box;
    for (const std::uint32_t vertex : mesh.triangles[n])
      box.extend(patch_from_mesh * mesh.vertices[vertex]);
    if ((box.min().array() > Eigen::Array3d(radius_m, radius_m, above_m)).any() ||
        (box.max().head<2>().array() < -radius_m).any())
      continue;
    libmap::Triangle triangle{};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = mesh.triangles[n][corner];
      const auto [entry, is_new] =
          number.try_emplace(vertex, static_cast<std::uint32_t>(patch.vertices.size()));
      if (is_new) patch.vertices.push_back(patch_from_mesh * mesh.vertices[vertex]);
      triangle[corner] = entry->second;
    }
    const Corners corners = corners_of(patch.vertices, triangle);
    patch.triangles.push_back(triangle);
    patch.centers.push_back((corners[0] + corners[1] + corners[2]) / 3.0);
    patch.radii.push_back(radius_about(patch.centers.back(), corners));
    patch.area_normals.push_back((corners[1] - corners[0]).cross(corners[2] - corners[0]));
  }
  return patch;
}

std::optional<double> Ground::distance(const Eigen::Vector3d& point, double radius_m) const {
  double square = std::numeric_limits<double>::infinity();
  for (const std::uint32_t n : index_->near(point, radius_m))
    square = std::min(square, square_distance(point, corners_of(index_->mesh.vertices,
                                                                index_->mesh.triangles[n])));
  if (square == std::numeric_limits<double>::infinity()) return std::nullopt;
  return std::sqrt(square);
}

}  // namespace libgtd
