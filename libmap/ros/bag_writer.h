// Bags that RViz shows, of ROS 1 or ROS 2. The same content gives the same bytes: all stamps come
// from the content.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/ros/bag_content.h"
#include "libmap/scan/rig_images.h"

namespace libmap {

// ros1: a file, .bag; mcap: a file, .mcap; sqlite: a folder as rosbag2 of Humble writes it, which
// exists.
enum class BagFormat { ros1, mcap, sqlite };
// By the extension: none is a folder. Throws Error: another one.
BagFormat bag_format_of(const std::filesystem::path& path);
// What a folder of BagFormat::sqlite contains.
std::vector<std::string> names_in_bag_folder();

// Of chunks: bz2 of ROS 1 alone, zstd of MCAP alone; a folder of sqlite has none.
enum class BagCompression { none, bz2, lz4, zstd };
const std::vector<std::pair<std::string, BagCompression>>& bag_compression_names();

struct BagContent {
  double stamp_s = 1.0;                    // of all messages: from 1e-9 to 2^32 - 1 (ROS 2: 2^31)
  std::vector<BagTransform> transforms{};  // /tf_static
  std::vector<BagCloud> clouds{};
  std::vector<BagPlaces> places{};
  std::vector<BagGrid> grids{};  // not in a bag of ROS 1
};

// One latched message per topic. Throws Error: a stamp that ROS cannot hold, a name that is no
// topic's, a compression that the format does not have, grids in a bag of ROS 1, a failed write
// (ErrorKind::failed). Callers that need the file whole or not at all pass an OutputFile's
// temporary path.
void write_bag(const std::filesystem::path& path, BagFormat format, const BagContent& content,
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
void write_rig_bag(const std::filesystem::path& path, BagFormat format, const CameraRig& rig,
                   const std::vector<RigImage>& images, const RigBagOptions& options = {});

}  // namespace libmap
