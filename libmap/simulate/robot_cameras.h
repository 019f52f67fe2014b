// What the depth cameras of a robot see from a given pose on a mesh.
#pragma once

#include <cstddef>
#include <cstdint>
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
  // Its limits and its step are not used: they are the rig's.
  DepthSensorOptions sensor = ideal_depth_sensor(0.0, 1.0);
  DepthFaults faults{};
  double stamp_s = 0.0;
  double stamp_spread_s = 0.004;  // cameras that are not triggered together: each stamp lies this
                                  // much around stamp_s, in all
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, RobotCamerasOptions& options);

struct RobotCameraImage {
  double stamp_s = 0.0;
  Image<std::uint16_t> depth;  // in the camera's depth scale; 0 where nothing was measured
  DepthMeasurement measurement;
};

// One image for each of the rig's cameras. The robot stands still. Throws Error for a mesh
// without triangles; an image may be empty.
std::vector<RobotCameraImage> simulate_robot_cameras(const TriangleMesh& mesh, const CameraRig& rig,
                                                     const Pose& world_from_robot,
                                                     const RobotCamerasOptions& options);

// Height of the highest surface at (x, y). Throws Error if there is none.
double ground_height(const TriangleMesh& mesh, double x_m, double y_m);

}  // namespace libmap
