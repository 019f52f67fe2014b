// ROS messages in bags as plain structs; message_codec.h encodes them. Private to libmap/bag.
//
// Definitions: http://docs.ros.org/en/noetic (ROS 1), https://docs.ros.org/en/humble/p/sensor_msgs
// and other packages (ROS 2, Humble to Jazzy), https://docs.ros.org/en/jazzy/p/grid_map_msgs. In
// each struct, fields(message, visit) calls visit(name, field) for each field in the order of the
// message's definition; visit.ros2 is true for ROS 2.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/bag/bag_reader.h"

namespace libmap::ros_message {

// ROS 1: time; ROS 2: builtin_interfaces/Time.
struct Time {
  std::int64_t nanoseconds = 0;
};

struct Duration {
  static constexpr MessageType type{"builtin_interfaces/Duration"};
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;

  static void fields(auto& m, auto& visit) {
    visit("sec", m.sec);
    visit("nanosec", m.nanosec);
  }
};

struct Header {
  static constexpr MessageType type{"std_msgs/Header"};
  std::uint32_t seq = 0;  // ROS 1 only
  Time stamp{};
  std::string frame_id{};

  static void fields(auto& m, auto& visit) {
    if (!visit.ros2) visit("seq", m.seq);
    visit("stamp", m.stamp);
    visit("frame_id", m.frame_id);
  }
};

struct ColorRGBA {
  static constexpr MessageType type{"std_msgs/ColorRGBA"};
  float r = 0, g = 0, b = 0, a = 0;

  static void fields(auto& m, auto& visit) {
    visit("r", m.r);
    visit("g", m.g);
    visit("b", m.b);
    visit("a", m.a);
  }
};

struct Point {
  static constexpr MessageType type{"geometry_msgs/Point"};
  double x = 0, y = 0, z = 0;

  static void fields(auto& m, auto& visit) {
    visit("x", m.x);
    visit("y", m.y);
    visit("z", m.z);
  }
};

struct Vector3 : Point {
  static constexpr MessageType type{"geometry_msgs/Vector3"};
};

struct Quaternion {
  static constexpr MessageType type{"geometry_msgs/Quaternion"};
  double x = 0, y = 0, z = 0, w = 1;

  static void fields(auto& m, auto& visit) {
    Point::fields(m, visit);
    visit("w", m.w);
  }
};

struct Pose {
  static constexpr MessageType type{"geometry_msgs/Pose"};
  Point position{};
  Quaternion orientation{};

  static void fields(auto& m, auto& visit) {
    visit("position", m.position);
    visit("orientation", m.orientation);
  }
};

struct PoseArray {
  static constexpr MessageType type{"geometry_msgs/PoseArray", "916c28c5764443f268b296bb671b9d97"};
  Header header{};
  std::vector<Pose> poses{};

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("poses", m.poses);
  }
};

struct Transform {
  static constexpr MessageType type{"geometry_msgs/Transform"};
  Vector3 translation{};
  Quaternion rotation{};

  static void fields(auto& m, auto& visit) {
    visit("translation", m.translation);
    visit("rotation", m.rotation);
  }
};

struct TransformStamped {
  static constexpr MessageType type{"geometry_msgs/TransformStamped"};
  Header header{};
  std::string child_frame_id{};
  Transform transform{};

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("child_frame_id", m.child_frame_id);
    visit("transform", m.transform);
  }
};

struct TFMessage {
  static constexpr MessageType type{"tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec"};
  std::vector<TransformStamped> transforms{};

  static void fields(auto& m, auto& visit) { visit("transforms", m.transforms); }
};

struct Image {
  static constexpr MessageType type{"sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"};
  Header header{};
  std::uint32_t height = 0, width = 0;
  std::string encoding{};
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;
  std::vector<std::uint8_t> data{};

  static void head(auto& m, auto& visit) {
    visit("header", m.header);
    visit("height", m.height);
    visit("width", m.width);
    visit("encoding", m.encoding);
  }
  static void fields(auto& m, auto& visit) {
    head(m, visit);
    visit("is_bigendian", m.is_bigendian);
    visit("step", m.step);
    visit("data", m.data);
  }
};

struct CompressedImage {
  static constexpr MessageType type{"sensor_msgs/CompressedImage",
                                    "8f7a12909da2c9d3332d540a0977563f"};
  Header header{};
  std::string format{};
  std::vector<std::uint8_t> data{};

