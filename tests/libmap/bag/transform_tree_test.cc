#include "libmap/bag/transform_tree.h"

#include <gtest/gtest.h>

#include "tests/support/test_support.h"

namespace transform_tree_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::make_pose_from_rpy;
using libmap::Pose;
using libmap::TransformTree;

Pose random_pose() {
  using graspmap_test::uniform;
  return make_pose_from_rpy({uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
                            {uniform(-180, 180), uniform(-80, 80), uniform(-180, 180)});
}

TEST(TransformTree, UpToACommonFrameAndDownAgain) {
  const Pose mast = random_pose();
  const Pose left = random_pose();
  const Pose right = random_pose();
  const Pose lens = random_pose();
  TransformTree tree;
  tree.add("right", "lens", lens);
  tree.add("/mast", "/left", left);  // leading '/', as in old programs
  tree.add("mast", "right", right);
  tree.add("base", "mast", mast);
  EXPECT_TRUE(tree.target_from_source("base", "lens").isApprox(mast * right * lens, 1e-12));
  EXPECT_TRUE(
      tree.target_from_source("left", "lens").isApprox(left.inverse() * right * lens, 1e-12));
  EXPECT_TRUE(
      tree.target_from_source("lens", "base").isApprox((mast * right * lens).inverse(), 1e-12));
  EXPECT_TRUE(tree.target_from_source("lens", "lens").isApprox(Pose::Identity(), 1e-12));
  EXPECT_EQ(tree.root_of("lens"), "base");
  EXPECT_EQ(tree.frames(), (std::vector<std::string>{"base", "left", "lens", "mast", "right"}));
}

TEST(TransformTree, WhatLeadsNowhereIsSaid) {
  TransformTree tree;
  tree.add("base_link", "camera", Pose::Identity());
  tree.add("map", "odom", Pose::Identity());
  EXPECT_TRUE(is_error(error_of([&] { tree.target_from_source("base_lnk", "camera"); }),
                       {.field = "frame", .value = "base_lnk", .about = "'base_link'"}));
  EXPECT_TRUE(is_error(error_of([&] { tree.target_from_source("odom", "camera"); }),
                       {.field = "frame", .value = "camera"}));
}

TEST(TransformTree, CirclesEnd) {
  TransformTree tree;
  tree.add("a", "b", Pose::Identity());
  tree.add("b", "c", Pose::Identity());
  tree.add("c", "a", Pose::Identity());
  tree.add("c", "d", Pose::Identity());
  EXPECT_TRUE(is_error(error_of([&] { tree.target_from_source("a", "d"); }),
                       {.field = "frame", .value = "a"}));
  EXPECT_TRUE(is_error(error_of([&] { tree.root_of("b"); }), {.field = "frame", .value = "b"}));
  EXPECT_TRUE(is_error(error_of([&] { tree.add("e", "e", Pose::Identity()); }),
                       {.field = "transform", .value = "'e' from 'e'"}));
}

TEST(TransformTree, FramesStandStill) {
  TransformTree tree;
  Pose pose = Pose::Identity();
  tree.add("a", "b", pose);
  tree.add("a", "b", pose);  // added twice
  pose.translation().x() = 0.001;
  EXPECT_TRUE(
      is_error(error_of([&] { tree.add("a", "b", pose); }), {.field = "frame", .value = "b"}));
  EXPECT_TRUE(is_error(error_of([&] { tree.add("c", "b", Pose::Identity()); }),
                       {.field = "frame", .value = "b"}));
  pose.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      is_error(error_of([&] { tree.add("a", "d", pose); }), {.field = "frame", .value = "d"}));
  EXPECT_TRUE(is_error(error_of([&] { tree.add("", "d", Pose::Identity()); }),
                       {.field = "transform", .value = "'' from 'd'"}));
}

}  // namespace transform_tree_test
