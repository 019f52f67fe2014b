// Bags that RViz shows, of ROS 1 or ROS 2. The same content gives the same bytes: all stamps come
// from the content.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/scan/rig_io.h"

namespace libmap {

// A cloud on a topic of its own (sensor_msgs/PointCloud2).
struct BagCloud {
  std::string topic{};
  std::string frame{};
  PointCloud cloud{};
};

// A place and the direction in which something comes to it.
struct BagPlace {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // of any length but 0
  Color color{};
  std::string text{};
};

// Places as visualization_msgs/MarkerArray (namespaces "place", "approach", "text") and as
// geometry_msgs/PoseArray, best first.
//
// The x axis of a pose is the direction: RViz draws the arrows of a PoseArray along it. The turn
// about it is free; the y axis is that of the frame, made square to the direction (the frame's z
// where the direction lies along y).
struct BagPlaces {
  std::string marker_topic{};
  std::string pose_topic{};
  std::string frame{};
  double arrow_m = 0.08;  // length of an arrow; a ball has an eighth of it as its radius
  std::vector<BagPlace> places{};
};

// Square cells of a frame's x-y plane as grid_map_msgs/GridMap and nav_msgs/OccupancyGrid. Arrays
// contain `columns` cells along x for each of `rows` steps along y, from the corner of smallest x
// and y; NaN is unknown.
struct BagGrid {
  std::string grid_map_topic{};
  std::string occupancy_topic{};
  std::string frame{};
  double cell_m = 0.0;
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();
  std::size_t columns = 0;
  std::size_t rows = 0;

  struct Layer {
    std::string name{};
    std::vector<float> values{};
  };
  std::vector<Layer> layers{};     // of the GridMap; a cell is valid if the first one is
  std::vector<float> occupancy{};  // from 0 to 1
};

// A frame that stands still in another (/tf_static).
struct BagTransform {
  std::string parent{};
  std::string child{};
  Pose parent_from_child = Pose::Identity();
};

// ros1: a file, .bag; mcap: a file, .mcap; sqlite: a folder as rosbag2 of Humble writes it, which
// exists.
enum class BagFormat { ros1, mcap, sqlite };
// By the extension: none is a folder. Throws Error: another one.
BagFormat bag_format_of(const std::filesystem::path& path);
// What a folder of BagFormat::sqlite contains.
std::vector<std::string> names_in_bag_folder();

// Of chunks: bz2 of ROS 1 alone, zstd of MCAP alone; a folder of sqlite has none.
enum class BagCompression { none, bz2, lz4, zstd };

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
