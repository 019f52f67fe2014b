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
  // Name in data/sensors or a file. Limits the range, and sets the noise if `depth` has none.
  // "auto": range and noise of `depth`.
  std::string sensor = "auto";
  // The range is limited to the range of the rig's cameras, which also determine the resolution.
  DepthSensorOptions depth = ideal_depth_sensor(0.0, std::numeric_limits<double>::infinity());
  DepthFaults faults{};
  double stamp_s = 0.0;           // earliest possible stamp of the images
  double stamp_spread_s = 0.004;  // cameras without a common trigger: stamps are between stamp_s
                                  // and this much later
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, RobotCamerasOptions& options);

struct RobotCameraImage {
  double stamp_s = 0.0;
  Image<std::uint16_t> depth;  // in the camera's depth scale; 0: no measurement
  DepthMeasurement measurement;
};

// Returns one image per camera of the rig, which does not move. An image may have no depth at all.
// Throws Error if the mesh has no triangle, or the sensor is unknown or out of a camera's range.
std::vector<RobotCameraImage> simulate_robot_cameras(const TriangleMesh& mesh, const CameraRig& rig,
                                                     const Pose& world_from_robot,
                                                     const RobotCamerasOptions& options);

// Height of the highest surface at (x, y), m. Throws Error if there is none.
double ground_height(const TriangleMesh& mesh, double x_m, double y_m);

}  // namespace libmap
