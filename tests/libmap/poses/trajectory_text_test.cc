#include "libmap/poses/trajectory_text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <clocale>
#include <cmath>
#include <string>
#include <vector>

#include "libmap/core/text.h"
#include "tests/support/test_support.h"

namespace trajectory_text_test {

using libmap::LinkType;
using libmap::Matrix6d;
using libmap::Pose;
using libmap::Trajectory;

double draw() { return graspmap_test::uniform(-1.0, 1.0); }

Pose random_pose() {
  return libmap::make_pose(Eigen::Vector3d(draw(), draw(), draw()),
                           Eigen::Quaterniond(draw(), draw(), draw(), draw()));
}

Matrix6d random_information() {
  Matrix6d root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = draw();
  return root.transpose() * root * 1e3;
}

Trajectory random_trajectory() {
  Trajectory trajectory;
  for (int i = 0; i < 20; ++i)
    trajectory.push_back({i + 1, 1700000000.0 + 1.08 * i + 1e-6 * draw(), random_pose()});
  return trajectory;
}

void expect_same(const Trajectory& read, const Trajectory& written) {
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].world_from_base.translation(), written[i].world_from_base.translation());
    EXPECT_LT((read[i].world_from_base.linear() - written[i].world_from_base.linear()).norm(),
              1e-14);
  }
}

std::string with_line(int number, const std::string& line) {
  return std::string(static_cast<std::size_t>(number - 1), '\n') + line + "\n";
}

TEST(TumText, KeepsEveryDigit) {
  const Trajectory written = random_trajectory();
  const Trajectory read = libmap::parse_tum(libmap::to_tum(written), "poses.tum");
  expect_same(read, written);
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].stamp_s, written[i].stamp_s);
    EXPECT_EQ(read[i].node, 0);
  }
}

TEST(TumText, HoldsNodesInANinthColumnIfAsked) {
  const Trajectory written = random_trajectory();
  const Trajectory read = libmap::parse_tum(libmap::to_tum(written, true), "poses.tum");
  for (std::size_t i = 0; i < read.size(); ++i) EXPECT_EQ(read[i].node, written[i].node);
}

TEST(TumText, WritesStampsWithoutExponents) {
  Trajectory written;
  for (const double stamp : {0.0, 1e-7, 1700000000.0, 1e22, 0.25, -3.5})
    written.push_back({0, stamp, Pose::Identity()});
  const std::string text = libmap::to_tum(written);
  EXPECT_EQ(text.find('e', text.find('\n')), std::string::npos);
  const Trajectory read = libmap::parse_tum(text, "poses.tum");
  for (std::size_t i = 0; i < read.size(); ++i)
    EXPECT_NEAR(read[i].stamp_s, written[i].stamp_s, 5e-10);
}

TEST(TumText, ReadsWhatOthersWrite) {
  // RTAB-Map's format 11, commas, tabs, comments, a byte order mark and lines that end in CRLF.
  const Trajectory read = libmap::parse_tum(
      "\xEF\xBB\xBF#timestamp x y z qx qy qz qw id\r\n"
      "1305031102.175304 1.5 -2 0.25 0 0 0.7071 0.7071 17\r\n"
      "\n"
      "2,1,2,3,0,0,0,-1\n"
      "  # a comment\n"
      "3\t1e0\t2\t+3\t0\t0\t0\t1",
      "poses.tum");
  ASSERT_EQ(read.size(), 3U);
  EXPECT_EQ(read[0].node, 17);
  EXPECT_EQ(read[0].stamp_s, 1305031102.175304);
  EXPECT_TRUE(read[0].world_from_base.isApprox(
      libmap::make_pose_from_rpy({1.5, -2.0, 0.25}, {0.0, 0.0, 90.0}), 1e-12));
  EXPECT_TRUE(read[1].world_from_base.linear().isIdentity(1e-14));
  EXPECT_EQ(read[2].world_from_base.translation(), Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(TumText, NamesTheLineThatIsNoPose) {
  const std::vector<std::string> lines = {"1 2 3",
                                          "1 0 0 0 0 0 0 1 5 6",
                                          "1 0 0 x 0 0 0 1",
                                          "1 0 0 nan 0 0 0 1",
                                          "inf 0 0 0 0 0 0 1",
                                          "1 0 0 0 0 0 0 0",
                                          "1 0 0 0 0 0 0 2",
                                          "1 0 0 0 0 0 0 1 1.5",
                                          "1 0 0 0 0 0 0 1 99999999999",
                                          "1 1e300 0 0 0 0 0 1",
                                          "1 0 -2e8 0 0 0 0 1",
                                          "1 0 0 0 0 0 0 1.06",
                                          "1e999 0 0 0 0 0 0 1"};
  for (const std::string& line : lines) {
    SCOPED_TRACE(line);
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::parse_tum(with_line(7, line), "poses.tum"); });
    EXPECT_EQ(error.context().file, "poses.tum");
    EXPECT_EQ(error.context().field, "line 7");
  }
}

