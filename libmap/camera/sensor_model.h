// Published properties of depth cameras (noise, range, timing), read from data/sensors/NAME.yaml.
#pragma once

#include <filesystem>
#include <string>

#include "libmap/core/parameters.h"

namespace libmap {

// Keys of the file: options of the command `simulate scan`; "refine.KEY" only for refinement.
// The standard deviation of a depth z is noise_m + noise_of_range z + noise_of_square z^2.
struct SensorModel {
  double noise_m = 0.0;                  // >= 0; at least one noise value is > 0
  double noise_of_range = 0.0;           // >= 0, m per m
  double noise_of_square = 0.0;          // >= 0, 1/m
  double near_m = 0.0;                   // >= 0: minimum useful depth
  double far_m = 0.0;                    // > 0: maximum useful depth
  double depth_delay_s = 0.0;            // delay of depth after the middle row of the color image
  double rolling_shutter_s = 0.0;        // time from the first to the last row of the color image
  double frame_time_s = 0.033;           // time between two frames
  double max_depth_correction_m = 0.01;  // maximum systematic depth error: constant term
  double max_depth_correction_of_range = 0.02;  // term proportional to depth, m per m
};
void bind(ParameterTable& table, SensorModel& model);

// Returns the YAML file of a sensor: `name` is a path, a file name in data/sensors, or one of the
// short names "d435" and "ipad". Throws Error for an unknown name (with the nearest known one).
std::filesystem::path sensor_file(const std::string& name);
// Reads the model from sensor_file(name). Throws Error as sensor_file does, or for an invalid file.
SensorModel read_sensor_model(const std::string& name);

}  // namespace libmap
