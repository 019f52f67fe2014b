#include "libmap/simulate/sensor_faults.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "libmap/camera/depth_correction.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

constexpr int grid_px = 6;
constexpr int bounces = 64;
// Distance of ray origins from their surface.
constexpr double lift_m = 1e-4;
// Minimum of the cosine that attenuates direct light, for grazing incidence.
constexpr double min_cosine = 0.1;

// Unit vectors with a density proportional to their cosine with z: a uniform spiral on the disc.
const std::vector<Eigen::Vector3d>& cosine_directions() {
  static const std::vector<Eigen::Vector3d> all = [] {
    std::vector<Eigen::Vector3d> list;
    const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
    for (int n = 0; n < bounces; ++n) {
      const double square = (n + 0.5) / bounces;
      const double radius = std::sqrt(square);
      list.emplace_back(radius * std::cos(n * golden_angle), radius * std::sin(n * golden_angle),
                        std::sqrt(1.0 - square));
    }
    return list;
  }();
  return all;
}

class Reflections {
 public:
  Reflections(const VisibleSurface& surface, const Eigen::Vector3d& camera, double reflectance)
      : caster_(surface.caster()),
        mesh_(surface.mesh()),
        camera_(camera),
        reflectance_(reflectance) {}

  // Range error in this direction, m; NaN if there is no surface.
  double range_error(const Eigen::Vector3d& direction) const {
    const auto hit = caster_.cast(camera_, direction);
    if (!hit) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::Vector3d point = camera_ + hit->distance * direction;
    const Eigen::Vector3d normal = normal_against(*hit, direction);
    const double range = (point - camera_).norm();
    const double cosine = std::max(min_cosine, -normal.dot(direction) / direction.norm());
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), normal);
    double light = 0.0;
    double sum = 0.0;
    for (const Eigen::Vector3d& around : cosine_directions()) {
      const Bounce bounce = bounce_from(point + lift_m * normal, turn * around);
      if (!(bounce.light > 0.0)) continue;
      const double part = bounce.light * range * range / cosine / bounces;
      light += part;
      sum += part * 0.5 * (bounce.way_m - range);
    }
    return reflectance_ * sum / (1.0 + reflectance_ * light);
  }

 private:
  // Light from the camera that reaches a point via another surface: path length, and strength for a
  // reflectance of 1.
  struct Bounce {
    double way_m = 0.0;
    double light = 0.0;
  };

  Eigen::Vector3d normal_against(const RayHit& hit, const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d normal = area_normal(mesh_, mesh_.triangles[hit.triangle]).normalized();
    return normal.dot(direction) > 0.0 ? Eigen::Vector3d(-normal) : normal;
  }

  Bounce bounce_from(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const {
    const auto hit = caster_.cast(point, direction);
    if (!hit) return {};
    const Eigen::Vector3d normal = normal_against(*hit, direction);
    const Eigen::Vector3d mirror = point + hit->distance * direction + lift_m * normal;
    const Eigen::Vector3d to_camera = camera_ - mirror;
    const double range = to_camera.norm();
    const double cosine = normal.dot(to_camera) / range;
    if (!(cosine > 0.0) || caster_.cast(mirror, to_camera, 0.0, 1.0)) return {};
    return {hit->distance + range, cosine / (range * range)};
  }

  const RayCaster& caster_;
  const TriangleMesh& mesh_;
  Eigen::Vector3d camera_;
  double reflectance_;
};

// Bilinear interpolation over the finite nodes around a position; 0 if there are none.
double error_between(const Image<double>& grid, double x, double y) {
  const int left = std::clamp(static_cast<int>(x), 0, grid.width - 2);
  const int top = std::clamp(static_cast<int>(y), 0, grid.height - 2);
  double sum = 0.0;
  double weights = 0.0;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double error = grid.at(left + i, top + j);
      const double weight =
          std::max(0.0, 1.0 - std::abs(x - left - i)) * std::max(0.0, 1.0 - std::abs(y - top - j));
      if (!std::isfinite(error) || !(weight > 0.0)) continue;
      sum += weight * error;
      weights += weight;
    }
  return weights > 0.0 ? sum / weights : 0.0;
}

