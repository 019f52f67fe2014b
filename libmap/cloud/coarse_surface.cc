#include "libmap/cloud/coarse_surface.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libmap {

namespace {

// Marks the pixels that were measured in `cells`, not 0.
std::vector<std::uint8_t> pixels_in(const DepthImage& depth, const PixelRays& rays,
                                    const Pose& grid_from_camera, double max_depth_m,
                                    double voxel_size_m, const PlanCells& cells) {
  const auto scale = static_cast<float>(1.0 / voxel_size_m);
  const Eigen::Matrix<float, 2, 3> rotation = grid_from_camera.linear().topRows<2>().cast<float>();
  const Eigen::Vector2f translation =
      grid_from_camera.translation().head<2>().cast<float>() * scale;
  const auto max_depth = static_cast<float>(max_depth_m);
  std::vector<std::uint8_t> are_in(depth.pixels.size(), 0);
  for (std::size_t n = 0; n < are_in.size(); ++n) {
    const float z = depth.pixels[n];
    if (!(z > 0.0F && z <= max_depth)) continue;
    const Eigen::Vector3f ray(rays.x[n], rays.y[n], 1.0F);
    are_in[n] = cells.has_place(rotation * (ray * (z * scale)) + translation) ? 1 : 0;
  }
  return are_in;
}

// Marks all pixels whose planes may be in `cells`, and those that these planes depend on.
std::vector<std::uint8_t> pixels_around(const DepthImage& depth, const PixelRays& rays,
                                        const Pose& grid_from_camera,
                                        const DepthPlaneOptions& options, double voxel_size_m,
                                        const PlanCells& cells) {
  const double ray_length = rays.min.cwiseAbs().cwiseMax(rays.max.cwiseAbs()).homogeneous().norm();
  const double moved = max_plane_distance_m(options) * ray_length / voxel_size_m;
  const int margin = 1 + static_cast<int>(std::min(moved, static_cast<double>(voxel_cell_limit)));
  const std::vector<std::uint8_t> are_in = pixels_in(
      depth, rays, grid_from_camera, options.max_depth_m, voxel_size_m, cells.grown(margin));
  if (std::none_of(are_in.begin(), are_in.end(), [](std::uint8_t mark) { return mark != 0; }))
    return {};
  return grown_marks(are_in, depth.width, depth.height);
}

void add_planes(const DepthPlanes& planes, const PixelRays& rays, const Pose& grid_from_camera,
                const DepthNoise& noise, double voxel_size_m, const PlanCells& cells,
                SurfaceVoxels& voxels) {
  const auto scale = static_cast<float>(1.0 / voxel_size_m);
  const Eigen::Matrix3f rotation = grid_from_camera.linear().cast<float>();
  const Eigen::Vector3f translation = grid_from_camera.translation().cast<float>() * scale;
  const auto axial = static_cast<float>(noise.axial_m);
  const auto of_range = static_cast<float>(noise.axial_of_range);
  for (std::size_t n = 0; n < planes.support.size(); ++n) {
    if (planes.support[n] == 0) continue;
    const float z = planes.depth_m[n];
    const Eigen::Vector3f ray(rays.x[n], rays.y[n], 1.0F);
    const Eigen::Vector3f place = rotation * (ray * (z * scale)) + translation;
    if (!cells.has_place(place.head<2>())) continue;
    const float sigma = axial + of_range * z;
    // Front views know lateral places and normals better.
    const float weight =
        planes.cos_incidence[n] * static_cast<float>(planes.support[n]) / (sigma * sigma);
    voxels.add(place, rotation * planes.normals[n], weight);
  }
}

}  // namespace

DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const PlanCells& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels) {
  std::vector<std::uint8_t> only;
  if (fitted == FittedPixels::in_cells) {
    only = cells.thinning > 0
               ? pixels_in(depth, rays, grid_from_camera, options.max_depth_m, voxel_size_m, cells)
               : pixels_around(depth, rays, grid_from_camera, options, voxel_size_m, cells);
    if (only.empty()) return {};
  }
  const DepthPlanes planes = fit_depth_planes(depth, rays, options, only);
  add_planes(planes, rays, grid_from_camera, options.noise, voxel_size_m, cells, voxels);
  return planes.counts;
}

}  // namespace libmap
