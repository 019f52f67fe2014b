#include "libmap/cloud/coarse_surface.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libmap {

namespace {

DepthPlaneLoops::Placement placement_of(const Pose& grid_from_camera, const DepthNoise& noise,
                                        double voxel_size_m) {
  DepthPlaneLoops::Placement placement{};
  placement.scale = static_cast<float>(1.0 / voxel_size_m);
  for (int axis = 0; axis < 3; ++axis) {
    for (int of = 0; of < 3; ++of)
      placement.rotation[3 * axis + of] = static_cast<float>(grid_from_camera.linear()(axis, of));
    placement.translation[axis] =
        static_cast<float>(grid_from_camera.translation()[axis]) * placement.scale;
  }
  placement.axial_m = static_cast<float>(noise.axial_m);
  placement.axial_of_range = static_cast<float>(noise.axial_of_range);
  return placement;
}

std::size_t row_begin(const DepthImage& depth, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width);
}

// Marks the pixels that were measured in `cells`, not 0.
std::vector<std::uint8_t> pixels_in(const DepthImage& depth, const PixelRays& rays,
                                    const DepthPlaneLoops::Placement& placement, double max_depth_m,
                                    const TileMask& cells) {
  const DepthPlaneLoops& loops = depth_plane_loops_of(best_instruction_set());
  const auto max_depth = static_cast<float>(max_depth_m);
  std::vector<std::uint8_t> are_in(depth.pixels.size(), 0);
  const auto width = static_cast<std::size_t>(depth.width);
  std::vector<float> places(2 * (width + DepthPlaneLoops::lanes));
  float* const x = places.data();
  float* const y = x + width + DepthPlaneLoops::lanes;
  for (int row = 0; row < depth.height; ++row) {
    const std::size_t first = row_begin(depth, row);
    loops.place_depths(&depth.pixels[first], &rays.x[first], &rays.y[first], depth.width, placement,
                       x, y);
    for (std::size_t n = 0; n < width; ++n) {
      const float z = depth.pixels[first + n];
      if (z > 0.0F && z <= max_depth) are_in[first + n] = cells.has_place({x[n], y[n]}) ? 1 : 0;
    }
  }
  return are_in;
}

// Marks all pixels whose planes may be in `cells`, and those that these planes depend on.
std::vector<std::uint8_t> pixels_around(const DepthImage& depth, const PixelRays& rays,
                                        const DepthPlaneLoops::Placement& placement,
                                        const DepthPlaneOptions& options, double voxel_size_m,
                                        const TileMask& cells) {
  const double ray_length = rays.min.cwiseAbs().cwiseMax(rays.max.cwiseAbs()).homogeneous().norm();
  const double moved = max_plane_distance_m(options) * ray_length / voxel_size_m;
  const int margin = 1 + static_cast<int>(std::min(moved, static_cast<double>(voxel_cell_limit)));
  const std::vector<std::uint8_t> are_in =
      pixels_in(depth, rays, placement, options.max_depth_m, cells.grown(margin));
  if (std::none_of(are_in.begin(), are_in.end(), [](std::uint8_t mark) { return mark != 0; }))
    return {};
  return grown_marks(are_in, depth.width, depth.height);
}

}  // namespace

DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const TileMask& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels) {
  const DepthPlaneLoops::Placement placement =
      placement_of(grid_from_camera, options.noise, voxel_size_m);
  std::vector<std::uint8_t> only;
  if (fitted == FittedPixels::in_cells) {
    only = cells.thinning > 0 ? pixels_in(depth, rays, placement, options.max_depth_m, cells)
                              : pixels_around(depth, rays, placement, options, voxel_size_m, cells);
    if (only.empty()) return {};
  }
  const DepthPlaneLoops& loops = depth_plane_loops_of(best_instruction_set());
  const auto width = static_cast<std::size_t>(depth.width);
  const std::size_t stride = width + DepthPlaneLoops::lanes;
  std::vector<float> numbers(7 * stride);
  const auto numbers_at = [&](std::size_t n) { return numbers.data() + n * stride; };
  const DepthPlaneLoops::Places places{{numbers_at(0), numbers_at(1), numbers_at(2)},
                                       {numbers_at(3), numbers_at(4), numbers_at(5)},
                                       numbers_at(6)};
  return each_plane_row(
      depth, rays, options, only, [&](int y, const DepthPlaneLoops::Planes& planes) {
        const std::size_t first = row_begin(depth, y);
        loops.place(planes, &rays.x[first], &rays.y[first], depth.width, placement, places);
        for (std::size_t x = 0; x < width; ++x) {
          if (planes.support[x] == 0) continue;
          const Eigen::Vector3f place(places.place[0][x], places.place[1][x], places.place[2][x]);
          if (!cells.has_place(place.head<2>())) continue;
          voxels.add(place, {places.normal[0][x], places.normal[1][x], places.normal[2][x]},
                     places.weight[x]);
        }
      });
}

}  // namespace libmap
