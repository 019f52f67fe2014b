#include "libmap/scan/colmap_builder.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

bool holds(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < camera.width - 0.5 &&
         pixel.y() < camera.height - 0.5;
}

// Depth in m; 0 outside the image and for pixels without a measurement.
double depth_at(const DepthImage& depth, int x, int y) {
  if (x < 0 || y < 0 || x >= depth.width || y >= depth.height) return 0.0;
  return static_cast<double>(depth.at(x, y));
}

struct DepthPixel {
  int x = 0;
  int y = 0;
};

DepthPixel depth_pixel(const CameraView& view, const Eigen::Vector2d& ray) {
  const Eigen::Vector2d pixel = distort_to_pixel(view.depth_camera, ray);
  const auto round = [](double value, int size) {
    return static_cast<int>(std::lround(std::clamp(value, -1.0, static_cast<double>(size))));
  };
  return {round(pixel.x(), view.depth.width), round(pixel.y(), view.depth.height)};
}

// True if no depth edge is at the pixel; depth at an edge belongs to neither side.
bool is_smooth(const DepthImage& depth, const DepthPixel& pixel, double tolerance) {
  const double here = depth_at(depth, pixel.x, pixel.y);
  for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}})
    if (!(std::abs(depth_at(depth, pixel.x + dx, pixel.y + dy) - here) <= tolerance * here))
      return false;
  return true;
}

// Returns the pixel of a point; nullopt if it is occluded or outside the image.
std::optional<Eigen::Vector2d> observe(const CameraView& view, const Eigen::Vector3d& point,
                                       double tolerance) {
  const Camera& camera = view.color_camera;
  auto pixel = project_point(camera, point);
  if (!pixel || !holds(camera, *pixel)) return std::nullopt;
  const Eigen::Vector2d ray = point.head<2>() / point.z();
  const DepthPixel depth_pixel_at = depth_pixel(view, ray);
  const double depth = depth_at(view.depth, depth_pixel_at.x, depth_pixel_at.y);
  if (!(depth > 0.0) || !(std::abs(depth - point.z()) <= tolerance * depth)) return std::nullopt;
  // Beyond the lens's field of view, the distortion can map a point back into the image.
  const auto back = pixel_to_ray(camera, *pixel);
  if (!back || !(*back - ray).isZero(1e-6)) return std::nullopt;
  return pixel;
}

}  // namespace

void bind(ParameterTable& table, ColmapBuilderOptions& options) {
  table.add("point_spacing_px", options.point_spacing_px, {1.0, 10000.0},
            "spacing of the COLMAP model's points in each color image, pixels");
  table.add("point_depth_tolerance", options.depth_tolerance, {0.0, 1.0, true, false},
            "maximum relative depth difference at which two images observe the same COLMAP point");
}

ColmapBuilder::ColmapBuilder(const ColmapBuilderOptions& options) : options_(options) {
  check_parameters(options);
}

int ColmapBuilder::add_camera(const ColmapCamera& camera) {
  const std::string text = to_colmap_cameras({.cameras = {{1, camera}}});
  const int next = static_cast<int>(model_.cameras.size()) + 1;
  const auto [entry, is_new] = camera_of_text_.emplace(text, next);
  if (is_new) model_.cameras.emplace(next, camera);
  return entry->second;
}

void ColmapBuilder::add_image(const std::string& name, const CameraView& view,
                              const Pose& world_from_camera) {
  ColmapImage image{.camera = add_camera(to_colmap(view.color_camera)),
                    .name = name,
                    .camera_from_world = world_from_camera.inverse()};
  const int id = static_cast<int>(model_.images.size()) + 1;
  model_.images.emplace(id, std::move(image));
  if (view.depth.empty()) return;
  const int spacing = options_.point_spacing_px;
  GrayImage taken((view.color_camera.width + spacing - 1) / spacing,
                  (view.color_camera.height + spacing - 1) / spacing);
  observe_points(id, view, taken);
  add_points(id, view, world_from_camera, taken);
}

void ColmapBuilder::add_observation(int id, std::int64_t point, const Eigen::Vector2d& pixel) {
  ColmapImage& image = model_.images.at(id);
  model_.points.at(point).track.push_back({id, image.observations.size()});
  image.observations.push_back({pixel + Eigen::Vector2d::Constant(colmap_pixel_offset), point});
}

void ColmapBuilder::observe_points(int id, const CameraView& view, GrayImage& taken) {
  const Pose camera_from_world = model_.images.at(id).camera_from_world;
  std::vector<std::pair<std::int64_t, Eigen::Vector3d>> known;
  known.reserve(model_.points.size());
  for (const auto& [point, content] : model_.points) known.emplace_back(point, content.position);
  std::vector<std::optional<Eigen::Vector2d>> seen(known.size());
  parallel_each(known.size(), 1024, [&](std::size_t i) {
    seen[i] = observe(view, camera_from_world * known[i].second, options_.depth_tolerance);
  });
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!seen[i]) continue;
    add_observation(id, known[i].first, *seen[i]);
    taken.at(static_cast<int>(std::floor(seen[i]->x() + 0.5)) / options_.point_spacing_px,
             static_cast<int>(std::floor(seen[i]->y() + 0.5)) / options_.point_spacing_px) = 1;
  }
}

void ColmapBuilder::add_points(int id, const CameraView& view, const Pose& world_from_camera,
                               const GrayImage& taken) {
  const int spacing = options_.point_spacing_px;
  for (int row = 0; row < taken.height; ++row) {
    for (int column = 0; column < taken.width; ++column) {
      const int x = column * spacing + spacing / 2;
      const int y = row * spacing + spacing / 2;
      if (taken.at(column, row) != 0 || x >= view.color.width || y >= view.color.height) continue;
      const Eigen::Vector2d pixel(x, y);
      const auto ray = pixel_to_ray(view.color_camera, pixel);
      if (!ray) continue;
      const DepthPixel depth_pixel_at = depth_pixel(view, *ray);
      const double depth = depth_at(view.depth, depth_pixel_at.x, depth_pixel_at.y);
      if (!(depth > 0.0) || !is_smooth(view.depth, depth_pixel_at, options_.depth_tolerance))
        continue;
      const std::int64_t point = static_cast<std::int64_t>(model_.points.size()) + 1;
      model_.points.emplace(
          point, ColmapPoint{.position = world_from_camera * (depth * ray->homogeneous()),
                             .color = view.color.at(x, y)});
      add_observation(id, point, pixel);
    }
  }
}

}  // namespace libmap
