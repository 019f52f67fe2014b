// Published properties of depth cameras, of data/sensors/NAME.yaml.
#pragma once

#include <filesystem>
#include <string>

#include "libmap/core/parameters.h"

namespace libmap {

// The keys are those of `simulate scan`; keys "refine.KEY" are of refinement alone.
struct SensorModel {
  double noise_m = 0.0;          // standard deviation along the optical axis at range 0
  double noise_of_range = 0.0;   // what it grows by, m a m of range
  double noise_of_square = 0.0;  // ... and by range squared, 1/m
  double near_m = 0.0;           // useful range
  double far_m = 0.0;
  double depth_delay_s = 0.0;      // depth after the middle row of the picture
  double rolling_shutter_s = 0.0;  // from the first to the last row of a picture
  double frame_time_s = 0.033;     // between two pictures
  double max_bend_m = 0.01;        // of a systematic error of depth at range 0 ...
  double bend_of_range = 0.02;     // ... and what it grows by, m a m of range
};
void bind(ParameterTable& table, SensorModel& model);

// The file of a model: a path, or the name of a file in data/sensors; "d435" and "ipad" are short
// names. Throws Error: unknown name (with the nearest known one).
std::filesystem::path sensor_file(const std::string& name);
// Throws Error: as sensor_file, or a file that cannot be read.
SensorModel read_sensor_model(const std::string& name);

}  // namespace libmap