void add_errors(DepthImage& depth, const std::vector<Eigen::Vector2d>& rays,
                const Image<double>& grid, double shift) {
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      float& z = depth.at(x, y);
      const double range_of_depth = rays[depth.index(x, y)].homogeneous().norm();
      if (!(z > 0.0F) || !std::isfinite(range_of_depth)) continue;
      const double error = error_between(grid, (x + shift) / grid_px, (y + shift) / grid_px);
      z += static_cast<float>(error / range_of_depth);
    }
}

}  // namespace

void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance) {
  if (!(reflectance > 0.0)) return;
  const Reflections reflections(surface, world_from_camera.translation(), reflectance);
  // The grid extends beyond the image by up to one node.
  Image<double> grid((rays.width - 1) / grid_px + 2, (rays.height - 1) / grid_px + 2,
                     std::numeric_limits<double>::quiet_NaN());
  parallel_each(static_cast<std::size_t>(grid.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < grid.width; ++x) {
      const std::size_t pixel = view.depth.index(std::min(x * grid_px, rays.width - 1),
                                                 std::min(y * grid_px, rays.height - 1));
      const Eigen::Vector2d& ray = rays.centers[pixel];
      if (ray.allFinite())
        grid.at(x, y) = reflections.range_error(world_from_camera.linear() * ray.homogeneous());
    }
  });
  add_errors(view.depth, rays.centers, grid, 0.0);
  add_errors(view.corner_depth, rays.corners, grid, -0.5);
}

namespace {

using std::numbers::pi;

constexpr int hole_spacing_px = 24;
constexpr double hole_radius_px = 8.0;
constexpr int max_blur_steps = 64;
// Periods of exposure and white balance drift, frames.
constexpr double exposure_period = 9.0;
constexpr double balance_period = 23.0;

Eigen::Vector3d random_direction(RandomStream& random) {
  Eigen::Vector3d direction;
  do {
    for (Eigen::Index axis = 0; axis < 3; ++axis) direction[axis] = random.normal();
  } while (!(direction.norm() > 1e-6));
  return direction.normalized();
}

}  // namespace

void bind(ParameterTable& table, DepthFaults& faults) {
  table.add("depth_scale_percent", faults.scale_percent, {-50.0, 50.0},
            "fault: scale error of depth, percent");
  table.add_former_key("depth_wiggle_m", "depth_periodic_error_m");
  table.add(
      "depth_periodic_error_m", faults.periodic_error_m, any_number,
      "fault: amplitude of a periodic depth error (time of flight: Lindner and Kolb 2006), m");
  table.add_former_key("depth_wiggle_period_m", "depth_error_period_m");
  table.add("depth_error_period_m", faults.error_period_m, positive,
            "fault: depth difference over which the periodic depth error repeats, m");
  table.add("depth_corner_m", faults.corner_m, any_number,
            "fault: depth error in the image corners, m; in the image, it is proportional to the "
            "squared distance from the center (Teichman et al. 2013)");
  table.add("depth_holes", faults.holes, zero_to_one,
            "fault: share of the depth image covered by discs without depth");
  table.add("multipath", faults.multipath, zero_to_one,
            "fault: reflectance of surfaces for multipath interference of a time-of-flight camera, "
            "which rounds concave edges (Fuchs 2010)");
}

void bind(ParameterTable& table, PhotoFaults& faults) {
  table.add("exposure_drift", faults.exposure_drift, zero_to_one,
            "fault: relative amplitude of the drift of brightness over the frames");
  table.add(
      "white_balance_drift", faults.white_balance_drift, zero_to_one,
      "fault: relative amplitude of the drift of white balance (red against blue) over the frames");
  table.add("exposure_s", faults.exposure_s, not_negative,
            "fault: exposure time of color images, during which motion blurs them, s");
  table.add("blurred_frames", faults.blurred_frames, zero_to_one,
            "fault: share of frames with motion blur if an exposure time is set");
  table.add("jpeg_quality", faults.jpeg_quality, {0, 100},
            "fault: JPEG quality of the stored color images; 0: no compression");
}

