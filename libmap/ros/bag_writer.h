// ROS 1 bags that RViz shows (http://wiki.ros.org/Bags/Format/2.0). The same content gives the same
// bytes: all stamps come from the content.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/ros/bag_content.h"
#include "libmap/scan/rig_images.h"

namespace libmap {

enum class BagCompression { none, bz2, lz4 };  // of a bag's chunks
const std::vector<std::pair<std::string, BagCompression>>& bag_compression_names();

struct BagContent {
  double stamp_s = 1.0;                    // of all messages: from 1e-9 to 2^32 - 1
  std::vector<BagTransform> transforms{};  // /tf_static
  std::vector<BagCloud> clouds{};
  std::vector<BagPlaces> places{};
};

// One latched message a topic. Throws Error: a stamp that ROS cannot hold, a name that is no
// topic's, a failed write (ErrorKind::failed). Callers that need the file whole or not at all pass
// an OutputFile's temporary path.
void write_bag(const std::filesystem::path& path, const BagContent& content,
               BagCompression compression = BagCompression::none);

struct RigBagOptions {
  std::string base_frame = "base_link";
  double stamp_offset_s = 0.0;  // added to each image's stamp
  BagCompression compression = BagCompression::none;
};

// The images of a rig as its driver would have recorded them, in the order of their stamps:
// /NAME/depth/image_raw with /NAME/depth/camera_info, in the frame NAME_depth_optical_frame, which
// /tf_static hangs on the base frame. Image by image: memory does not grow. Throws Error as
// write_bag, and of broken images.
void write_rig_bag(const std::filesystem::path& path, const CameraRig& rig,
                   const std::vector<RigImage>& images, const RigBagOptions& options = {});

}  // namespace libmap
