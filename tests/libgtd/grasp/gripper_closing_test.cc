#include "libgtd/grasp/gripper_closing.h"

#include <gtest/gtest.h>

#include "libmap/core/random_stream.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace gripper_closing_test {

using grasp_test::gripper;
using grasp_test::height_mesh;
using grasp_test::revolved;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libgtd::ApproachOutcome;
using libgtd::ClosedGripper;
using libgtd::FingerOutcome;

constexpr double degree = libmap::radians_per_degree;

ClosedGripper close_on(const libmap::TriangleMesh& mesh, const libgtd::ApproachPose& pose = {},
                       const libgtd::Gripper& of = gripper(),
                       const libgtd::ClosingOptions& options = {}) {
  const libgtd::Ground ground(mesh);
  const auto patch = libgtd::patch_around(ground, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(),
                                          of, pose.offset_m.norm(), pose.tilt_rad.norm(), options);
  return libgtd::close_gripper(patch, of, pose, options);
}

double flat(double, double) { return 0.0; }

TEST(GripperClosing, OnAPlaneTheTipsTouchFirst) {
  const ClosedGripper closed = close_on(height_mesh(0.3, 30, flat), {0.1, {0.01, -0.02}, {0, 0}});
  EXPECT_EQ(closed.approach, ApproachOutcome::on_ground);
  EXPECT_FALSE(closed.palm_touches);
  const libgtd::FingerGeometry finger = libgtd::finger_geometry(gripper());
  const double depth = -finger.tip(finger.opening_rad, finger.curl_rad).y();
  EXPECT_NEAR(closed.patch_from_gripper.translation().z(), depth, 2e-5);
  ASSERT_EQ(closed.contacts.size(), 8u);
  for (const libgtd::GripContact& contact : closed.contacts) {
    EXPECT_TRUE(contact.by_spines);
    EXPECT_NEAR(contact.point.z(), 0, 1e-12);
    EXPECT_NEAR((contact.normal - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-9);
    EXPECT_NEAR((contact.drag + contact.outward).norm(), 0, 1e-9);
  }
  EXPECT_NEAR(closed.unseen, 0, 1e-9);
}

TEST(GripperClosing, ThePalmTouchesItsHighestPoint) {
  // A needle below the palm, off its center, and another beside it.
  for (const double x : {0.02, 0.042}) {
    auto mesh = height_mesh(0.3, 30, flat);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(),
                         {{x, 0.013, 0.06}, {x + 0.001, 0.013, 0}, {x, 0.014, 0}});
    mesh.triangles.push_back({first, first + 1, first + 2});
    const ClosedGripper closed = close_on(mesh);
    const bool under_palm = std::hypot(x, 0.013) < 0.0355;
    EXPECT_EQ(closed.palm_touches, under_palm);
    EXPECT_EQ(std::abs(closed.patch_from_gripper.translation().z() - 0.06) < 2e-5, under_palm);
  }
}

