// Simulates the depth images of a robot's cameras at a given pose on a mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/scan/rig_io.h"
#include "libmap/simulate/depth_camera.h"
#include "libmap/simulate/sensor_faults.h"

namespace libmap {

struct RobotCamerasOptions {
  // Name in data/sensors or a file (sensor_model.h), which limits the range, and sets the noise if
  // `depth` has no noise. "auto": range and noise are those of `depth`.
  std::string sensor = "auto";
  // The range is also limited to that of each camera of the rig. depth_step_m is not used.
  DepthSensorOptions depth = ideal_depth_sensor(0.0, std::numeric_limits<double>::infinity());
  DepthFaults faults{};
  double stamp_s = 0.0;           // earliest possible stamp of the images
  double stamp_spread_s = 0.004;  // each camera's stamp is drawn from stamp_s to this much later,
                                  // as without a common trigger
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, RobotCamerasOptions& options);

struct RobotCameraImage {
  double stamp_s = 0.0;
  Image<std::uint16_t> depth;    // in units of the camera's depth_scale_m; 0: no measurement
  DepthMeasurement measurement;  // the image in meters, and numbers of pixels
};

// Returns one image per camera, in the rig's order; images may have no depth at all. Throws Error
// if the mesh has no triangle, the sensor is unknown, or ranges of sensor and camera are disjoint.
std::vector<RobotCameraImage> simulate_robot_cameras(const TriangleMesh& mesh, const CameraRig& rig,
                                                     const Pose& world_from_robot,
                                                     const RobotCamerasOptions& options);

// Returns z of the highest surface at (x, y), m. Throws Error if there is no surface.
double ground_height(const TriangleMesh& mesh, double x_m, double y_m);

}  // namespace libmap