  static void head(auto& m, auto& visit) {
    visit("header", m.header);
    visit("format", m.format);
  }
  static void fields(auto& m, auto& visit) {
    head(m, visit);
    visit("data", m.data);
  }
};

// Message of which only the first fields are decoded: the fields that Message::head visits.
template <typename Message>
struct Head : Message {
  static void fields(auto& m, auto& visit) { Message::head(m, visit); }
};

struct RegionOfInterest {
  static constexpr MessageType type{"sensor_msgs/RegionOfInterest"};
  std::uint32_t x_offset = 0, y_offset = 0, height = 0, width = 0;
  bool do_rectify = false;

  static void fields(auto& m, auto& visit) {
    visit("x_offset", m.x_offset);
    visit("y_offset", m.y_offset);
    visit("height", m.height);
    visit("width", m.width);
    visit("do_rectify", m.do_rectify);
  }
};

struct CameraInfo {
  static constexpr MessageType type{"sensor_msgs/CameraInfo", "c9a58c1b0b154e0e6da7578cb991d214"};
  Header header{};
  std::uint32_t height = 0, width = 0;
  std::string distortion_model{};
  std::vector<double> d{};
  std::array<double, 9> k{}, r{};
  std::array<double, 12> p{};
  std::uint32_t binning_x = 0, binning_y = 0;
  RegionOfInterest roi{};

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("height", m.height);
    visit("width", m.width);
    visit("distortion_model", m.distortion_model);
    visit("d", m.d);
    visit("k", m.k);
    visit("r", m.r);
    visit("p", m.p);
    visit("binning_x", m.binning_x);
    visit("binning_y", m.binning_y);
    visit("roi", m.roi);
  }
};

struct PointField {
  static constexpr MessageType type{"sensor_msgs/PointField"};
  enum : std::uint8_t { INT8 = 1, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64 };
  std::string name{};
  std::uint32_t offset = 0;
  std::uint8_t datatype = 0;
  std::uint32_t count = 0;

  static void fields(auto& m, auto& visit) {
    visit("name", m.name);
    visit("offset", m.offset);
    visit("datatype", m.datatype);
    visit("count", m.count);
  }
};

struct PointCloud2 {
  static constexpr MessageType type{"sensor_msgs/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"};
  Header header{};
  std::uint32_t height = 0, width = 0;
  std::vector<PointField> point_fields{};
  bool is_bigendian = false;
  std::uint32_t point_step = 0, row_step = 0;
  std::vector<std::uint8_t> data{};
  bool is_dense = false;

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("height", m.height);
    visit("width", m.width);
    visit("fields", m.point_fields);
    visit("is_bigendian", m.is_bigendian);
    visit("point_step", m.point_step);
    visit("row_step", m.row_step);
    visit("data", m.data);
    visit("is_dense", m.is_dense);
  }
};

struct UVCoordinate {
  static constexpr MessageType type{"visualization_msgs/UVCoordinate"};
  float u = 0, v = 0;

  static void fields(auto& m, auto& visit) {
    visit("u", m.u);
    visit("v", m.v);
  }
};

struct MeshFile {
  static constexpr MessageType type{"visualization_msgs/MeshFile"};
  std::string filename{};
  std::vector<std::uint8_t> data{};

  static void fields(auto& m, auto& visit) {
    visit("filename", m.filename);
    visit("data", m.data);
  }
};

// For ROS 2, this is the definition since Humble; earlier definitions have no textures.
struct Marker {
  static constexpr MessageType type{"visualization_msgs/Marker"};
  enum : std::int32_t { ARROW = 0, SPHERE_LIST = 7, TEXT_VIEW_FACING = 9 };
  Header header{};
  std::string ns{};
  std::int32_t id = 0, shape = 0, action = 0;  // action 0: add
  Pose pose{};
  Vector3 scale{};
  ColorRGBA color{};
  Duration lifetime{};
  bool frame_locked = false;
  std::vector<Point> points{};
  std::vector<ColorRGBA> colors{};
  std::string texture_resource{};
  CompressedImage texture{};
  std::vector<UVCoordinate> uv_coordinates{};
  std::string text{}, mesh_resource{};
  MeshFile mesh_file{};
  bool mesh_use_embedded_materials = false;

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("ns", m.ns);
    visit("id", m.id);
    visit("type", m.shape);
    visit("action", m.action);
    visit("pose", m.pose);
    visit("scale", m.scale);
    visit("color", m.color);
    visit("lifetime", m.lifetime);
    visit("frame_locked", m.frame_locked);
    visit("points", m.points);
    visit("colors", m.colors);
    if (visit.ros2) {
      visit("texture_resource", m.texture_resource);
      visit("texture", m.texture);
      visit("uv_coordinates", m.uv_coordinates);
    }
    visit("text", m.text);
    visit("mesh_resource", m.mesh_resource);
    if (visit.ros2) visit("mesh_file", m.mesh_file);
    visit("mesh_use_embedded_materials", m.mesh_use_embedded_materials);
  }
};

