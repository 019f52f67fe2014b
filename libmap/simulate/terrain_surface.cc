#include "libmap/simulate/terrain_surface.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/core/parallel.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;
using Triangulation =
    CGAL::Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase>>;

constexpr double range_margin_m = 0.05;  // of the view frustum
constexpr double margin_radii = 4.0;     // margin of triangulate_plan

double circumradius(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  const Eigen::Vector2d ab = b - a;
  const Eigen::Vector2d ac = c - a;
  const double twice_area = ab.x() * ac.y() - ab.y() * ac.x();
  return 0.5 * ab.norm() * ac.norm() * (c - b).norm() / std::abs(twice_area);
}

// Returns false only if all corners of the box are outside of one side of the view frustum.
bool may_see(const Eigen::AlignedBox3d& box, const Pose& camera_from_world,
             const ViewRange& range) {
  std::array<int, 6> beyond{};
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3d p =
        camera_from_world * box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(n));
    beyond[0] += p.z() < 0.0;
    beyond[1] += p.z() > range.far_m;
    beyond[2] += p.x() < range.rays.min().x() * p.z();
    beyond[3] += p.x() > range.rays.max().x() * p.z();
    beyond[4] += p.y() < range.rays.min().y() * p.z();
    beyond[5] += p.y() > range.rays.max().y() * p.z();
  }
  return std::find(beyond.begin(), beyond.end(), 8) == beyond.end();
}

}  // namespace

ViewRange view_range(const ViewRays& rays, double far_m) {
  ViewRange range;
  range.far_m = far_m;
  for (const auto* const of : {&rays.centers, &rays.corners})
    for (const Eigen::Vector2d& ray : *of)
      if (ray.allFinite()) range.rays.extend(ray);
  return range;
}

TriangleMesh triangulate_plan(const std::vector<Eigen::Vector3d>& points,
                              const Eigen::AlignedBox2d& rectangle, double max_radius_m) {
  std::vector<std::pair<Kernel::Point_2, std::uint32_t>> plan;
  plan.reserve(points.size());
  for (const Eigen::Vector3d& point : points)
    plan.emplace_back(Kernel::Point_2(point.x(), point.y()),
                      static_cast<std::uint32_t>(plan.size()));
  const Triangulation triangulation(plan.begin(), plan.end());
  TriangleMesh mesh;
  mesh.vertices = points;
  for (auto face = triangulation.finite_faces_begin(); face != triangulation.finite_faces_end();
       ++face) {
    const Triangle triangle{face->vertex(0)->info(), face->vertex(1)->info(),
                            face->vertex(2)->info()};
    const auto corner_at = [&](std::size_t k) { return points[triangle[k]].head<2>(); };
    if (circumradius(corner_at(0), corner_at(1), corner_at(2)) <= max_radius_m)
      mesh.triangles.push_back(triangle);
  }
  // Normals include triangles outside of the rectangle.
  mesh.vertex_normals = estimate_vertex_normals(mesh);
  std::vector<bool> is_kept;
  for (const Triangle& triangle : mesh.triangles) {
    Eigen::AlignedBox2d box;
    for (const std::uint32_t vertex : triangle)
      box.extend(Eigen::Vector2d(points[vertex].head<2>()));
    is_kept.push_back(box.intersects(rectangle));
  }
  return select_triangles(mesh, is_kept);
}

TerrainSurface::TerrainSurface(const PointTileStore& points, const GroundHeights& heights,
                               const TerrainSurfaceOptions& options)
    : points_(points),
      heights_(heights),
      options_(options),
      max_radius_m_(options.gap_spacings * heights.spacing_m()) {
  const double cells =
      std::round(options.tile_spacings * heights.spacing_m() / GroundHeights::cell_m);
  tile_m_ = GroundHeights::cell_m * std::max(1.0, cells);
}

Eigen::AlignedBox2d TerrainSurface::rectangle_of(const TilePosition& tile) const {
  const Eigen::Vector2d low =
      tile_m_ * Eigen::Vector2d(static_cast<double>(tile.first), static_cast<double>(tile.second));
  return {low, low + Eigen::Vector2d::Constant(tile_m_)};
}

