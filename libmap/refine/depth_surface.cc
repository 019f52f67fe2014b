#include "libmap/refine/depth_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr double normal_scale = 32767.0;
constexpr double noise_unit_m = 1e-6;

}  // namespace

DepthSurface::DepthSurface(const DepthPlanes& planes, const Camera& depth_camera,
                           const DepthNoise& noise, double surface_noise_m, int step_px)
    : camera_(depth_camera), step_px_(step_px) {
  columns_ = (planes.width + step_px - 1) / step_px;
  rows_ = (planes.height + step_px - 1) / step_px;
  const auto size = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  cells_.resize(size);
  find_rays();
  const int most =
      planes.support.empty() ? 0 : *std::max_element(planes.support.begin(), planes.support.end());
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const auto cell = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                        static_cast<std::size_t>(column);
      const auto pixel =
          static_cast<std::size_t>(row * step_px) * static_cast<std::size_t>(planes.width) +
          static_cast<std::size_t>(column * step_px);
      if (!rays_.empty() && !rays_[cell].allFinite()) continue;
      const int support = planes.support[pixel];
      if (support == 0 || 4 * support < most) continue;
      const double depth = static_cast<double>(planes.depth_m[pixel]);
      const double axial = noise.axial_at(depth) / std::sqrt(static_cast<double>(support));
      const double along_normal =
          std::hypot(axial, surface_noise_m) * static_cast<double>(planes.cos_incidence[pixel]);
      Cell& kept = cells_[cell];
      kept.depth_m = planes.depth_m[pixel];
      kept.normal_x = static_cast<std::int16_t>(
          std::lround(static_cast<double>(planes.normals[pixel].x()) * normal_scale));
      kept.normal_y = static_cast<std::int16_t>(
          std::lround(static_cast<double>(planes.normals[pixel].y()) * normal_scale));
      kept.noise =
          static_cast<std::uint16_t>(std::clamp(along_normal / noise_unit_m, 1.0, 65535.0));
    }
}

DepthSurface::DepthSurface(const Camera& depth_camera, int step_px, std::vector<Cell> cells)
    : camera_(depth_camera), step_px_(step_px), cells_(std::move(cells)) {
  if (step_px > 0 && camera_.width > 0 && camera_.height > 0) {
    columns_ = (camera_.width - 1) / step_px + 1;
    rows_ = (camera_.height - 1) / step_px + 1;
  }
  if (cells_.empty() ||
      cells_.size() != static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_))
    throw Error("a surface does not fit its camera",
                {.field = "cells",
                 .value = std::to_string(cells_.size()),
                 .bound = std::to_string(columns_) + " x " + std::to_string(rows_)});
  find_rays();
}

// NaN where no ray belongs to the pixel.
void DepthSurface::find_rays() {
  if (!camera_.is_distorted()) return;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const auto ray = pixel_to_ray(camera_, Eigen::Vector2d(column * step_px_, row * step_px_));
      rays_.emplace_back(ray ? Eigen::Vector2f(ray->cast<float>())
                             : Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
    }
}

Eigen::Vector2d DepthSurface::ray_at(int column, int row) const {
  if (!rays_.empty())
    return rays_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(column)]
        .cast<double>();
  return {(column * step_px_ - camera_.cx) / camera_.fx,
          (row * step_px_ - camera_.cy) / camera_.fy};
}

bool DepthSurface::at(int column, int row, SurfaceElement& element) const {
  const Cell& cell = cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                            static_cast<std::size_t>(column)];
  if (cell.depth_m <= 0.0F) return false;
  element.point = static_cast<double>(cell.depth_m) * ray_at(column, row).homogeneous();
  const double x = cell.normal_x / normal_scale;
  const double y = cell.normal_y / normal_scale;
  // Nearly all normals look back at the camera (z < 0); a wide lens may see others, by a little.
  element.normal = {x, y, -std::sqrt(std::max(0.0, 1.0 - x * x - y * y))};
  element.noise_m = cell.noise * noise_unit_m;
  return true;
}

bool DepthSurface::seen_at(const Eigen::Vector3d& point_in_camera, SurfaceElement& element) const {
  if (columns_ == 0 || !(point_in_camera.z() > 0.0)) return false;
  Eigen::Vector2d pixel;
  if (rays_.empty()) {
    pixel = {camera_.fx * point_in_camera.x() / point_in_camera.z() + camera_.cx,
             camera_.fy * point_in_camera.y() / point_in_camera.z() + camera_.cy};
  } else {
    const auto projected = project_point(camera_, point_in_camera);
    if (!projected) return false;
    pixel = *projected;
  }
  const double column = std::round(pixel.x() / step_px_);
  const double row = std::round(pixel.y() / step_px_);
  if (!(column >= 0.0 && column < columns_ && row >= 0.0 && row < rows_)) return false;
  return at(static_cast<int>(column), static_cast<int>(row), element);
}

}  // namespace libmap
