// Converts plain data to messages. Their headers are empty, except where a header is passed.
// Private to libmap/bag.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libmap/bag/bag_writer.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

// Encodes a cloud for RViz and PCL: float32 x, y, z, then normal_x, normal_y, normal_z, rgb (PCL's
// packing, as float32) and the cloud's fields in the fields' types; little-endian, no padding.
// Throws Error for more than 4 GiB.
ros_message::PointCloud2 encode_cloud(const PointCloud& cloud);

// Encodes depth in millimeters (16UC1) if image_unit_m is 0.001, else in meters (REP-118's 32FC1,
// 0: not measured).
ros_message::Image encode_depth(const Image<std::uint16_t>& image, double image_unit_m);

// Encodes size, K, D, and P = K without rectification.
ros_message::CameraInfo encode_camera_info(const Camera& camera);

ros_message::TransformStamped encode_transform(const BagTransform& transform);

// Encodes poses with the direction as x axis.
ros_message::PoseArray encode_poses(const std::vector<BagTarget>& targets);

// Encodes one list of balls at all positions and, for each, a text and an arrow that ends there.
ros_message::MarkerArray encode_markers(const BagTargets& targets,
                                        const ros_message::Header& header);

// Encodes layers from the corner of largest x and y, x first, the reverse order of BagGrid's
// arrays. Column-major with the labels and strides of grid_map
// (https://github.com/ANYbotics/grid_map, grid_map_ros/include/grid_map_ros/GridMapMsgHelpers.hpp);
// the circular buffer begins at 0, 0.
ros_message::GridMap encode_grid_map(const BagGrid& grid, const ros_message::Header& header);

// Encodes the occupancy in percent; unknown is -1.
ros_message::OccupancyGrid encode_occupancy_grid(const BagGrid& grid,
                                                 const ros_message::Header& header);

}  // namespace libmap
