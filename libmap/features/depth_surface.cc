#include "libmap/features/depth_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr double most_step = 0.03;  // maximum relative depth step between elements of one surface

constexpr double normal_scale = 32767.0;
constexpr double noise_unit_m = 1e-6;

void set_normal(DepthSurface::Cell& cell, double x, double y) {
  cell.normal_x = static_cast<std::int16_t>(std::lround(x * normal_scale));
  cell.normal_y = static_cast<std::int16_t>(std::lround(y * normal_scale));
}

void set_cell_noise(DepthSurface::Cell& cell, double units) {
  cell.noise = static_cast<std::uint16_t>(std::clamp(units, 1.0, 65535.0));
}

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
      const std::size_t cell = index(column, row);
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
      kept.set_depth_m(planes.depth_m[pixel]);
      set_normal(kept, static_cast<double>(planes.normals[pixel].x()),
                 static_cast<double>(planes.normals[pixel].y()));
      set_cell_noise(kept, along_normal / noise_unit_m);
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
    throw Error("number of depth cells does not match the camera's image size",
                {.field = "cells",
                 .value = std::to_string(cells_.size()),
                 .bound = std::to_string(columns_) + " x " + std::to_string(rows_)});
  find_rays();
}

// The inverse depth of a plane, n r / h on the ray r, and its derivatives by the pixel are kept.
void DepthSurface::set_camera(const Camera& depth_camera) {
  const auto intrinsics = [](const Camera& camera) {
    return std::array{camera.fx, camera.fy, camera.cx, camera.cy};
  };
  if (intrinsics(camera_) == intrinsics(depth_camera)) {
    camera_.base_from_camera = depth_camera.base_from_camera;
    return;
  }
  const DepthSurface before = *this;
  camera_ = depth_camera;
  find_rays();
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      SurfacePatch element;
      if (!before.at(column, row, element)) continue;
      const Eigen::Vector2d ray = ray_at(column, row);
      Cell& cell = cells_[index(column, row)];
      if (!ray.allFinite()) {
        cell = {};
        continue;
      }
      const double x = element.normal.x() * camera_.fx / before.camera_.fx;
      const double y = element.normal.y() * camera_.fy / before.camera_.fy;
      const double facing = element.normal.dot(before.ray_at(column, row).homogeneous());
      const Eigen::Vector3d normal =
          Eigen::Vector3d(x, y, facing - x * ray.x() - y * ray.y()).normalized();
      set_normal(cell, normal.x(), normal.y());
    }
}

void DepthSurface::set_noise(const DepthNoise& before, const DepthNoise& after) {
  for (Cell& cell : cells_) {
    const auto z = static_cast<double>(cell.depth_m());
    if (z > 0.0) set_cell_noise(cell, cell.noise * after.axial_at(z) / before.axial_at(z));
  }
}

// Corrected depth z(u, v) + c(z, r); its derivative by the pixel is z' (1 + dc/dz) + dc/du.
void DepthSurface::correct(const DepthCorrection& correction) {
  if (correction.empty()) return;
  constexpr double step_m = 1e-3;
  constexpr double step_px = 0.5;
  const auto added = [&](double depth_m, double x_px, double y_px) {
    return correction.at(depth_m, squared_image_radius(camera_.width, camera_.height, x_px, y_px));
  };
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      SurfacePatch element;
      if (!at(column, row, element)) continue;
      const double x_px = column * step_px_;
      const double y_px = row * step_px_;
      const double z = element.point.z();
      const double slope =
          (added(z + step_m, x_px, y_px) - added(z - step_m, x_px, y_px)) / (2.0 * step_m);
      const Eigen::Vector2d by_pixel(
          (added(z, x_px + step_px, y_px) - added(z, x_px - step_px, y_px)) / (2.0 * step_px),
          (added(z, x_px, y_px + step_px) - added(z, x_px, y_px - step_px)) / (2.0 * step_px));
      // Derivative by the ray for the plane n r z = h: z' = -z n / (n r).
      const Eigen::Vector2d ray = element.point.head<2>() / z;
      const double facing = element.normal.dot(ray.homogeneous());
      Cell& cell = cells_[index(column, row)];
      const double corrected = z + added(z, x_px, y_px);
      if (!(corrected > 0.0 && facing < 0.0)) {
        cell = {};
        continue;
      }
      const Eigen::Vector2d by_ray = (1.0 + slope) * -z / facing * element.normal.head<2>() +
                                     by_pixel.cwiseProduct(Eigen::Vector2d(camera_.fx, camera_.fy));
      const Eigen::Vector3d normal =
          Eigen::Vector3d(by_ray.x(), by_ray.y(), -corrected - ray.dot(by_ray)).normalized();
      cell.set_depth_m(static_cast<float>(corrected));
      set_normal(cell, normal.x(), normal.y());
    }
}

