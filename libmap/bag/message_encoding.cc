#include "libmap/bag/message_encoding.h"

#include <cmath>
#include <cstring>

namespace libmap {

namespace {

using ros_message::Marker;

ros_message::Quaternion to_ros_rotation(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  return {q.x(), q.y(), q.z(), q.w()};
}

ros_message::Point to_ros_point(const Eigen::Vector3d& point) {
  return {point.x(), point.y(), point.z()};
}

ros_message::ColorRGBA to_ros_color(const Color& color) {
  return {static_cast<float>(color[0]) / 255.0F, static_cast<float>(color[1]) / 255.0F,
          static_cast<float>(color[2]) / 255.0F, 1.0F};
}

// Returns a rotation whose x axis is the direction.
Eigen::Matrix3d axes_along(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d x = direction.normalized();
  const Eigen::Vector3d guide =
      std::abs(x.y()) < 0.999 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d y = (guide - guide.dot(x) * x).normalized();
  Eigen::Matrix3d axes;
  axes << x, y, x.cross(y);
  return axes;
}

Marker marker_of(const char* name, std::int32_t id, std::int32_t shape,
                 const ros_message::Header& header) {
  Marker marker;
  marker.header = header;
  marker.ns = name;
  marker.id = id;
  marker.shape = shape;
  return marker;
}

}  // namespace

ros_message::Image encode_depth(const Image<std::uint16_t>& image, double image_unit_m) {
  const bool millimeters = image_unit_m == 0.001;
  ros_message::Image message;
  message.width = static_cast<std::uint32_t>(image.width);
  message.height = static_cast<std::uint32_t>(image.height);
  message.encoding = millimeters ? "16UC1" : "32FC1";
  const std::size_t bytes = millimeters ? 2 : 4;
  message.step = static_cast<std::uint32_t>(bytes) * message.width;
  message.data.resize(image.pixels.size() * bytes);
  for (std::size_t n = 0; n < image.pixels.size(); ++n) {
    const std::uint16_t units = image.pixels[n];
    const float depth = units == 65535 ? 0.0F : static_cast<float>(units * image_unit_m);
    if (millimeters)
      std::memcpy(message.data.data() + 2 * n, &units, 2);
    else
      std::memcpy(message.data.data() + 4 * n, &depth, 4);
  }
  return message;
}

ros_message::CameraInfo encode_camera_info(const Camera& camera) {
  ros_message::CameraInfo info;
  info.width = static_cast<std::uint32_t>(camera.width);
  info.height = static_cast<std::uint32_t>(camera.height);
  const bool few = camera.distortion.size() <= 5;
  info.distortion_model = camera.distortion_model == DistortionModel::equidistant ? "equidistant"
                          : few                                                   ? "plumb_bob"
                                : "rational_polynomial";
  info.d.assign(camera.distortion.begin(), camera.distortion.end());
  if (info.d.size() < 5 && camera.distortion_model != DistortionModel::equidistant)
    info.d.resize(5, 0.0);
  info.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.p = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return info;
}

ros_message::TransformStamped encode_transform(const BagTransform& transform) {
  ros_message::TransformStamped message;
  message.header.frame_id = transform.parent;
  message.child_frame_id = transform.child;
  message.transform = {{to_ros_point(transform.parent_from_child.translation())},
                       to_ros_rotation(transform.parent_from_child.linear())};
  return message;
}

ros_message::PoseArray encode_poses(const std::vector<BagTarget>& targets) {
  ros_message::PoseArray message;
  for (const BagTarget& target : targets) {
    message.poses.push_back(
        {to_ros_point(target.position), to_ros_rotation(axes_along(target.direction))});
  }
  return message;
}

ros_message::MarkerArray encode_markers(const BagTargets& targets,
                                        const ros_message::Header& header) {
  ros_message::MarkerArray message;
  const double length = targets.arrow_m;
  Marker balls = marker_of("place", 0, Marker::SPHERE_LIST, header);
  balls.scale = {{length / 4, length / 4, length / 4}};
  balls.color.a = 1.0F;
  std::int32_t id = 0;
  for (const BagTarget& target : targets.targets) {
    balls.points.push_back(to_ros_point(target.position));
    balls.colors.push_back(to_ros_color(target.color));
    Marker arrow = marker_of("approach", id, Marker::ARROW, header);
    const Eigen::Vector3d start = target.position - length * target.direction.normalized();
    arrow.points = {to_ros_point(start), to_ros_point(target.position)};
    arrow.scale = {{length / 10, length / 5, length / 4}};  // shaft, head, head's length
    arrow.color = to_ros_color(target.color);
    Marker text = marker_of("text", id, Marker::TEXT_VIEW_FACING, header);
    text.pose.position = to_ros_point(start);
    text.text = target.text;
    text.scale.z = length / 4;  // letter height
    text.color = to_ros_color({255, 255, 255});
    message.markers.push_back(arrow);
    message.markers.push_back(text);
    ++id;
  }
  if (!targets.targets.empty()) message.markers.insert(message.markers.begin(), balls);
  return message;
}

ros_message::GridMap encode_grid_map(const BagGrid& grid, const ros_message::Header& header) {
  ros_message::GridMap message;
  message.header = header;
  message.info.resolution = grid.cell_m;
  message.info.length_x = grid.cell_m * static_cast<double>(grid.columns);
  message.info.length_y = grid.cell_m * static_cast<double>(grid.rows);
  message.info.pose.position.x = grid.corner_m.x() + message.info.length_x / 2;
  message.info.pose.position.y = grid.corner_m.y() + message.info.length_y / 2;
  const auto rows = static_cast<std::uint32_t>(grid.columns);  // grid_map's row index is along x
  const auto columns = static_cast<std::uint32_t>(grid.rows);
  for (const BagGrid::Layer& layer : grid.layers) {
    message.layers.push_back(layer.name);
    ros_message::Float32MultiArray& array = message.data.emplace_back();
    array.layout.dim = {{"column_index", columns, rows * columns}, {"row_index", rows, rows}};
    array.data.assign(layer.values.rbegin(), layer.values.rend());
  }
  message.basic_layers.assign(1, message.layers.at(0));
  return message;
}

ros_message::OccupancyGrid encode_occupancy_grid(const BagGrid& grid,
                                                 const ros_message::Header& header) {
  ros_message::OccupancyGrid message;
  message.header = header;
  message.info.map_load_time = header.stamp;
  message.info.resolution = static_cast<float>(grid.cell_m);
  message.info.width = static_cast<std::uint32_t>(grid.columns);
  message.info.height = static_cast<std::uint32_t>(grid.rows);
  message.info.origin.position = to_ros_point({grid.corner_m.x(), grid.corner_m.y(), 0.0});
  for (const float value : grid.occupancy)
    message.data.push_back(std::isnan(value)
                               ? std::int8_t{-1}
                               : static_cast<std::int8_t>(std::lround(100.0F * value)));
  return message;
}

}  // namespace libmap