std::vector<TerrainSurface::TilePosition> TerrainSurface::tiles_in_view(
    const std::vector<Pose>& world_from_camera, const ViewRange& range) const {
  // Radius around the camera: range along the rays in the image corners.
  const Eigen::Vector2d widest = range.rays.min().cwiseAbs().cwiseMax(range.rays.max().cwiseAbs());
  const double reach = range.far_m * widest.homogeneous().norm();
  std::vector<TilePosition> tiles;
  for (const Pose& pose : world_from_camera) {
    const Pose camera_from_world = pose.inverse();
    const Eigen::Vector2d here = pose.translation().head<2>();
    const auto index = [&](double at) {
      return static_cast<std::int64_t>(std::floor(at / tile_m_));
    };
    for (std::int64_t i = index(here.x() - reach); i <= index(here.x() + reach); ++i)
      for (std::int64_t j = index(here.y() - reach); j <= index(here.y() + reach); ++j) {
        Eigen::AlignedBox3d box = heights_.extent(rectangle_of({i, j}));
        if (box.isEmpty()) continue;
        box.min().array() -= range_margin_m;
        box.max().array() += range_margin_m;
        if (may_see(box, camera_from_world, range)) tiles.emplace_back(i, j);
      }
  }
  std::sort(tiles.begin(), tiles.end());
  tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
  return tiles;
}

TerrainSurface::CachedTile TerrainSurface::make(const TilePosition& tile) const {
  const Eigen::AlignedBox2d rectangle = rectangle_of(tile);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_radii * max_radius_m_);
  const TriangleMesh mesh = triangulate_plan(
      points_.points_in(rectangle.min() - margin, rectangle.max() + margin).positions, rectangle,
      max_radius_m_);
  CachedTile cached;
  cached.points = mesh.vertices.size();
  if (!mesh.triangles.empty())
    cached.surface.emplace(mesh, TextureSource::rock, options_.texture_seed,
                           ShadingNormals::per_vertex);
  return cached;
}

void TerrainSurface::load(const std::vector<TilePosition>& tiles) {
  std::vector<TilePosition> missing;
  for (const TilePosition& tile : tiles)
    if (!tiles_.contains(tile)) missing.push_back(tile);
  std::vector<CachedTile> made(missing.size());
  parallel_each(missing.size(), [&](std::size_t n) { made[n] = make(missing[n]); });
  for (std::size_t n = 0; n < missing.size(); ++n) tiles_[missing[n]] = std::move(made[n]);
  made_ += missing.size();
}

std::size_t TerrainSurface::points_in_memory() const {
  std::size_t points = 0;
  for (const auto& [tile, cached] : tiles_) points += cached.points;
  return points;
}

// Drops the least recently used tiles until at most kept_points are left.
void TerrainSurface::evict() {
  std::size_t points = points_in_memory();
  while (points > options_.kept_points) {
    const auto oldest = std::min_element(
        tiles_.begin(), tiles_.end(),
        [](const auto& a, const auto& b) { return a.second.last_use < b.second.last_use; });
    if (oldest->second.last_use == uses_) break;
    points -= oldest->second.points;
    tiles_.erase(oldest);
  }
}

std::vector<VisibleSurface> TerrainSurface::seen_from(
    const std::vector<std::vector<Pose>>& world_from_camera, const ViewRange& range) {
  ++uses_;
  std::vector<std::vector<TilePosition>> of_camera;
  std::vector<TilePosition> all;
  for (const std::vector<Pose>& poses : world_from_camera) {
    of_camera.push_back(tiles_in_view(poses, range));
    all.insert(all.end(), of_camera.back().begin(), of_camera.back().end());
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (const TilePosition& tile : all)
    if (const auto known = tiles_.find(tile); known != tiles_.end()) known->second.last_use = uses_;
  evict();  // before loading more tiles
  load(all);
  std::vector<VisibleSurface> surfaces;
  for (const std::vector<TilePosition>& tiles : of_camera) {
    std::vector<VisibleSurface> parts;
    for (const TilePosition& tile : tiles) {
      CachedTile& cached = tiles_.at(tile);
      cached.last_use = uses_;
      if (cached.surface) parts.push_back(*cached.surface);
    }
    surfaces.emplace_back(std::span<const VisibleSurface>(parts));
  }
  return surfaces;
}

}  // namespace libmap
