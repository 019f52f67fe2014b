// Writes bags of ROS 1 and ROS 2 for RViz. Equal content with equal stamps results in equal bytes.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/scan/rig_io.h"

namespace libmap {

// Cloud on a separate topic (sensor_msgs/PointCloud2).
struct BagCloud {
  std::string topic{};
  std::string frame{};
  PointCloud cloud{};
};

// Position with an approach direction, in the frame of BagTargets.
struct BagTarget {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // m
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // any length > 0
  Color color{};                                         // of the ball and the arrow
  std::string text{};
};

// Positions as visualization_msgs/MarkerArray (namespaces "place", "approach", "text") and as
// geometry_msgs/PoseArray, best first.
//
// The x axis of a pose is the direction, along which RViz draws the arrows of a PoseArray. The
// rotation about it is arbitrary: the y axis is the frame's y (z if the direction is along y), made
// perpendicular to the direction.
struct BagTargets {
  std::string marker_topic{};
  std::string pose_topic{};
  std::string frame{};
  double arrow_m = 0.08;  // length of an arrow; a ball's radius is an eighth of this length
  std::vector<BagTarget> targets{};
};

// Grid of square cells in a frame's x-y plane as grid_map_msgs/GridMap and nav_msgs/OccupancyGrid.
// Arrays contain rows * columns values, row by row from the smallest y; a row begins with the
// smallest x. NaN is unknown.
struct BagGrid {
  std::string grid_map_topic{};
  std::string occupancy_topic{};
  std::string frame{};
  double cell_m = 0.0;                                 // edge length of a cell
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // corner with the smallest x and y
  std::size_t columns = 0;
  std::size_t rows = 0;

  struct Layer {
    std::string name{};
    std::vector<float> values{};
  };
  std::vector<Layer> layers{};     // GridMap, >= 1; a cell is valid if the first layer is not NaN
  std::vector<float> occupancy{};  // OccupancyGrid, 0 to 1
};

// Static transform between frames (/tf_static).
struct BagTransform {
  std::string parent{};
  std::string child{};
  Pose parent_from_child = Pose::Identity();
};

// ros1: a .bag file; mcap: a .mcap file; sqlite: an existing folder in Humble's rosbag2 format.
enum class BagFormat { ros1, mcap, sqlite };
// Returns the format by the extension; sqlite without one. Throws Error for unknown extensions.
BagFormat bag_format_of(const std::filesystem::path& path);
// Names of the files in a folder of BagFormat::sqlite.
std::vector<std::string> names_in_bag_folder();

// Compression of chunks. bz2: ROS 1 only; zstd: MCAP only. BagFormat::sqlite supports none only.
enum class BagCompression { none, bz2, lz4, zstd };

struct BagContent {
  double stamp_s = 1.0;                    // of all messages; >= 1e-9, < 2^32 - 1 (ROS 2: 2^31)
  std::vector<BagTransform> transforms{};  // /tf_static
  std::vector<BagCloud> clouds{};
  std::vector<BagTargets> targets{};
  std::vector<BagGrid> grids{};  // ROS 2 only
};

// Writes one latched message per topic, directly to `path`; for atomic output, pass the temporary
// path of an OutputFile. Throws Error for a stamp outside ROS's range, an invalid topic name, a
// compression that the format does not support, grids in a bag of ROS 1, and a failed write
// (ErrorKind::failed).
void write_bag(const std::filesystem::path& path, BagFormat format, const BagContent& content,
               BagCompression compression = BagCompression::none);

struct RigBagOptions {
  std::string base_frame = "base_link";  // frame of the robot
  double stamp_offset_s = 0.0;           // offset added to the stamps of the images
  BagCompression compression = BagCompression::none;
};

// Writes the images of a rig in the topics of a camera driver: /NAME/depth/image_raw and
// /NAME/depth/camera_info in the frame NAME_depth_optical_frame, which /tf_static connects to the
// base frame. The order is by stamp, after the first image of each camera. One image is in memory
// at a time. Throws Error as write_bag does, and for no or damaged images.
void write_rig_bag(const std::filesystem::path& path, BagFormat format, const CameraRig& rig,
                   const std::vector<RigImage>& images, const RigBagOptions& options = {});

}  // namespace libmap