void bind(ParameterTable& table, CalibrationFaults& faults) {
  table.add("stored_focal_percent", faults.focal_percent, {-50.0, 50.0},
            "fault: error of the stored focal lengths, percent");
  table.add("stored_cx_px", faults.cx_px, any_number,
            "fault: error of the stored principal point in x, pixels");
  table.add("stored_cy_px", faults.cy_px, any_number,
            "fault: error of the stored principal point in y, pixels");
  table.add("registration_shift_mm", faults.depth_shift_mm, not_negative,
            "fault: translation error of the registration of depth to color, mm");
  table.add("registration_turn_deg", faults.depth_turn_deg, {0.0, 45.0},
            "fault: rotation error of the registration of depth to color, degrees");
  table.add("depth_baseline_mm", faults.depth_baseline_mm, any_number,
            "distance of the depth camera to the right of the color camera, mm");
  table.add("depth_width_px", faults.depth_width_px, {0, 16384},
            "width of depth images (field of view as color), pixels; 0: width of color");
  table.add("depth_height_px", faults.depth_height_px, {0, 16384},
            "height of depth images (field of view as color), pixels; 0: height of color");
  table.add("depth_delay_s", faults.depth_delay_s, any_number,
            "fault: delay of each depth image after the color image, s");
  table.add("rolling_shutter_s", faults.rolling_shutter_s, not_negative,
            "fault: time from the first to the last row of a color image, s (RealSense D435: about "
            "0.02); depth has a global shutter");
}

void bind(ParameterTable& table, RecordingFaults& faults) {
  table.add("dropped_frames", faults.dropped_frames, zero_to_one, "fault: share of missing frames");
  table.add("duplicated_frames", faults.duplicated_frames, zero_to_one,
            "fault: share of frames that repeat the images of the previous frame");
  table.add("stamp_error_s", faults.stamp_error_s, not_negative,
            "fault: standard deviation of the errors of the stored stamps, s");
}

void bind(ParameterTable& table, SensorFaults& faults) {
  bind(table, faults.depth);
  bind(table, faults.photo);
  bind(table, faults.calibration);
  bind(table, faults.recording);
}

double DepthFaults::measured(double depth_m, double radius2) const {
  return depth_m * (1.0 + 0.01 * scale_percent) +
         periodic_error_m * std::sin(2.0 * pi * depth_m / error_period_m) + corner_m * radius2;
}

Camera stored_camera(Camera camera, const CalibrationFaults& faults) {
  camera.fx *= 1.0 + 0.01 * faults.focal_percent;
  camera.fy *= 1.0 + 0.01 * faults.focal_percent;
  camera.cx += faults.cx_px;
  camera.cy += faults.cy_px;
  return camera;
}

Pose color_from_depth(const CalibrationFaults& faults, std::uint64_t seed) {
  Pose pose = Pose::Identity();
  RandomStream random(seed, 1);
  const Eigen::Vector3d shift = random_direction(random);
  const Eigen::Vector3d axis = random_direction(random);
  pose.translation() = 1e-3 * faults.depth_shift_mm * shift;
  pose.linear() = Eigen::AngleAxisd(faults.depth_turn_deg * pi / 180.0, axis).toRotationMatrix();
  return stored_color_from_depth(faults) * pose;
}

Pose stored_color_from_depth(const CalibrationFaults& faults) {
  Pose pose = Pose::Identity();
  pose.translation().x() = 1e-3 * faults.depth_baseline_mm;
  return pose;
}

std::vector<RecordedFrame> recorded_frames(std::size_t frames, const RecordingFaults& faults,
                                           std::uint64_t seed) {
  std::vector<RecordedFrame> recorded;
  for (std::size_t n = 0; n < frames; ++n) {
    RandomStream random(seed, n);
    const double fate = random.uniform();
    const double repetition = random.uniform();
    if (n > 0 && fate < faults.dropped_frames) continue;
    const bool repeats = n > 0 && repetition < faults.duplicated_frames;
    recorded.push_back({n, repeats ? recorded.back().image_frame : n,
                        faults.stamp_error_s > 0.0 ? faults.stamp_error_s * random.normal() : 0.0});
  }
  return recorded;
}

void distort_depth(SurfaceView& view, const DepthFaults& faults) {
  if (!faults.changes_depth()) return;
  const int w = view.depth.width;
  const int h = view.depth.height;
  // Corner (x, y) is half a pixel before pixel (x, y).
  const auto distort = [&](DepthImage& depth, double shift) {
    for (int y = 0; y < depth.height; ++y)
      for (int x = 0; x < depth.width; ++x)
        if (float& z = depth.at(x, y); z > 0.0F)
          z = static_cast<float>(
              std::max(faults.measured(static_cast<double>(z),
                                       squared_image_radius(w, h, x + shift, y + shift)),
                       0.0));
  };
  distort(view.depth, 0.0);
  distort(view.corner_depth, -0.5);
}