TEST(TumText, NamesTheLineWhoseNodeStandsTwice) {
  const std::string pose = " 0 0 0 0 0 0 1 ";
  const libmap::Error error = graspmap_test::error_of([&] {
    libmap::parse_tum("1" + pose + "4\r\n\r\n2" + pose + "5\r\n3" + pose + "4\r\n", "poses.tum");
  });
  EXPECT_EQ(error.context().field, "line 4");
  EXPECT_EQ(error.context().value, "node 4");
}

TEST(TumText, DoesNotFollowTheLocale) {
  const Trajectory written = random_trajectory();
  const std::string text = libmap::to_tum(written);
  const char* set = std::setlocale(LC_ALL, "de_DE.UTF-8");
  if (set == nullptr) GTEST_SKIP() << "no locale with a decimal comma";
  EXPECT_EQ(libmap::to_tum(written), text);
  expect_same(libmap::parse_tum(text, "poses.tum"), written);
  std::setlocale(LC_ALL, "C");
}

TEST(KittiText, KeepsEveryDigit) {
  const Trajectory written = random_trajectory();
  const Trajectory read = libmap::parse_kitti(libmap::to_kitti(written), "poses.kitti");
  expect_same(read, written);
}

TEST(KittiText, IsRowByRow) {
  const Trajectory read = libmap::parse_kitti("0 -1 0 10 1 0 0 20 0 0 1 30\n", "poses.kitti");
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].world_from_base * Eigen::Vector3d::UnitX(), Eigen::Vector3d(10, 21, 30));
}

TEST(KittiText, NamesTheLineThatIsNoPose) {
  for (const char* line :
       {"1 0 0 0 0 1 0 0 0 0 1", "2 0 0 0 0 2 0 0 0 0 2 0", "-1 0 0 0 0 -1 0 0 0 0 -1 0",
        "0 0 0 0 0 0 0 0 0 0 0 0", "1 0 0 inf 0 1 0 0 0 0 1 0"}) {
    SCOPED_TRACE(line);
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::parse_kitti(with_line(3, line), "poses.kitti"); });
    EXPECT_EQ(error.context().field, "line 3");
  }
}

std::vector<libmap::PoseLink> links_of_every_type() {
  std::vector<libmap::PoseLink> links;
  for (const LinkType type :
       {LinkType::neighbor, LinkType::neighbor, LinkType::global_closure,
        LinkType::local_space_closure, LinkType::local_time_closure, LinkType::user_closure,
        LinkType::neighbor_merged, LinkType::neighbor, LinkType{77}})
    links.push_back({.from = static_cast<int>(links.size()) + 1,
                     .to = 20 - static_cast<int>(links.size()),
                     .type = type,
                     .from_from_to = random_pose(),
                     .information = random_information()});
  links.push_back({4, 4, LinkType::pose_prior, random_pose(), random_information()});
  links.push_back({4, -2, LinkType::landmark, random_pose(), random_information()});
  links.push_back({5, 5, LinkType::gravity, random_pose(), random_information()});
  links.push_back({5, 6, LinkType::neighbor, random_pose(), random_information()});
  return links;
}

