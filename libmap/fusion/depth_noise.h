// What a depth camera measures, and with which noise.
#pragma once

namespace libmap {

// Of the form of Nguyen, Izadi and Lovell 2012 ("Modeling Kinect sensor noise for improved 3D
// reconstruction and tracking"): an axial part that grows with the range, and a lateral part that
// counts the more the more obliquely a surface is seen. The axial defaults are those of a
// time-of-flight camera as the project's scans describe it (2 mm + 0.5 % of the range); half a
// pixel is what a pixel's own footprint leaves open.
struct DepthNoise {
  double axial_m = 0.002;         // > 0: standard deviation at range 0
  double axial_of_range = 0.005;  // >= 0: what each meter of range adds, m/m
  double axial_of_square = 0.0;   // >= 0: what range squared adds, 1/m: stereo, structured light
  double lateral_px = 0.8;        // >= 0

  double axial_at(double z_m) const {
    return axial_m + (axial_of_range + axial_of_square * z_m) * z_m;
  }
  bool operator==(const DepthNoise&) const = default;
};

struct DepthSensor {
  double min_depth_m = 0.1;
  double max_depth_m = 4.0;
  double max_incidence_deg = 85.0;  // between line of sight and normal: more is grazing
  DepthNoise noise{};
};

struct SensorModel;
// The model's useful range and noise, where the sensor has the default ones.
void apply(const SensorModel& model, DepthSensor& sensor);

}  // namespace libmap
