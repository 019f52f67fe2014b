#include "libmap/simulate/robot_cameras.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "libmap/camera/sensor_model.h"
#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/simulate/sensor_faults.h"

namespace libmap {

namespace {

constexpr std::uint64_t stamp_key = 1;
constexpr std::uint64_t camera_key = 1000;
constexpr std::uint64_t hole_key = 2000;

Image<std::uint16_t> to_units(const DepthImage& depth, double depth_scale_m) {
  Image<std::uint16_t> units(depth.width, depth.height);
  for (std::size_t i = 0; i < units.pixels.size(); ++i) {
    const double value = std::round(static_cast<double>(depth.pixels[i]) / depth_scale_m);
    // Sensors report saturation as 65535.
    units.pixels[i] = value < 65535.0 ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
  }
  return units;
}

DepthSensorOptions with_sensor(DepthSensorOptions depth, const std::string& sensor) {
  if (sensor == "auto") return depth;
  const SensorModel model = read_sensor_model(sensor);
  depth.near_m = std::max(depth.near_m, model.near_m);
  depth.far_m = std::min(depth.far_m, model.far_m);
  if (depth.noise_m != 0.0 || depth.noise_of_range != 0.0 || depth.noise_of_square != 0.0)
    return depth;
  depth.noise_m = model.noise_m;
  depth.noise_of_range = model.noise_of_range;
  depth.noise_of_square = model.noise_of_square;
  return depth;
}

// Limits the range of the sensor to that of the camera.
DepthSensorOptions sensor_of(const RigCamera& camera, DepthSensorOptions depth,
                             const std::string& sensor) {
  depth.depth_step_m = 0.0;
  depth.near_m = std::max(depth.near_m, camera.near_m);
  depth.far_m = std::min(depth.far_m, camera.far_m);
  if (!(depth.far_m > depth.near_m))
    throw Error("the range of camera " + camera.name + " is outside that of the sensor",
                {.file = sensor_file(sensor).string(),
                 .field = "far_m",
                 .value = to_text(depth.far_m),
                 .bound = "> " + to_text(depth.near_m)});
  return depth;
}

}  // namespace

void bind(ParameterTable& table, RobotCamerasOptions& options) {
  table.add(
      "sensor", options.sensor,
      "depth camera (name in data/sensors, or file): limits the rig's range and, without noise "
      "options, sets the noise; auto: neither");
  bind_noise(table, options.depth);
  bind(table, options.faults);
  table.add("stamp_s", options.stamp_s, not_negative, "start of the interval of random stamps, s");
  table.add("stamp_spread_s", options.stamp_spread_s, not_negative,
            "maximum difference between the stamps of the cameras, s");
  table.add("seed", options.seed, not_negative, "random seed of noise and stamps");
}

std::vector<RobotCameraImage> simulate_robot_cameras(const TriangleMesh& mesh, const CameraRig& rig,
                                                     const Pose& world_from_robot,
                                                     const RobotCamerasOptions& options) {
  const DepthSensorOptions depth = with_sensor(options.depth, options.sensor);
  const VisibleSurface surface(mesh);
  RandomStream stamps(options.seed, stamp_key);
  std::vector<RobotCameraImage> images;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const RigCamera& camera = rig.cameras[i];
    const DepthSensorOptions sensor = sensor_of(camera, depth, options.sensor);
    const ViewRays rays = make_view_rays(camera.camera);
    const Pose world_from_camera = world_from_robot * camera.camera.base_from_camera;
    SurfaceView view = surface.view(rays, world_from_camera, false);
    add_multipath(view, surface, rays, world_from_camera, options.faults.multipath);
    distort_depth(view, options.faults);
    RobotCameraImage image;
    image.measurement = measure_depth(view, rays, sensor, mix_bits(options.seed, camera_key + i));
    image.measurement.measured -=
        punch_holes(image.measurement.depth, options.faults, mix_bits(options.seed, hole_key + i));
    image.depth = to_units(image.measurement.depth, camera.depth_scale_m);
    image.stamp_s = options.stamp_s + options.stamp_spread_s * stamps.uniform();
    images.push_back(std::move(image));
  }
  return images;
}

double ground_height(const TriangleMesh& mesh, double x_m, double y_m) {
  const RayCaster caster(mesh);
  const double above = bounds_of(mesh.vertices).max.z() + 1.0;
  const auto hit = caster.cast({x_m, y_m, above}, {0.0, 0.0, -1.0});
  if (!hit)
    throw Error("the mesh has no surface at this position",
                {.field = "x, y", .value = to_text(x_m) + ", " + to_text(y_m)});
  return above - hit->distance;
}

}  // namespace libmap
