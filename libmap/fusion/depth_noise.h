// Provides range limits and noise model of a depth camera.
#pragma once

namespace libmap {

// Noise model of the form of Nguyen, Izadi and Lovell 2012 ("Modeling Kinect sensor noise for
// improved 3D reconstruction and tracking"): axial noise that grows with range, and lateral noise,
// whose effect grows with the angle of incidence. The axial defaults describe a Kinect v2 (2 mm +
// 0.5 % of range). The lateral default includes the footprint of a pixel.
struct DepthNoise {
  double axial_m = 0.002;         // > 0: standard deviation at range 0
  double axial_of_range = 0.005;  // >= 0: added per meter of range, m/m
  double axial_of_square = 0.0;   // >= 0: added per squared range (stereo, structured light), 1/m
  double lateral_px = 0.8;        // >= 0: standard deviation across the line of sight

  double axial_at(double z_m) const {  // standard deviation of depth at depth z_m
    return axial_m + (axial_of_range + axial_of_square * z_m) * z_m;
  }
  bool operator==(const DepthNoise&) const = default;
};

struct DepthSensor {
  double min_depth_m = 0.1;         // smaller depths are ignored
  double max_depth_m = 4.0;         // larger depths are ignored
  double max_incidence_deg = 85.0;  // maximum angle between line of sight and normal
  DepthNoise noise{};
};

struct SensorModel;
// Replaces default values of the range limits and the noise in `sensor` by the model's values.
void apply(const SensorModel& model, DepthSensor& sensor);

}  // namespace libmap