struct MarkerArray {
  static constexpr MessageType type{"visualization_msgs/MarkerArray",
                                    "d155b9ce5188fbaf89745847fd5882d7"};
  std::vector<Marker> markers{};

  static void fields(auto& m, auto& visit) { visit("markers", m.markers); }
};

struct MapMetaData {
  static constexpr MessageType type{"nav_msgs/MapMetaData"};
  Time map_load_time{};
  float resolution = 0;
  std::uint32_t width = 0, height = 0;
  Pose origin{};

  static void fields(auto& m, auto& visit) {
    visit("map_load_time", m.map_load_time);
    visit("resolution", m.resolution);
    visit("width", m.width);
    visit("height", m.height);
    visit("origin", m.origin);
  }
};

struct OccupancyGrid {
  static constexpr MessageType type{"nav_msgs/OccupancyGrid"};
  Header header{};
  MapMetaData info{};
  std::vector<std::int8_t> data{};

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("info", m.info);
    visit("data", m.data);
  }
};

struct MultiArrayDimension {
  static constexpr MessageType type{"std_msgs/MultiArrayDimension"};
  std::string label{};
  std::uint32_t size = 0, stride = 0;

  static void fields(auto& m, auto& visit) {
    visit("label", m.label);
    visit("size", m.size);
    visit("stride", m.stride);
  }
};

struct MultiArrayLayout {
  static constexpr MessageType type{"std_msgs/MultiArrayLayout"};
  std::vector<MultiArrayDimension> dim{};
  std::uint32_t data_offset = 0;

  static void fields(auto& m, auto& visit) {
    visit("dim", m.dim);
    visit("data_offset", m.data_offset);
  }
};

struct Float32MultiArray {
  static constexpr MessageType type{"std_msgs/Float32MultiArray"};
  MultiArrayLayout layout{};
  std::vector<float> data{};

  static void fields(auto& m, auto& visit) {
    visit("layout", m.layout);
    visit("data", m.data);
  }
};

struct GridMapInfo {
  static constexpr MessageType type{"grid_map_msgs/GridMapInfo"};
  double resolution = 0, length_x = 0, length_y = 0;
  Pose pose{};

  static void fields(auto& m, auto& visit) {
    visit("resolution", m.resolution);
    visit("length_x", m.length_x);
    visit("length_y", m.length_y);
    visit("pose", m.pose);
  }
};

struct GridMap {
  static constexpr MessageType type{"grid_map_msgs/GridMap"};
  Header header{};
  GridMapInfo info{};
  std::vector<std::string> layers{}, basic_layers{};
  std::vector<Float32MultiArray> data{};
  std::uint16_t outer_start_index = 0, inner_start_index = 0;

  static void fields(auto& m, auto& visit) {
    visit("header", m.header);
    visit("info", m.info);
    visit("layers", m.layers);
    visit("basic_layers", m.basic_layers);
    visit("data", m.data);
    visit("outer_start_index", m.outer_start_index);
    visit("inner_start_index", m.inner_start_index);
  }
};

// Returns the text with '?' in place of all characters except printable ASCII.
inline std::string printable(std::string line) {
  for (char& c : line)
    if (c < ' ' || c > '~') c = '?';
  return line;
}

inline double seconds_of(std::int64_t nanoseconds) {
  const std::int64_t seconds = nanoseconds / 1'000'000'000;
  return static_cast<double>(seconds) + static_cast<double>(nanoseconds % 1'000'000'000) * 1e-9;
}

}  // namespace libmap::ros_message
