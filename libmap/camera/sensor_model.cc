#include "libmap/camera/sensor_model.h"

#include <yaml-cpp/yaml.h>

#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

constexpr std::size_t max_bytes = std::size_t{1} << 20U;

}  // namespace

void bind(ParameterTable& table, SensorModel& model) {
  table.add("noise_m", model.noise_m, not_negative,
            "standard deviation of depth: constant term, m");
  table.add("noise_of_range", model.noise_of_range, not_negative,
            "standard deviation of depth: term proportional to range, m per m");
  table.add("noise_of_square", model.noise_of_square, not_negative,
            "standard deviation of depth: term proportional to squared range, 1/m");
  table.add("near_m", model.near_m, not_negative, "minimum useful depth, m");
  table.add("far_m", model.far_m, positive, "maximum useful depth, m");
  table.add("depth_delay_s", model.depth_delay_s, any_number,
            "time from the color image's middle row to the depth image, s");
  table.add("rolling_shutter_s", model.rolling_shutter_s, not_negative,
            "time from the first to the last row of the color image, s");
  table.add("refine.frame_time_s", model.frame_time_s, positive, "time between two frames, s");
  table.add_former_key("refine.max_bend_m", "refine.max_depth_correction_m");
  table.add("refine.max_depth_correction_m", model.max_depth_correction_m, not_negative,
            "maximum systematic depth error: constant term, m");
  table.add_former_key("refine.bend_of_range", "refine.max_depth_correction_of_range");
  table.add("refine.max_depth_correction_of_range", model.max_depth_correction_of_range,
            not_negative, "maximum systematic depth error: term proportional to range, m per m");
}

std::filesystem::path sensor_file(const std::string& name) {
  return find_data_file("sensors", name == "ipad"   ? "ipad-lidar"
                                   : name == "d435" ? "realsense-d435"
                                                    : name);
}

SensorModel read_sensor_model(const std::string& name) {
  SensorModel model;
  ParameterTable table;
  bind(table, model);
  const std::string path = sensor_file(name).string();
  read_yaml(read_whole_file(path, max_bytes), path, [&](const YAML::Node& root) {
    if (!root.IsMap()) throw Error("not a YAML mapping");
    // All other keys belong to the simulation.
    for (const auto& entry : root)
      if (const auto key = entry.first.as<std::string>();
          table.knows(key) || key.starts_with("refine."))
        table.set(key, entry.second.as<std::string>());
    table.check();
    if (!(model.noise_m + model.noise_of_range + model.noise_of_square > 0.0))
      throw Error("noise_m, noise_of_range or noise_of_square must be > 0");
  });
  return model;
}

}  // namespace libmap