TEST(G2oText, KeepsPosesAndLinksOfEveryType) {
  const Trajectory poses = random_trajectory();
  const std::vector<libmap::PoseLink> links = links_of_every_type();
  const libmap::PoseGraphText read = libmap::parse_g2o(libmap::to_g2o(poses, links), "links.g2o");
  expect_same(read.poses, poses);
  for (std::size_t i = 0; i < poses.size(); ++i) EXPECT_EQ(read.poses[i].node, poses[i].node);
  ASSERT_EQ(read.links.size(), links.size());
  for (std::size_t i = 0; i < links.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(read.links[i].from, links[i].from);
    EXPECT_EQ(read.links[i].to, links[i].to);
    EXPECT_EQ(read.links[i].type, links[i].type);
    EXPECT_TRUE(read.links[i].from_from_to.isApprox(links[i].from_from_to, 1e-14));
    // Factors of two are exact; the two halves can differ by rounding.
    EXPECT_TRUE(read.links[i].information.isApprox(links[i].information, 1e-14));
  }
}

TEST(G2oText, HoldsOtherProgramsFromLinksThatAreNoEdges) {
  const std::string text = libmap::to_g2o({}, links_of_every_type());
  std::size_t edges = 0;
  for (std::size_t at = text.find("\nEDGE"); at != std::string::npos;
       at = text.find("\nEDGE", at + 1))
    ++edges;
  EXPECT_EQ(edges, 10U);
}

TEST(G2oText, NumbersAtTheEndsOfTheirRange) {
  const std::string pose = " 0 0 0 0 0 0 1 ";
  const std::string rest = " 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const auto links = [&](const std::string& ends, const std::string& entry) {
    return libmap::parse_g2o("EDGE_SE3:QUAT " + ends + pose + entry + rest, "a.g2o").links;
  };
  // Without vertices, edges between consecutive numbers are odometry.
  EXPECT_EQ(links("2147483646 2147483647", "1").front().type, LinkType::neighbor);
  EXPECT_EQ(links("2147483647 2147483647", "1").front().type, LinkType::global_closure);
  const libmap::Error error = graspmap_test::error_of([&] { links("1 2", "1e308"); });
  EXPECT_TRUE(graspmap_test::is_error(
      error, {.file = "a.g2o", .field = "line 1", .value = "1e+308", .bound = "<= 1e300"}));
  EXPECT_EQ(error.context().bound, "<= 1e300");
}

// The cost of a small error is the same in both conventions: e' Omega e with e = (t, angles) here,
// (t, vector part of the quaternion) there.
TEST(G2oText, WritesInformationOfHalfAngles) {
  const Matrix6d information = random_information();
  const std::string text =
      libmap::to_g2o({}, {{1, 2, LinkType::neighbor, Pose::Identity(), information}});
  const std::size_t begin = text.find("EDGE_SE3:QUAT 1 2 0 0 0 0 0 0 1 ");
  ASSERT_NE(begin, std::string::npos);
  std::vector<double> numbers;
  std::string word;
  for (const char c : text.substr(begin + 32)) {
    if (c != ' ' && c != '\n') {
      word += c;
      continue;
    }
    numbers.push_back(libmap::parse_double(word).value());
    word.clear();
  }
  ASSERT_EQ(numbers.size(), 21U);
  Matrix6d stored;
  std::size_t next = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) stored(i, j) = stored(j, i) = numbers[next++];

  const Eigen::Vector3d angles = 1e-5 * Eigen::Vector3d(draw(), draw(), draw());
  Eigen::Matrix<double, 6, 1> of_angles;
  of_angles << 1e-5 * Eigen::Vector3d(draw(), draw(), draw()), angles;
  Eigen::Matrix<double, 6, 1> of_quaternion = of_angles;
  of_quaternion.tail<3>() =
      Eigen::Quaterniond(Eigen::AngleAxisd(angles.norm(), angles.normalized())).vec();
  const double cost = of_angles.dot(information * of_angles);
  EXPECT_NEAR(of_quaternion.dot(stored * of_quaternion), cost, 1e-8 * cost);
}