// Rays are NaN for pixels outside the range of the lens model.
void DepthSurface::find_rays() {
  rays_.clear();
  if (!camera_.is_distorted()) return;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const auto ray = pixel_to_ray(camera_, Eigen::Vector2d(column * step_px_, row * step_px_));
      rays_.emplace_back(ray ? Eigen::Vector2f(ray->cast<float>())
                             : Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
    }
}

Eigen::Vector2d DepthSurface::ray_at(int column, int row) const {
  if (!rays_.empty()) return rays_[index(column, row)].cast<double>();
  return {(column * step_px_ - camera_.cx) / camera_.fx,
          (row * step_px_ - camera_.cy) / camera_.fy};
}

bool DepthSurface::at(int column, int row, SurfacePatch& element) const {
  const Cell& cell = cells_[index(column, row)];
  const float depth_m = cell.depth_m();
  if (depth_m <= 0.0F) return false;
  element.point = static_cast<double>(depth_m) * ray_at(column, row).homogeneous();
  const double x = cell.normal_x / normal_scale;
  const double y = cell.normal_y / normal_scale;
  // Nearly all normals point to the camera (z < 0). With a wide lens a few are slightly off.
  element.normal = {x, y, -std::sqrt(std::max(0.0, 1.0 - x * x - y * y))};
  element.noise_m = cell.noise * noise_unit_m;
  return true;
}

std::optional<Eigen::Vector2d> DepthSurface::grid_position(
    const Eigen::Vector3d& point_in_camera) const {
  if (columns_ == 0 || !(point_in_camera.z() > 0.0)) return std::nullopt;
  if (!rays_.empty()) {
    const auto pixel = project_point(camera_, point_in_camera);
    if (!pixel) return std::nullopt;
    return *pixel / step_px_;
  }
  return Eigen::Vector2d(
      (camera_.fx * point_in_camera.x() / point_in_camera.z() + camera_.cx) / step_px_,
      (camera_.fy * point_in_camera.y() / point_in_camera.z() + camera_.cy) / step_px_);
}

bool DepthSurface::nearest_to(const Eigen::Vector3d& point_in_camera, SurfacePatch& element) const {
  const auto in_grid = grid_position(point_in_camera);
  if (!in_grid) return false;
  const double column = std::round(in_grid->x());
  const double row = std::round(in_grid->y());
  if (!(column >= 0.0 && column < columns_ && row >= 0.0 && row < rows_)) return false;
  return at(static_cast<int>(column), static_cast<int>(row), element);
}

bool DepthSurface::interpolated_at(const Eigen::Vector3d& point_in_camera,
                                   SurfacePatch& element) const {
  const auto in_grid = grid_position(point_in_camera);
  if (!in_grid) return false;
  const double left = std::floor(in_grid->x());
  const double top = std::floor(in_grid->y());
  if (!(left >= 0.0 && left < columns_ - 1 && top >= 0.0 && top < rows_ - 1))
    return nearest_to(point_in_camera, element);
  const double u = in_grid->x() - left;
  const double v = in_grid->y() - top;
  const Eigen::Vector3d ray = point_in_camera / point_in_camera.z();
  SurfacePatch blend;
  double depth_m = 0.0;
  double least_m = std::numeric_limits<double>::infinity();
  double most_m = 0.0;
  for (const int corner : {0, 1, 2, 3}) {
    const int right = corner & 1;
    const int down = corner >> 1;
    SurfacePatch plane;
    if (!at(static_cast<int>(left) + right, static_cast<int>(top) + down, plane))
      return nearest_to(point_in_camera, element);
    const double weight = (right == 1 ? u : 1.0 - u) * (down == 1 ? v : 1.0 - v);
    const double met_m = plane.normal.dot(plane.point) / plane.normal.dot(ray);
    least_m = std::min(least_m, met_m);
    most_m = std::max(most_m, met_m);
    depth_m += weight * met_m;
    blend.normal += weight * plane.normal;
    blend.noise_m += weight * plane.noise_m;
  }
  if (!(least_m > 0.0 && most_m - least_m < most_step * most_m))
    return nearest_to(point_in_camera, element);
  element = blend;
  element.point = depth_m * ray;
  element.normal.normalize();
  return true;
}

}  // namespace libmap
