
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "libmap/bag/bag_cloud.h"
#include "libmap/bag/bag_writer.h"
#include "libmap/bag/message_encoding.h"
#include "tests/libmap/bag/bag_samples.h"
#include "tests/support/test_support.h"

namespace cloud_message_test {

namespace fs = std::filesystem;
namespace rm = graspmap_test::rm;
using graspmap_test::bytes_of;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::sample_header;
using graspmap_test::SampleBag;
using graspmap_test::scratch_folder;
using libmap::BagFormat;
using libmap::PointCloud;
using testing::ElementsAre;

fs::path bag_path() { return scratch_folder() / "a.bag"; }

rm::PointField field(const std::string& name, std::uint32_t offset, std::uint8_t type,
                     std::uint32_t count = 1) {
  rm::PointField result;
  result.name = rm::to_ros(name);
  result.offset = offset;
  result.datatype = type;
  result.count = count;
  return result;
}

// 2 x 2 points of 40 bytes, 6 bytes after each row; x and y as doubles, z as float, a gap, rgb, two
// numbers of 16 bits.
rm::PointCloud2 odd_cloud(bool swapped) {
  rm::PointCloud2 message;
  message.header = sample_header("lidar", 7.5);
  message.width = message.height = 2;
  message.point_step = 40;
  message.row_step = 86;
  message.is_bigendian = swapped ? 1 : 0;
  message.fields = {field("x", 0, 8),    field("y", 8, 8),        field("z", 16, 7),
                    field("rgb", 24, 7), field("pair", 28, 3, 2), field("intensity", 32, 7)};
  std::string bytes;
  for (int n = 0; n < 4; ++n) {
    const double x = n == 2 ? std::numeric_limits<double>::quiet_NaN() : 0.1 * n;
    bytes += bytes_of<double>({x, -0.5}, swapped) + bytes_of<float>({2.0F}, swapped) + "gap!";
    bytes += bytes_of<std::uint32_t>({0xFF102030U + static_cast<std::uint32_t>(n)}, swapped);
    bytes += bytes_of<std::int16_t>({static_cast<std::int16_t>(-n), 300}, swapped);
    bytes += bytes_of<float>({0.25F * static_cast<float>(n)}, swapped) + "end.";
    if (n == 1) bytes += "xxxxxx";
  }
  message.data.assign(bytes.begin(), bytes.end());
  return message;
}

libmap::BagCloudResult read_back(const rm::PointCloud2& message) {
  SampleBag(bag_path()).write("/cloud", 9.0, message).close();
  return libmap::read_bag_cloud(bag_path());
}

TEST(CloudMessage, AnyLayout) {
  for (const bool swapped : {false, true}) {
    const libmap::BagCloudResult result = read_back(odd_cloud(swapped));
    EXPECT_EQ(result.topic, "/cloud");
    EXPECT_EQ(result.frame, "lidar");
    EXPECT_EQ(result.stamp_s, 7.5);
    EXPECT_EQ(result.dropped_points, 1U);
    const PointCloud& cloud = result.cloud;
    ASSERT_EQ(cloud.size(), 3U);
    EXPECT_EQ(cloud.positions[2], Eigen::Vector3d(0.1 * 3, -0.5, 2.0));
    EXPECT_EQ(cloud.colors[2], (libmap::Color{0x10, 0x20, 0x33}));
    EXPECT_THAT(cloud.find_field("pair_0")->values, ElementsAre(0, -1, -3));
    EXPECT_THAT(cloud.find_field("pair_1")->values, ElementsAre(300, 300, 300));
    EXPECT_EQ(cloud.find_field("pair_1")->type, libmap::ScalarType::int16);
    EXPECT_THAT(cloud.find_field("intensity")->values, ElementsAre(0, 0.25, 0.75));
  }
}

TEST(CloudMessage, WhatDoesNotFitIsSaid) {
  const auto said = [](const auto& change) {
    rm::PointCloud2 message = odd_cloud(false);
    change(message);
    return error_of([&] { read_back(message); });
  };
  EXPECT_TRUE(is_error(said([](auto& m) { m.data.resize(165); }),
                       {.field = "data", .value = "165", .bound = ">= 166"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.width = m.height = 0xffffffff; }),
                       {.field = "row_step", .value = "86", .bound = ">= 171798691800"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.height = 0x7fffffff; }),
                       {.field = "data", .value = "166", .bound = ">= 184683593636"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.point_step = 0; }),
                       {.field = "point_step", .value = "0", .bound = ">= 12"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.row_step = 79; }),
                       {.field = "row_step", .value = "79", .bound = ">= 80"}));
  EXPECT_TRUE(
      is_error(said([](auto& m) { m.fields[5].offset = 37; }),
               {.field = "point_step for field intensity", .value = "40", .bound = ">= 41"}));
  EXPECT_TRUE(is_error(
      said([](auto& m) { m.fields[5].offset = 0xffffffff; }),
      {.field = "point_step for field intensity", .value = "40", .bound = ">= 4294967299"}));
  EXPECT_TRUE(is_error(
      said([](auto& m) { m.fields[5].count = 0xffffffff; }),
      {.field = "point_step for field intensity", .value = "40", .bound = ">= 17179869212"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.fields[5].datatype = 9; }),
                       {.field = "datatype of field intensity", .value = "9", .bound = "1 to 8"}));
  EXPECT_TRUE(is_error(said([](auto& m) { m.fields[0].name = rm::to_ros("ex"); }),
                       {.field = "fields x, y and z"}));
  EXPECT_TRUE(
      is_error(said([](auto& m) { m.fields[5].name = rm::to_ros("x"); }), {.field = "field 'x'"}));
  EXPECT_TRUE(is_error(said([](auto& m) {
                         m.width = 0;
                         m.point_step = 0xffffffff;
                         m.fields[5].count = 0x10000000;
                       }),
                       {.field = "field intensity"}));
  // A cloud without points is valid.
  rm::PointCloud2 empty = odd_cloud(false);
  empty.width = 0;
  empty.data.clear();
  EXPECT_TRUE(read_back(empty).cloud.empty());
}

