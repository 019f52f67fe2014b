#include "libmap/fusion/depth_noise.h"

#include <algorithm>

#include "libmap/camera/sensor_model.h"

namespace libmap {

namespace {

constexpr double min_axial_m = 1e-6;

}  // namespace

void apply(const SensorModel& model, DepthSensor& sensor) {
  const DepthSensor unset;
  if (sensor.min_depth_m == unset.min_depth_m) sensor.min_depth_m = model.near_m;
  if (sensor.max_depth_m == unset.max_depth_m) sensor.max_depth_m = model.far_m;
  DepthNoise as_unset = unset.noise;
  as_unset.lateral_px = sensor.noise.lateral_px;
  if (sensor.noise == as_unset)
    sensor.noise = {std::max(min_axial_m, model.noise_m), model.noise_of_range,
                    model.noise_of_square, sensor.noise.lateral_px};
}

}  // namespace libmap