// Sphere on a plane: circle of the tip around the joint against the circle of the sphere. A wide
// sphere stops open fingers; a small one is out of reach.
TEST(GripperClosing, Spheres) {
  const libgtd::FingerGeometry finger = libgtd::finger_geometry(gripper());
  for (const double radius : {0.02, 0.05, 0.07, 0.5}) {
    std::vector<Eigen::Vector2d> profile;
    for (int n = 1; n < 400; ++n) {
      const double polar = n * std::numbers::pi / 400;
      profile.emplace_back(radius * std::sin(polar), radius * (std::cos(polar) - 1));
    }
    // No ground for wide spheres, because the fingers would touch it.
    const auto mesh = revolved(profile, 128);
    libgtd::ClosingOptions options;
    options.max_unseen = 1;
    const ClosedGripper closed = close_on(mesh, {}, gripper(), options);
    ASSERT_EQ(closed.approach, ApproachOutcome::on_ground);
    const double palm = closed.patch_from_gripper.translation().z();
    if (radius > 0.1) {
      EXPECT_FALSE(closed.palm_touches);
      EXPECT_GT(palm, 1e-3);
      continue;
    }
    EXPECT_TRUE(closed.palm_touches);
    EXPECT_NEAR(palm, 0, 2e-4);
    // By steps of the closing angle: distances of tip and links from the center of the sphere.
    const Eigen::Vector2d center(0, -radius - palm);
    const auto distance = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      const Eigen::Vector2d d = b - a;
      const double fraction = std::clamp((center - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
      return (a + fraction * d - center).norm();
    };
    double angle = finger.opening_rad;
    bool by_link = false;
    for (; angle > finger.closing_rad; angle -= 1e-4) {
      const Eigen::Vector2d knuckle = finger.knuckle(angle);
      const Eigen::Vector2d tip = finger.tip(angle, finger.curl_rad);
      by_link = distance(finger.joint(), knuckle) < radius;
      if (by_link || distance(knuckle, tip) < radius) break;
    }
    for (const libgtd::ClosedFinger& one : closed.fingers) {
      EXPECT_NEAR(one.closing.proximal_rad, std::max(angle, finger.closing_rad), 3e-3) << radius;
      EXPECT_EQ(one.closing.link.has_value() && !one.closing.spines, false) << radius;
    }
    EXPECT_EQ(closed.contacts.empty(), radius < 0.06) << radius;
    for (const libgtd::GripContact& contact : closed.contacts) {
      const Eigen::Vector3d from_center = contact.point + Eigen::Vector3d(0, 0, radius);
      EXPECT_NEAR(from_center.norm(), radius, 3e-4);
      EXPECT_GT(contact.normal.dot(from_center.normalized()), 0.999);
      EXPECT_NEAR(contact.drag.dot(contact.normal), 0, 1e-9);
      // Upward on the sphere, toward its top.
      EXPECT_NEAR(contact.drag.dot(contact.outward), -contact.normal.z(), 1e-3);
      EXPECT_GT(contact.drag.z(), 0);
    }
  }
}

TEST(GripperClosing, YawAndRigidMotionOfEverything) {
  const auto bumps = [](double x, double y) {
    return 0.02 * std::sin(40 * x) * std::cos(33 * y) + 0.04 * std::exp(-500 * (x * x + y * y));
  };
  const auto mesh = height_mesh(0.3, 60, bumps);
  const ClosedGripper closed = close_on(mesh);
  const ClosedGripper turned = close_on(mesh, {.yaw_rad = 2 * std::numbers::pi / 8});
  ASSERT_EQ(closed.contacts.size(), turned.contacts.size());
  for (std::size_t n = 0; n < 8; ++n)
    EXPECT_NEAR(closed.fingers[(n + 1) % 8].closing.proximal_rad,
                turned.fingers[n].closing.proximal_rad, 1e-9);
  const Eigen::Isometry3d motion = Eigen::Translation3d(3, -2, 1) *
                                   Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized());
  auto moved = mesh;
  for (Eigen::Vector3d& vertex : moved.vertices) vertex = motion * vertex;
  const libgtd::Ground ground(moved);
  const Eigen::Vector3d away = motion.linear() * Eigen::Vector3d::UnitZ();
  const auto patch = libgtd::patch_around(ground, motion.translation(), away, gripper(), 0, 0, {});
  // The frame of the patch has its own x axis.
  const Eigen::Vector3d x = patch.mesh_from_patch.linear().transpose() * motion.linear().col(0);
  const ClosedGripper there =
      libgtd::close_gripper(patch, gripper(), {.yaw_rad = std::atan2(x.y(), x.x())}, {});
  ASSERT_EQ(there.contacts.size(), closed.contacts.size());
  for (std::size_t n = 0; n < closed.contacts.size(); ++n)
    EXPECT_NEAR(
        (patch.mesh_from_patch * there.contacts[n].point - motion * closed.contacts[n].point)
            .norm(),
        0, 1e-9);
}

TEST(GripperClosing, AFinerMeshOfTheSameGroundChangesLittle) {
  const auto bumps = [](double x, double y) { return 0.05 * std::cos(25 * x) * std::cos(31 * y); };
  std::vector<Eigen::Vector3d> points[2];
  for (const int n : {0, 1})
    for (const auto& contact : close_on(height_mesh(0.3, n == 0 ? 200 : 400, bumps)).contacts)
      points[n].push_back(contact.point);
  ASSERT_EQ(points[0].size(), points[1].size());
  for (std::size_t n = 0; n < points[0].size(); ++n)
    EXPECT_NEAR((points[0][n] - points[1][n]).norm(), 0, 5e-4);
}

TEST(GripperClosing, GroundBehindAHoleIsUnseen) {
  // A sector of the ground is missing below the finger at azimuth 0.
  auto mesh = height_mesh(0.3, 60, flat);
  std::erase_if(mesh.triangles, [&](const libmap::Triangle& triangle) {
    const Eigen::Vector3d& p = mesh.vertices[triangle[0]];
    return p.x() > 0.06 && std::abs(p.y()) < 0.02;
  });
  const ClosedGripper closed = close_on(mesh);
  const libgtd::FingerGeometry finger = libgtd::finger_geometry(gripper());
  const double tip = finger.tip(finger.opening_rad, finger.curl_rad).x();
  // Share of the missing ring in the sector, to one cell of 5 mm.
  EXPECT_NEAR(closed.fingers[0].unseen, 1 - 0.065 * 0.065 / (tip * tip), 0.05);
  EXPECT_NEAR(closed.fingers[2].unseen, 0, 1e-9);
  EXPECT_NEAR(closed.unseen, closed.fingers[0].unseen / 8, 1e-9);
  for (const auto& contact : closed.contacts) EXPECT_NE(contact.finger, 0u);
  EXPECT_EQ(closed.contacts.size(), 7u);
  // Ground far below is seen, although out of reach.
  const auto cliff =
      close_on(height_mesh(0.3, 60, [](double x, double) { return x > 0.03 ? -0.9 : 0.0; }));
  EXPECT_NEAR(cliff.unseen, 0, 1e-9);
  EXPECT_EQ(cliff.fingers[0].closing.outcome, FingerOutcome::end_stop);
}