TEST(CloudMessage, TopicsAndMomentsAreChosen) {
  rm::PointCloud2 small = odd_cloud(false);
  small.height = 1;
  small.header.stamp = ros::Time(3.0);
  SampleBag bag(bag_path());
  bag.write("/a", 3.0, small).write("/a", 7.5, odd_cloud(false)).write("/b", 8.0, small).close();
  const auto read = [](const std::string& topic, std::optional<double> stamp) {
    return libmap::read_bag_cloud(bag_path(), topic, stamp);
  };
  EXPECT_EQ(read("/a", std::nullopt).stamp_s, 7.5);  // the message with the most points
  EXPECT_EQ(read("/a", std::nullopt).messages, 2U);
  EXPECT_EQ(read("/a", 4.0).stamp_s, 3.0);
  EXPECT_TRUE(is_error(error_of([&] { read("", std::nullopt); }),
                       {.field = "topics of sensor_msgs/PointCloud2", .value = "/a, /b"}));
  EXPECT_TRUE(is_error(error_of([&] { read("/c", std::nullopt); }),
                       {.field = "topic", .value = "/c", .bound = "one of /a, /b"}));
}

PointCloud full_cloud() {
  PointCloud cloud;
  for (int n = 0; n < 50; ++n) {
    cloud.positions.emplace_back(n * 0.25, -n, 0.125);
    cloud.normals.emplace_back(0, 0, 1.0F);
    cloud.colors.push_back({static_cast<std::uint8_t>(n), 2, 255});
  }
  auto fill = [&](const char* name, libmap::ScalarType type, double step) {
    std::vector<double>& values = cloud.add_field(name, type).values;
    for (std::size_t n = 0; n < values.size(); ++n) values[n] = step * static_cast<double>(n);
  };
  fill("score", libmap::ScalarType::float32, 0.25);
  fill("graspable", libmap::ScalarType::uint8, 1);
  fill("i", libmap::ScalarType::int32, -1000);
  fill("fine", libmap::ScalarType::float64, 0.1);
  return cloud;
}

TEST(CloudMessage, WrittenCloudsComeBackWhole) {
  const PointCloud cloud = full_cloud();
  libmap::write_bag(bag_path(), BagFormat::ros1,
                    {.stamp_s = 12.5, .clouds = {{"/map", "terrain", cloud}}});
  const libmap::BagCloudResult result = libmap::read_bag_cloud(bag_path());
  EXPECT_EQ(result.frame, "terrain");
  EXPECT_EQ(result.stamp_s, 12.5);
  EXPECT_EQ(result.cloud.positions, cloud.positions);
  EXPECT_EQ(result.cloud.normals, cloud.normals);
  EXPECT_EQ(result.cloud.colors, cloud.colors);
  EXPECT_EQ(result.cloud.fields, cloud.fields);
}

// RViz's requirements for a cloud.
TEST(CloudMessage, LayoutOfWrittenClouds) {
  PointCloud cloud = full_cloud();
  cloud.positions[0].x() = 100000.25;  // files would store it as float64
  const libmap::ros_message::PointCloud2 message = libmap::encode_cloud(cloud);
  std::vector<std::string> layout;
  for (const libmap::ros_message::PointField& one : message.point_fields)
    layout.push_back(one.name + " " + std::to_string(one.offset) + " " +
                     std::to_string(one.datatype) + " " + std::to_string(one.count));
  EXPECT_THAT(layout, ElementsAre("x 0 7 1", "y 4 7 1", "z 8 7 1", "normal_x 12 7 1",
                                  "normal_y 16 7 1", "normal_z 20 7 1", "rgb 24 7 1",
                                  "score 28 7 1", "graspable 32 2 1", "i 33 5 1", "fine 37 8 1"));
  EXPECT_EQ(message.point_step, 45U);
  EXPECT_EQ(message.row_step, 45U * 50);
  EXPECT_EQ(message.data.size(), 45U * 50);
  EXPECT_FALSE(message.is_bigendian);
  float x = 0;
  std::memcpy(&x, message.data.data() + 45, 4);
  EXPECT_EQ(x, 0.25F);
  float rgb = 0;
  std::memcpy(&rgb, message.data.data() + 24, 4);
  EXPECT_FALSE(std::isnan(rgb));  // also for a blue of 255
}

}  // namespace cloud_message_test
