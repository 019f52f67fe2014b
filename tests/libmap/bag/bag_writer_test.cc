#include "libmap/bag/bag_writer.h"

#include <gtest/gtest.h>

#include <map>

#include "libmap/bag/bag_reader.h"
#include "libmap/camera/image_codec.h"
#include "tests/libmap/bag/bag_samples.h"
#include "tests/support/test_support.h"

namespace bag_writer_test {

namespace fs = std::filesystem;
namespace rm = graspmap_test::rm;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using libmap::BagContent;
using libmap::BagFormat;
using libmap::BagTargets;

fs::path bag_path() { return scratch_folder() / "a.bag"; }

std::map<std::string, std::string> messages_of(const fs::path& path) {
  std::vector<libmap::BagRequest> requests;
  for (const libmap::BagTopic& topic : libmap::list_bag(path).topics)
    requests.push_back({topic.name});
  std::map<std::string, std::string> messages;
  libmap::read_bag(path, requests, [&](const libmap::BagMessage& message) {
    messages[message.topic.name] = message.bytes;
  });
  return messages;
}

BagTargets targets() {
  BagTargets result{"/footholds", "/foothold_poses", "terrain", 0.08, {}};
  result.targets = {{{1, 2, 3}, {0, 0, -1}, {255, 0, 51}, "1: 0.98"},
                    {{0, 0, 0}, {0, 2, 0}, {0, 100, 0}, "2: 0.91"},
                    {{4, 5, 6}, {3, -1, -2}, {0, 100, 0}, "3: 0.90"}};
  return result;
}

TEST(BagWriter, PosesPointAlongTheDirection) {
  libmap::write_bag(bag_path(), BagFormat::ros1, {.stamp_s = 2.0, .targets = {targets()}});
  const auto poses = rm::decode<rm::PoseArray>(messages_of(bag_path()).at("/foothold_poses"));
  EXPECT_EQ(rm::from_ros(poses.header.frame_id), "terrain");
  EXPECT_EQ(poses.header.stamp, ros::Time(2.0));
  ASSERT_EQ(poses.poses.size(), 3U);
  for (std::size_t n = 0; n < 3; ++n) {
    const auto& q = poses.poses[n].orientation;
    const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
    EXPECT_NEAR(rotation.norm(), 1.0, 1e-12);
    EXPECT_TRUE((rotation * Eigen::Vector3d::UnitX())
                    .isApprox(targets().targets[n].direction.normalized(), 1e-12));
    // The y axis is the frame's, made perpendicular to the x axis.
    if (n != 1) {
      EXPECT_GT((rotation * Eigen::Vector3d::UnitY()).y(), 0.9);
    }
  }
  EXPECT_EQ(poses.poses[0].position.z, 3.0);
}

TEST(BagWriter, MarkersStandAtThePlaces) {
  libmap::write_bag(bag_path(), BagFormat::ros1, {.targets = {targets()}});
  const auto markers = rm::decode<rm::MarkerArray>(messages_of(bag_path()).at("/footholds"));
  ASSERT_EQ(markers.markers.size(), 7U);  // the balls; an arrow and a text each
  const rm::Marker& balls = markers.markers[0];
  EXPECT_EQ(balls.type, rm::Marker::SPHERE_LIST);
  ASSERT_EQ(balls.points.size(), 3U);
  ASSERT_EQ(balls.colors.size(), 3U);
  EXPECT_EQ(balls.points[2].y, 5.0);
  EXPECT_FLOAT_EQ(balls.colors[0].b, 0.2F);
  const rm::Marker& arrow = markers.markers[1];
  EXPECT_EQ(arrow.type, rm::Marker::ARROW);
  ASSERT_EQ(arrow.points.size(), 2U);
  EXPECT_EQ(arrow.points[1].z, 3.0);
  EXPECT_NEAR(arrow.points[0].z, 3.08, 1e-12);  // the approach is from above
  EXPECT_EQ(rm::from_ros(markers.markers[2].text), "1: 0.98");
  std::set<std::pair<std::string, int>> names;
  for (const rm::Marker& marker : markers.markers) {
    EXPECT_EQ(rm::from_ros(marker.header.frame_id), "terrain");
    EXPECT_EQ(marker.color.a, 1.0F);
    EXPECT_EQ(marker.action, rm::Marker::ADD);
    EXPECT_EQ(marker.pose.orientation.w, 1.0);
    EXPECT_TRUE(names.insert({rm::from_ros(marker.ns), marker.id}).second);
  }
}

TEST(BagWriter, SameContentSameBytes) {
  BagContent content{.stamp_s = 1600000000.123456, .targets = {targets()}};
  content.transforms = {{"terrain", "base_link", libmap::Pose::Identity()}};
  content.clouds = {{"/map", "terrain", {}}};
  using libmap::BagCompression;
  for (const auto compression : {BagCompression::none, BagCompression::bz2, BagCompression::lz4}) {
    libmap::write_bag(bag_path(), BagFormat::ros1, content, compression);
    const std::string first = read_text(bag_path());
    libmap::write_bag(bag_path(), BagFormat::ros1, content, compression);
    EXPECT_EQ(first, read_text(bag_path())) << static_cast<int>(compression);
    const libmap::BagListing listing = libmap::list_bag(bag_path());
    EXPECT_EQ(listing.messages, 4U);
    EXPECT_NEAR(listing.start_s, content.stamp_s, 1e-6);
    for (const libmap::BagTopic& topic : listing.topics) EXPECT_TRUE(topic.latching);
  }
}

TEST(BagWriter, WhatRosCannotHoldIsSaid) {
  for (const double stamp : {0.0, -1.0, 4294967295.0, 1e300, std::nan("")})
    EXPECT_TRUE(is_error(
        error_of([&] { libmap::write_bag(bag_path(), BagFormat::ros1, {.stamp_s = stamp}); }),
        {.field = "stamp", .bound = ">= 1e-9 and < 2^32 - 1 s"}));
  for (const char* topic : {"", "/", "map", "/a b", "/a/", "/\xc3\xa4"})
    EXPECT_TRUE(is_error(
        error_of([&] {
          libmap::write_bag(bag_path(), BagFormat::ros1, {.clouds = {{topic, "terrain", {}}}});
        }),
        {.field = "topic", .value = topic}));
  const libmap::Error full =
      error_of([] { libmap::write_bag("/dev/full", BagFormat::ros1, {.targets = {targets()}}); });
  EXPECT_EQ(full.kind(), libmap::ErrorKind::failed);
}

}  // namespace bag_writer_test