std::size_t punch_holes(DepthImage& depth, const DepthFaults& faults, std::uint64_t seed) {
  if (!(faults.holes > 0.0)) return 0;
  // One disc per square of a lattice, with a probability for the requested share of the image.
  const double fraction_of_disc =
      pi * hole_radius_px * hole_radius_px / (hole_spacing_px * hole_spacing_px);
  const double probability = faults.holes / fraction_of_disc;
  std::size_t lost = 0;
  std::uint64_t square = 0;
  for (int top = 0; top < depth.height; top += hole_spacing_px)
    for (int left = 0; left < depth.width; left += hole_spacing_px) {
      RandomStream random(seed, square++);
      if (!(random.uniform() < probability)) continue;
      const double x = left + hole_spacing_px * random.uniform();
      const double y = top + hole_spacing_px * random.uniform();
      const double radius = hole_radius_px * std::max(1.0, std::sqrt(probability));
      for (int row = std::max(0, static_cast<int>(y - radius));
           row <= std::min(depth.height - 1, static_cast<int>(y + radius)); ++row)
        for (int column = std::max(0, static_cast<int>(x - radius));
             column <= std::min(depth.width - 1, static_cast<int>(x + radius)); ++column) {
          float& z = depth.at(column, row);
          if (z <= 0.0F || std::hypot(column - x, row - y) > radius) continue;
          z = 0.0F;
          ++lost;
        }
    }
  return lost;
}

void blur_by_motion(SurfaceView& view, const Camera& camera,
                    const std::function<Pose(double time_s)>& now_from_later, double exposure_s) {
  const Image<Eigen::Vector3f> sharp = view.color;
  // Image motion is assumed to be uniform during the exposure: two projections per point suffice.
  const Pose first_from_now = now_from_later(-0.5 * exposure_s).inverse();
  const Pose last_from_now = now_from_later(0.5 * exposure_s).inverse();
  const double far_away = 1e3;
  parallel_each(static_cast<std::size_t>(sharp.height), 8, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < sharp.width; ++x) {
      const auto ray = pixel_to_ray(camera, Eigen::Vector2d(x, y));
      if (!ray) continue;
      const auto z = static_cast<double>(view.depth.at(x, y));
      const Eigen::Vector3d point = (z > 0.0 ? z : far_away) * ray->homogeneous();
      const auto first = project_point(camera, first_from_now * point);
      const auto last = project_point(camera, last_from_now * point);
      if (!first || !last) continue;
      const Eigen::Vector2d way = *last - *first;
      const int steps = std::clamp(static_cast<int>(std::ceil(way.norm())) + 1, 1, max_blur_steps);
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      // Samples the points that pass this pixel during the exposure.
      for (int n = 0; n < steps; ++n) {
        const Eigen::Vector2d from = Eigen::Vector2d(x, y) + ((n + 0.5) / steps - 0.5) * way;
        sum += bilinear_color(sharp, from.x(), from.y());
      }
      view.color.at(x, y) = sum / static_cast<float>(steps);
    }
  });
}

bool is_blurred(const PhotoFaults& faults, std::uint64_t seed) {
  return faults.exposure_s > 0.0 && RandomStream(seed, 0).uniform() < faults.blurred_frames;
}

void change_exposure(SurfaceView& view, const PhotoFaults& faults, std::uint64_t seed,
                     std::uint64_t frame) {
  if (faults.exposure_drift == 0.0 && faults.white_balance_drift == 0.0) return;
  const auto wave = [&](std::uint64_t key, double period) {
    return std::sin(2.0 * pi * (static_cast<double>(frame) / period + unit_noise(seed, key)));
  };
  const double brightness = 1.0 + faults.exposure_drift * wave(1, exposure_period);
  const double balance = faults.white_balance_drift * wave(2, balance_period);
  const Eigen::Vector3f gains(static_cast<float>(brightness * (1.0 + balance)),
                              static_cast<float>(brightness),
                              static_cast<float>(brightness * (1.0 - balance)));
  for (Eigen::Vector3f& color : view.color.pixels) color = color.cwiseProduct(gains);
}

ColorImage compress_photo(const ColorImage& photo, const PhotoFaults& faults) {
  return faults.jpeg_quality > 0 ? decode_color(encode_jpeg(photo, faults.jpeg_quality)) : photo;
}

}  // namespace libmap
