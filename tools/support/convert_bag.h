// The parts of `graspmap convert` that read and write bags.
#pragma once

#include "libmap/ros/bag_rig.h"
#include "libmap/ros/bag_writer.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct BagCommandOptions {
  std::string input;
  std::string output;
  // Out of a bag.
  std::vector<std::string> topics;
  std::string rig;
  std::string stamp = "auto";
  bool strict = false;
  libmap::BagRigOptions depth;
  // Into a bag.
  std::string terrain;
  std::string curvature;
  std::string footholds;
  std::string frame = "auto";
  double stamp_offset_s = 0.0;
  double arrow_m = libmap::BagPlaces{}.arrow_m;
  double cell_size_m = 0.0;
  libmap::BagCompression compression = libmap::BagCompression::none;
};

// A rig's folder, or a cloud, out of a bag.
void read_bag_into_folder(const BagCommandOptions& options, Run& run);
void read_bag_into_cloud(const BagCommandOptions& options, Run& run);
// A map and what belongs to it, or a rig's folder, into a bag.
void write_map_bag(const BagCommandOptions& options, Run& run);
void write_rig_folder_bag(const BagCommandOptions& options, Run& run);

// --stamp: nothing for auto. Throws Error.
std::optional<double> bag_stamp(const BagCommandOptions& options);
libmap::CameraRig read_named_rig(const std::string& name, Run& run);

}  // namespace graspmap_tools