TEST(G2oText, GuessesTheTypesOfForeignEdges) {
  const std::string rest = " 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const std::string pose = " 0 0 0 0 0 0 1\n";
  const libmap::PoseGraphText read = libmap::parse_g2o(
      "FIX 3\nPARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\nEDGE_SE3:QUAT 3 5" + rest + "EDGE_SE3:QUAT 9 5" +
          rest + "EDGE_SE3:QUAT 3 9" + rest + "VERTEX_SE3:QUAT 3" + pose + "VERTEX_SE3:QUAT 5" +
          pose + "VERTEX_SE3:QUAT 9" + pose,
      "foreign.g2o");
  ASSERT_EQ(read.links.size(), 3U);
  EXPECT_EQ(read.poses.size(), 3U);
  EXPECT_EQ(read.links[0].type, LinkType::neighbor);
  EXPECT_EQ(read.links[1].type, LinkType::neighbor);
  EXPECT_EQ(read.links[2].type, LinkType::global_closure);
  Matrix6d expected = Matrix6d::Identity();
  expected.bottomRightCorner<3, 3>() /= 4.0;
  EXPECT_EQ(read.links[0].information, expected);
}

TEST(G2oText, NamesTheLineThatIsBroken) {
  for (const char* line :
       {"VERTEX_SE3:QUAT 1 0 0 0 0 0 0", "VERTEX_SE3:QUAT one 0 0 0 0 0 0 1",
        "EDGE_SE3:QUAT 1 2 0 0 0 0 0 0 1 1 0 0 0 0 0 1", "EDGE_SE3:QUAT 1", "EDGE_SE2 1 2 0 0 0",
        "VERTEX_SE3:QUAT 1 0 0 0 0 0 0 0", "# graspmap:type x", "# graspmap:edge 1 2 3"}) {
    SCOPED_TRACE(line);
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::parse_g2o(with_line(4, line), "links.g2o"); });
    EXPECT_EQ(error.context().file, "links.g2o");
    EXPECT_EQ(error.context().field, "line 4");
  }
  const std::string vertex = "VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1\n";
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::parse_g2o(vertex + vertex, "links.g2o"); }),
      {.file = "links.g2o", .field = "line 2", .value = "vertex 1"}));
}

TEST(ToroText, ReadsWhatIsWrittenByHand) {
  // A quarter turn about z, and one about x after it; as RTAB-Map writes it, with six decimals.
  const libmap::PoseGraphText read = libmap::parse_toro(
      "VERTEX3 1 0.000000 0.000000 0.000000 0.000000 -0.000000 1.570796\r\n"
      "VERTEX3 4 1.5 2 3 1.5707963267948966 0 1.5707963267948966\r\n"
      "EDGE3 1 4 1 2 3 0 0 0 11 12 13 14 15 16 22 23 24 25 26 33 34 35 36 44 45 46 55 56 66\r\n",
      "poses.toro");
  ASSERT_EQ(read.poses.size(), 2U);
  EXPECT_EQ(read.poses[1].node, 4);
  EXPECT_EQ(read.poses[1].world_from_base.translation(), Eigen::Vector3d(1.5, 2.0, 3.0));
  const Eigen::Vector3d x = read.poses[0].world_from_base.linear() * Eigen::Vector3d::UnitX();
  EXPECT_TRUE(x.isApprox(Eigen::Vector3d::UnitY(), 1e-6));
  // R = Rz Ry Rx: y goes to z, x to y.
  const Pose& turned = read.poses[1].world_from_base;
  EXPECT_TRUE(
      (turned.linear() * Eigen::Vector3d::UnitY()).isApprox(Eigen::Vector3d::UnitZ(), 1e-12));
  EXPECT_TRUE(
      (turned.linear() * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  ASSERT_EQ(read.links.size(), 1U);
  EXPECT_EQ(read.links[0].type, LinkType::neighbor);
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      EXPECT_EQ(read.links[0].information(row, column),
                10 * (std::min(row, column) + 1) + std::max(row, column) + 1);
}

TEST(ToroText, KeepsPosesAndEdges) {
  Trajectory poses = random_trajectory();
  // Yaw and roll have the same axis.
  for (const double pitch : {90.0, -90.0, 89.9999999})
    poses.push_back({static_cast<int>(poses.size()) + 1, 0.0,
                     libmap::make_pose_from_rpy({1, 2, 3}, {33.0, pitch, -17.0})});
  const std::vector<libmap::PoseLink> links = links_of_every_type();
  const std::string text = libmap::to_toro(poses, links);
  EXPECT_EQ(text.find('#'), std::string::npos);  // RTAB-Map's reader stops at a comment
  const libmap::PoseGraphText read = libmap::parse_toro(text, "poses.toro");
  ASSERT_EQ(read.poses.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(read.poses[i].node, poses[i].node);
    EXPECT_EQ(read.poses[i].world_from_base.translation(), poses[i].world_from_base.translation());
    EXPECT_TRUE(read.poses[i].world_from_base.isApprox(poses[i].world_from_base, 1e-14)) << i;
  }
  std::size_t next = 0;
  for (const libmap::PoseLink& link : links) {
    if (link.from == link.to || link.to < 0) continue;
    ASSERT_LT(next, read.links.size());
    EXPECT_EQ(read.links[next].from, link.from);
    EXPECT_EQ(read.links[next].to, link.to);
    EXPECT_TRUE(read.links[next].from_from_to.isApprox(link.from_from_to, 1e-14));
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column)
        EXPECT_EQ(read.links[next].information(row, column), link.information(row, column));
    ++next;
  }
  EXPECT_EQ(next, read.links.size());
}

TEST(ToroText, NamesTheLineThatIsBroken) {
  for (const char* line : {"VERTEX3 1 0 0 0 0 0", "VERTEX3 1 0 0 0 0 0 nan", "VERTEX2 1 0 0 0",
                           "EDGE3 1 2 0 0 0 0 0 0 1 1", "VERTEX3 1 2e9 0 0 0 0 0"}) {
    SCOPED_TRACE(line);
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::parse_toro(with_line(3, line), "poses.toro"); });
    EXPECT_EQ(error.context().file, "poses.toro");
    EXPECT_EQ(error.context().field, "line 3");
  }
}