TEST(GripperClosing, BesideAHighRockTheWayIsBlocked) {
  const auto step = [](double x, double) { return x > 0.08 ? 0.6 : 0.0; };
  EXPECT_EQ(close_on(height_mesh(0.3, 60, step)).approach, ApproachOutcome::blocked);
  // A roof with free space below is not an obstacle.
  auto mesh = height_mesh(0.3, 60, flat);
  for (const double z : {0.5, 0.6}) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}});
    const std::array<libmap::Triangle, 2> up = {libmap::Triangle{first, first + 1, first + 2},
                                                libmap::Triangle{first, first + 2, first + 3}};
    for (const auto& [a, b, c] : up)
      mesh.triangles.push_back(z == 0.6 ? libmap::Triangle{a, b, c} : libmap::Triangle{a, c, b});
  }
  const ClosedGripper under_roof = close_on(mesh);
  EXPECT_EQ(under_roof.approach, ApproachOutcome::on_ground);
  EXPECT_EQ(under_roof.contacts.size(), 8u);
}

TEST(GripperClosing, NoGroundBelow) {
  auto mesh = height_mesh(0.3, 3, flat);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex.x() += 1;
  EXPECT_EQ(close_on(mesh).approach, ApproachOutcome::no_ground);
  EXPECT_EQ(close_on(mesh).unseen, 1);
}

TEST(GroundPatch, DistancesAgreeWithAllTriangles) {
  auto mesh = height_mesh(0.3, 12, [](double x, double y) { return 0.3 * x * y - 0.1 * x; });
  // Large triangles beside the small ones.
  mesh.vertices.insert(mesh.vertices.end(), {{-3, -3, -0.2}, {3, -3, -0.2}, {0, 4, -0.2}});
  mesh.triangles.push_back({static_cast<std::uint32_t>(mesh.vertices.size() - 3),
                            static_cast<std::uint32_t>(mesh.vertices.size() - 2),
                            static_cast<std::uint32_t>(mesh.vertices.size() - 1)});
  const libgtd::Ground ground(mesh);
  libmap::RandomStream random(3, 3);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d point(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4),
                                random.uniform(-0.3, 0.3));
    // By many points of each triangle.
    double nearest = 1e9;
    for (const auto& [a, b, c] : mesh.triangles)
      for (int i = 0; i <= 8; ++i)
        for (int j = 0; i + j <= 8; ++j) {
          const Eigen::Vector3d on = mesh.vertices[a] +
                                     i / 8.0 * (mesh.vertices[b] - mesh.vertices[a]) +
                                     j / 8.0 * (mesh.vertices[c] - mesh.vertices[a]);
          nearest = std::min(nearest, (on - point).norm());
        }
    const auto distance = ground.distance(point, 0.1);
    if (nearest < 0.09) {
      ASSERT_TRUE(distance);
    }
    if (distance) {
      EXPECT_LE(*distance, nearest + 1e-12);
      EXPECT_LE(*distance, 0.1);
    }
  }
  EXPECT_NEAR(*ground.distance({2.0, -2.5, -0.15}, 0.1), 0.05, 1e-12);
}

TEST(GroundPatch, BadMeshes) {
  EXPECT_TRUE(is_error(error_of([] { libgtd::Ground ground{libmap::TriangleMesh{}}; }),
                       {.field = "triangles of the mesh"}));
  auto mesh = height_mesh(0.1, 2, flat);
  mesh.vertices[3].z() = std::nan("");
  EXPECT_TRUE(
      is_error(error_of([&] { libgtd::Ground ground(mesh); }), {.field = "vertices of the mesh"}));
  mesh = height_mesh(0.1, 2, flat);
  mesh.triangles[0][1] = 1000;
  EXPECT_TRUE(is_error(error_of([&] { libgtd::Ground ground(mesh); }),
                       {.field = "vertex of triangle 0", .value = "1000", .bound = "< 25"}));
}

}  // namespace gripper_closing_test
