// Surface of a large terrain for simulated scans: a height field of points, triangulated (Delaunay)
// in square tiles of the x-y plane. Only tiles in view and a cache of earlier tiles are in memory.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/depth_camera.h"
#include "libmap/simulate/ground_heights.h"
#include "libmap/tiles/point_tile_store.h"

namespace libmap {

// View frustum of a camera.
struct ViewRange {
  Eigen::AlignedBox2d rays;  // bounds of the rays (x/z, y/z)
  double far_m = 0.0;        // maximum depth z
};
// Returns the frustum of all rays through pixel centers and corners, up to the depth `far_m`.
ViewRange view_range(const ViewRays& rays, double far_m);

// Returns a Delaunay triangulation in the x-y plane with vertex normals: the triangles whose
// bounding boxes intersect the rectangle and whose circumradius is at most `max_radius_m` (wider
// gaps stay open). It is the same for all point sets that contain the same points within 4 *
// `max_radius_m` of the rectangle, except for the diagonals of squares of four points.
TriangleMesh triangulate_plan(const std::vector<Eigen::Vector3d>& points,
                              const Eigen::AlignedBox2d& rectangle, double max_radius_m);

struct TerrainSurfaceOptions {
  double tile_spacings = 256.0;       // side of a tile in mean point spacings; rounded to a
                                      // multiple of GroundHeights::cell_m
  double gap_spacings = 5.0;          // maximum circumradius of triangles in mean point spacings
  std::size_t kept_points = 500'000;  // maximum number of points in memory, unless more are in view
  std::uint64_t texture_seed = 1;     // seed of rock_color()
};

class TerrainSurface {
 public:
  // `points` and `heights` must contain the same points and outlive this object.
  TerrainSurface(const PointTileStore& points, const GroundHeights& heights,
                 const TerrainSurfaceOptions& options = {});

  // Returns for each of several frames the surface in view from any of its camera poses. The
  // result does not depend on earlier calls and stays valid after later calls.
  std::vector<VisibleSurface> seen_from(const std::vector<std::vector<Pose>>& world_from_camera,
                                        const ViewRange& range);

  std::size_t tiles_made() const { return made_; }  // number of triangulated tiles so far
  std::size_t points_in_memory() const;             // number of points of the cached tiles

 private:
  using TilePosition = std::pair<std::int64_t, std::int64_t>;
  struct CachedTile {
    std::optional<VisibleSurface> surface;  // nullopt if there is no triangle
    std::size_t points = 0;
    std::uint64_t last_use = 0;
  };
  Eigen::AlignedBox2d rectangle_of(const TilePosition& tile) const;
  std::vector<TilePosition> tiles_in_view(const std::vector<Pose>& world_from_camera,
                                          const ViewRange& range) const;
  CachedTile make(const TilePosition& tile) const;
  void load(const std::vector<TilePosition>& tiles);
  void evict();

  const PointTileStore& points_;
  const GroundHeights& heights_;
  TerrainSurfaceOptions options_;
  double tile_m_ = 0.0;
  double max_radius_m_ = 0.0;
  std::map<TilePosition, CachedTile> tiles_;
  std::uint64_t uses_ = 0;
  std::size_t made_ = 0;
};

}  // namespace libmap