// A step of 1 m along each axis. Optical z is x of this project, x is -y, y is -z.
TEST(PoseAxes, OpticalOnesTurnTheWorldAndTheBase) {
  using libmap::PoseAxes;
  const Pose step = libmap::make_pose({1, 2, 3}, Eigen::Quaterniond::Identity());
  const Pose turned = libmap::to_axes(PoseAxes::optical, step);
  EXPECT_TRUE(turned.translation().isApprox(Eigen::Vector3d(-2, -3, 1), 1e-15));
  EXPECT_TRUE(turned.linear().isIdentity(1e-15));
  // To the left about z (up) is about -y of the optical axes.
  const Pose left = libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, 30});
  EXPECT_TRUE(libmap::to_axes(PoseAxes::optical, left)
                  .isApprox(libmap::make_pose_from_rpy({0, 0, 0}, {0, -30, 0}), 1e-14));
}

// Worked out by hand from importPoses of RTAB-Map: P = A O Q O^-1, where A takes (x, y, z) to
// (z, -y, x) and O to (z, -x, -y).
TEST(PoseAxes, MotionCaptureTurnsTheWorldOnceMore) {
  using libmap::PoseAxes;
  const Pose in_file = libmap::make_pose({1, 2, 3}, Eigen::Quaterniond::Identity());
  const Pose pose = libmap::from_axes(PoseAxes::motion_capture, in_file);
  // O (1, 2, 3) = (3, -1, -2); A of that = (-2, 1, 3).
  EXPECT_TRUE(pose.translation().isApprox(Eigen::Vector3d(-2, 1, 3), 1e-15));
  Eigen::Matrix3d a;
  a << 0, 0, 1, 0, -1, 0, 1, 0, 0;
  EXPECT_TRUE(pose.linear().isApprox(a, 1e-15));
  EXPECT_FALSE(libmap::from_axes(PoseAxes::optical, in_file).isApprox(pose, 0.1));
}

TEST(PoseAxes, ThereAndBack) {
  for (const auto axes :
       {libmap::PoseAxes::map, libmap::PoseAxes::optical, libmap::PoseAxes::motion_capture}) {
    const Pose pose = random_pose();
    EXPECT_TRUE(libmap::from_axes(axes, libmap::to_axes(axes, pose)).isApprox(pose, 1e-14));
  }
}

// A camera that looks along the world's y with its image upright, at (1, 2, 3).
Pose looking_along_y() {
  Pose pose = Pose::Identity();
  pose.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  pose.translation() = Eigen::Vector3d(1, 2, 3);
  return pose;
}

