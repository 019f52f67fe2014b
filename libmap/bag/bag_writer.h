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

// A cloud and the topic for it (sensor_msgs/PointCloud2).
struct BagCloud {
  std::string topic{};
  std::string frame{};  // frame of the cloud
  PointCloud cloud{};
};

// A target of the gripper: position and approach direction in the frame BagTargets::frame.
struct BagTarget {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();    // m
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // any length > 0
  Color color{};                                         // color of ball and arrow
  std::string text{};                                    // label at the start of the arrow
};

// Targets, best first, as visualization_msgs/MarkerArray and as geometry_msgs/PoseArray. Namespaces
// of the markers: "place" (balls), "approach" (arrows that end at the positions), "text".
//
// The x axis of a target's pose is the approach direction, because RViz draws the arrows of a
// PoseArray along x. The y axis is the frame's y axis (z axis if the direction is along y), made
// perpendicular to the direction.
struct BagTargets {
  std::string marker_topic{};  // topic of the MarkerArray
  std::string pose_topic{};    // topic of the PoseArray
  std::string frame{};         // frame of positions and directions
  double arrow_m = 0.08;  // length of an arrow; the radius of a ball is an eighth of this length
  std::vector<BagTarget> targets{};
};

// Grid of square cells in the x-y plane of a frame, as grid_map_msgs/GridMap and
// nav_msgs/OccupancyGrid. Arrays contain rows * columns values, row by row from the smallest y, in
// each row from the smallest x. NaN: unknown.
struct BagGrid {
  std::string grid_map_topic{};                        // topic of the GridMap
  std::string occupancy_topic{};                       // topic of the OccupancyGrid
  std::string frame{};                                 // frame whose x-y plane contains the grid
  double cell_m = 0.0;                                 // edge length of a cell
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();  // corner with the smallest x and y
  std::size_t columns = 0;                             // number of cells along x
  std::size_t rows = 0;                                // number of cells along y

  struct Layer {
    std::string name{};
    std::vector<float> values{};
  };
  std::vector<Layer> layers{};     // at least one; a cell is valid if the first layer is not NaN
  std::vector<float> occupancy{};  // one value per cell of the OccupancyGrid, 0 to 1
};

// Static transform between two frames.
struct BagTransform {
  std::string parent{};
  std::string child{};
  Pose parent_from_child = Pose::Identity();
};

// ros1: a .bag file; mcap: a .mcap file; sqlite: an existing folder in rosbag2's format of Humble.
enum class BagFormat { ros1, mcap, sqlite };
// Returns the format by extension; sqlite without extension. Throws Error for other extensions.
BagFormat bag_format_of(const std::filesystem::path& path);
// Names of the files in a folder of BagFormat::sqlite.
std::vector<std::string> names_in_bag_folder();

// Compression of chunks. bz2: ROS 1 only; zstd: MCAP only. BagFormat::sqlite: only `none`.
enum class BagCompression { none, bz2, lz4, zstd };

struct BagContent {
  double stamp_s = 1.0;  // stamp of all messages; >= 1e-9, < 2^32 - 1 (ROS 1) or 2^31 (ROS 2)
  std::vector<BagTransform> transforms{};  // topic /tf_static
  std::vector<BagCloud> clouds{};
  std::vector<BagTargets> targets{};
  std::vector<BagGrid> grids{};  // only for ROS 2: mcap or sqlite
};

// Writes one latched message per topic, directly to `path`; for atomic output, pass the temporary
// path of an OutputFile (libmap/core/file_output.h). Throws Error for a stamp outside ROS's range,
// an invalid topic name, a compression that the format does not support, grids in a bag of ROS 1,
// and a failed write (ErrorKind::failed).
void write_bag(const std::filesystem::path& path, BagFormat format, const BagContent& content,
               BagCompression compression = BagCompression::none);

struct RigBagOptions {
  std::string base_frame = "base_link";  // frame of the robot
  double stamp_offset_s = 0.0;           // offset added to the stamps of the images
  BagCompression compression = BagCompression::none;
};

// Writes a rig's images like a camera driver: topics /NAME/depth/image_raw and
// /NAME/depth/camera_info for each camera NAME, in the frame NAME_depth_optical_frame, which
// /tf_static connects to the base frame. Each camera's first image is written first, then all
// others by stamp. One image is in memory at a time. Throws Error as write_bag does, for no images
// and damaged images.
void write_rig_bag(const std::filesystem::path& path, BagFormat format, const CameraRig& rig,
                   const std::vector<RigImage>& images, const RigBagOptions& options = {});

}  // namespace libmap
