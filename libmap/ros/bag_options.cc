// What commands ask of libmap/ros in every build.
#include "libmap/ros/bag_rig.h"
#include "libmap/ros/bag_writer.h"

namespace libmap {

void bind(ParameterTable& table, BagRigOptions& options) {
  table.add("base_frame", options.base_frame,
            "the robot's frame; auto: base_link, or the one that all else hangs on");
  table.add("transform_topic", options.transform_topic, "transforms of static frames");
  table.add("depth_unit_m", options.depth_unit_m, positive,
            "meters a unit of 16-bit images in the bag");
  table.add("depth_scale_m", options.depth_scale_m, not_negative,
            "meters a unit of the images written; 0: the rig's, or as in the bag, 0.1 mm for "
            "floats");
  table.add("near_m", options.near_m, not_negative, "nearest depth of the rig; 0: the rig's own");
  table.add("far_m", options.far_m, positive, "furthest depth of the rig; inf: the rig's own");
  table.add("tolerance_s", options.tolerance_s, not_negative,
            "images of one synchronized set are within this time of its stamp");
  table.add("every", options.every, {1.0}, "takes the first of so many moments");
}

std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan) {
  std::vector<std::string> names = {rig_file_name, synchronized_sets_file_name};
  for (const RigCamera& camera : plan.rig.cameras) names.push_back(camera.name);
  return names;
}

const std::vector<std::pair<std::string, BagCompression>>& bag_compression_names() {
  static const std::vector<std::pair<std::string, BagCompression>> names = {
      {"none", BagCompression::none},
      {"bz2", BagCompression::bz2},
      {"lz4", BagCompression::lz4},
      {"zstd", BagCompression::zstd}};
  return names;
}

}  // namespace libmap