TEST(Open3dLog, MatricesOfCameras) {
  const std::string text =
      "0 0 1\n1 0 0 1\n0 0 1 2\n0 -1 0 3\n0 0 0 1\n1 1 2\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  EXPECT_EQ(libmap::recognize_poses(text, "poses.log"), ".log");
  const Trajectory poses = libmap::parse_open3d(text, "poses.log");
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_TRUE(poses[0].world_from_base.isApprox(looking_along_y(), 1e-14));
  EXPECT_TRUE(poses[1].world_from_base.isApprox(Pose::Identity(), 1e-14));
  for (const std::string& bad : {text.substr(0, text.size() - 8), text + "2 2\n",
                                 std::string("0 0 1\n1 0 0 1\n0 2 0 2\n0 0 1 3\n0 0 0 1\n")})
    EXPECT_EQ(
        graspmap_test::error_of([&] { libmap::parse_open3d(bad, "poses.log"); }).context().file,
        "poses.log");
}

// nerfstudio's cameras have y up and z backward.
TEST(Nerfstudio, CamerasOfOpenGl) {
  const std::string text =
      R"({"w": 640, "frames": [{"file_path": "images/000007.jpg", "transform_matrix":
         [[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]]}]})";
  EXPECT_EQ(libmap::recognize_poses(text, "transforms.json"), ".json");
  const auto images = libmap::parse_nerfstudio(text, "transforms.json");
  ASSERT_EQ(images.size(), 1U);
  EXPECT_EQ(images[0].image, "images/000007.jpg");
  EXPECT_TRUE(images[0].world_from_camera.isApprox(looking_along_y(), 1e-14));
  for (const std::string bad : {"{", "{}", R"({"frames": [{"file_path": "a"}]})",
                                R"({"frames": [{"file_path": "a", "transform_matrix": [[1]]}]})"})
    EXPECT_EQ(
        graspmap_test::error_of([&] { libmap::parse_nerfstudio(bad, "t.json"); }).context().file,
        "t.json");
}

// The quaternion's w comes first, and stamps are in nanoseconds.
TEST(Euroc, GroundTruth) {
  const std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
      "q_RS_z [], v_RS_R_x [m s^-1]\n1403636580838555648,1,2,3,0.8,0.6,0,0,0.5\n";
  EXPECT_EQ(libmap::recognize_poses(text, "data.csv"), ".euroc");
  const Trajectory poses = libmap::parse_euroc(text, "data.csv");
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_NEAR(poses[0].stamp_s, 1403636580.838555648, 1e-6);
  const Eigen::Quaterniond rotation(poses[0].world_from_base.linear());
  EXPECT_NEAR(std::abs(rotation.x()), 0.6, 1e-12);
  EXPECT_EQ(poses[0].world_from_base.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::parse_euroc("1,2,3\n", "data.csv"); }),
      {.file = "data.csv", .field = "line 1", .value = "3 columns long"}));
}

TEST(RecognizePoses, ByTagOrColumns) {
  const auto format = [](const std::string& text) {
    return libmap::recognize_poses("\xEF\xBB\xBF# 1 2 3\r\n\r\n" + text + "\n", "poses.txt");
  };
  EXPECT_EQ(format("1 0 0 0 0 0 0 1"), ".tum");
  EXPECT_EQ(format("1,0,0,0,0,0,0,1,7"), ".tum");
  EXPECT_EQ(format("1 0 0 0 0 1 0 0 0 0 1 0"), ".kitti");
  EXPECT_EQ(format("VERTEX3 1 0 0 0 0 0 0"), ".toro");
  EXPECT_EQ(format("EDGE2 1 2 0 0 0"), ".toro");
  EXPECT_EQ(format("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1"), ".g2o");
  EXPECT_EQ(format("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1"), ".g2o");
  EXPECT_EQ(format("FIX 1"), ".g2o");
  const libmap::Error error = graspmap_test::error_of([&] { format("1 2 3 4 5 6 7"); });
  EXPECT_EQ(error.context().field, "line 3");
  EXPECT_EQ(error.context().value, "7 columns long");
  EXPECT_TRUE(graspmap_test::is_error(graspmap_test::error_of([&] { format(""); }),
                                      {.file = "poses.txt", .field = "poses"}));
}

}  // namespace trajectory_text_test
