// Converts clouds, images, cameras, poses and grids to ROS messages. Functions without the
// parameter `header` leave the message's header empty. Private to libmap/bag.
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

// Converts a cloud to float32 fields x, y, z, then normal_x, normal_y, normal_z, rgb (PCL: red,
// green, blue as bytes of a float32) and the cloud's scalar fields in their types; little-endian,
// without padding. Throws Error for more than 4 GiB.
ros_message::PointCloud2 encode_cloud(const PointCloud& cloud);
// Converts a depth image to millimeters (16UC1) if image_unit_m is 0.001, else to meters (32FC1,
// REP-118; 0: no depth).
ros_message::Image encode_depth(const Image<std::uint16_t>& image, double image_unit_m);
// Converts a camera to image size, camera matrix K, distortion D and projection P = [K | 0].
ros_message::CameraInfo encode_camera_info(const Camera& camera);
// Converts a transform; its child frame is child_frame_id.
ros_message::TransformStamped encode_transform(const BagTransform& transform);

// Converts targets to poses whose x axes are the approach directions (see BagTargets).
ros_message::PoseArray encode_poses(const std::vector<BagTarget>& targets);
// Converts targets to one list of balls, and an arrow and a text for each target (see BagTargets).
ros_message::MarkerArray encode_markers(const BagTargets& targets,
                                        const ros_message::Header& header);

// Converts the layers to arrays in the reverse order of BagGrid's arrays: from the cell with the
// largest x and y, x fastest. Dimension labels and strides are column-major as in grid_map
// (https://github.com/ANYbotics/grid_map, grid_map_ros/include/grid_map_ros/GridMapMsgHelpers.hpp);
// the start indices of the circular buffer are 0.
ros_message::GridMap encode_grid_map(const BagGrid& grid, const ros_message::Header& header);

// Converts the occupancy to percent; unknown cells (NaN) are -1.
ros_message::OccupancyGrid encode_occupancy_grid(const BagGrid& grid,
                                                 const ros_message::Header& header);

}  // namespace libmap
