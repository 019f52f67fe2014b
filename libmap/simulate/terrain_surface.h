// Ground of any size, given by points, as cameras see it: the points of a height field triangulated
// in the plan (Delaunay), square by square. The squares that cameras can see are in memory, and
// some of those that were seen before.
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

// What a camera can see: rays between two of x/z, y/z, up to a depth.
struct ViewRange {
  Eigen::AlignedBox2d rays;
  double far_m = 0.0;
};
ViewRange view_range(const ViewRays& rays, double far_m);

// The triangles over the plan that meet the rectangle and whose circumcircles have at most that
// radius, with normals at their vertices: wider gaps stay open. They are the same for any set of
// points that holds all within 4 `max_radius_m` of the rectangle, but where points form squares,
// which may be cut along either diagonal.
TriangleMesh triangulate_plan(const std::vector<Eigen::Vector3d>& points,
                              const Eigen::AlignedBox2d& rectangle, double max_radius_m);

struct TerrainSurfaceOptions {
  double square_spacings = 256.0;     // width of a square in spacings of the points; rounded to
                                      // whole cells of the heights
  double gap_spacings = 5.0;          // gaps in the plan wider than about twice this stay open
  std::size_t kept_points = 500'000;  // in memory, unless cameras see more at once
  std::uint64_t texture_seed = 1;
};

class TerrainSurface {
 public:
  // `points` and `heights` are of the same points, and outlive it.
  TerrainSurface(const PointTileStore& points, const GroundHeights& heights,
                 const TerrainSurfaceOptions& options = {});

  // What each of several cameras can see of it from its poses, for as long as the result lives:
  // all squares within their range, whatever was asked for before.
  std::vector<VisibleSurface> seen_from(const std::vector<std::vector<Pose>>& world_from_camera,
                                        const ViewRange& range);

  // Squares that were triangulated so far, and points of those in memory.
  std::size_t squares_made() const { return made_; }
  std::size_t points_in_memory() const;

 private:
  using Place = std::pair<std::int64_t, std::int64_t>;
  struct Square {
    std::optional<VisibleSurface> surface;  // nothing where there is no triangle
    std::size_t points = 0;
    std::uint64_t last_use = 0;
  };
  Eigen::AlignedBox2d rectangle_of(const Place& place) const;
  std::vector<Place> places_in_view(const std::vector<Pose>& world_from_camera,
                                    const ViewRange& range) const;
  Square make(const Place& place) const;
  void load(const std::vector<Place>& places);
  void forget();

  const PointTileStore& points_;
  const GroundHeights& heights_;
  TerrainSurfaceOptions options_;
  double square_m_ = 0.0;
  double max_radius_m_ = 0.0;
  std::map<Place, Square> squares_;
  std::uint64_t uses_ = 0;
  std::size_t made_ = 0;
};

}  // namespace libmap
