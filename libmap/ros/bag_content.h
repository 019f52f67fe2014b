// What a bag is to hold, as plain data.
#pragma once

#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

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

}  // namespace libmap
