// Compares the pull that detaches a gripper held by Coulomb friction only, by libgtd and by Bullet.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "libgtd/grasp/bearing.h"
#include "libgtd/grasp/holding_force.h"
#include "tests/libgtd/grasp/bullet_hand.h"
#include "tests/libgtd/grasp/bullet_shapes.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace bullet_pull_test {

using namespace bullet_test;

// Closed gripper as a weightless floating body: the palm, and the outer half of each finger, which
// slides along the radius of the finger and is pressed toward the axis by the closing force.
class PulledGripper {
 public:
  PulledGripper(const Gripper& gripper, HandInBullet& hand, const ClosedByBullet& closed,
                StaticMesh& mesh, double friction)
      : closing_force_n_(gripper.fingers->closing_force_n),
        fingers_(gripper.fingers->count),
        body_(fingers_, palm_mass, btVector3(4.0, 4.0, 4.0), false, false) {
    world_.setGravity(btVector3(0.0, 0.0, 0.0));
    btContactSolverInfo& info = world_.getSolverInfo();
    info.m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
    info.m_numIterations = 50;
    info.m_splitImpulse = 0;
    ground_.setCollisionShape(mesh.surface());
    ground_.setFriction(1.0);
    world_.addCollisionObject(&ground_, ground_group, moving_group);
    body_.setLinearDamping(0.0);
    body_.setAngularDamping(0.0);
    body_.setUseGyroTerm(false);
    body_.setHasSelfCollision(false);
    const Eigen::Isometry3d palm = hand.link(0, Part::palm, 0.0, 0.0);
    body_.setBaseWorldTransform(in_mm(closed.patch_from_gripper * palm));
    for (int n = 0; n < fingers_; ++n) {
      const auto& finger = closed.fingers[static_cast<std::size_t>(n)];
      const Eigen::Isometry3d place =
          palm.inverse() * hand.link(n, Part::outer_half, finger.proximal_rad,
                                     finger.proximal_rad - finger.curl_rad);
      const double azimuth = 2.0 * pi * n / fingers_;
      const Eigen::Vector3d outward(std::cos(azimuth), std::sin(azimuth), 0.0);
      const Eigen::Vector3d axis = place.linear().transpose() * outward;
      body_.setupPrismatic(n, finger_mass, btVector3(0.05, 0.05, 0.05), -1,
                           in_mm(place).getRotation().inverse(),
                           btVector3(axis.x(), axis.y(), axis.z()), mm(place.translation()),
                           btVector3(0.0, 0.0, 0.0), true);
      body_.setJointPos(n, 1.5 * link_radius_mm);
    }
    body_.finalizeMultiDof();
    world_.addMultiBody(&body_);
    for (int n = -1; n < fingers_; ++n) {
      auto& collider =
          *colliders_.emplace_back(std::make_unique<btMultiBodyLinkCollider>(&body_, n));
      collider.setCollisionShape(&hand.shape(n < 0 ? Part::palm : Part::outer_half));
      collider.setFriction(n < 0 ? 0.0 : friction);
      if (n < 0)
        body_.setBaseCollider(&collider);
      else
        body_.getLink(n).m_collider = &collider;
      world_.addCollisionObject(&collider, moving_group, ground_group);
    }
    btAlignedObjectArray<btQuaternion> turns;
    btAlignedObjectArray<btVector3> places;
    body_.forwardKinematics(turns, places);
    body_.updateCollisionObjectWorldTransforms(turns, places);
  }

  ~PulledGripper() {
    for (const auto& collider : colliders_) world_.removeCollisionObject(collider.get());
    world_.removeMultiBody(&body_);
    world_.removeCollisionObject(&ground_);
  }

  // Returns the pull at which the palm starts to move. The pull grows from half of `about_n`;
  // infinity if the gripper still holds at twice `about_n`.
  double pull_out(const Eigen::Vector3d& direction, double about_n) {
    constexpr int settling = 200;
    for (int n = 0; n < settling; ++n) step(direction, 0.0, std::min(1.0, 2.0 * n / settling));
    const btVector3 start = body_.getBasePos();
    for (double pull = 0.5 * about_n; pull < 2.0 * about_n; pull *= growth) {
      step(direction, pull, 1.0);
      if ((body_.getBasePos() - start).length() > leaving_mm) return pull;
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  static constexpr int ground_group = 1;
  static constexpr int moving_group = 2;
  static constexpr double palm_mass = 0.002;  // 1 N moves it by 500 mm/s2
  static constexpr double finger_mass = 0.0005;
  static constexpr double step_s = 0.001;
  static constexpr double growth = 1.0005;  // factor of the pull per step
  static constexpr double leaving_mm = 0.03;

  void step(const Eigen::Vector3d& direction, double pull, double closing) {
    for (int n = 0; n < fingers_; ++n) body_.addJointTorque(n, -closing * closing_force_n_);
    body_.addBaseForce(pull * btVector3(direction.x(), direction.y(), direction.z()));
    world_.stepSimulation(step_s, 0);
  }

  double closing_force_n_;
  int fingers_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btMultiBodyConstraintSolver solver_;
  btMultiBodyDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_};
  btCollisionObject ground_;
  btMultiBody body_;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders_;
};

struct Pulls {
  double ours_n = 0.0;
  double theirs_n = 0.0;
  double falling = 0.0;  // sine of the contact slope: 0 on a wall, > 0 below an equator
};

Pulls pulls_of(const Shape& shape, const Gripper& gripper, double friction,
               const Eigen::Vector3d& direction) {
  const ApproachPose pose{.yaw_rad = 0.3};
  const ClosedGripper ours = closed_by_libgtd(shape, gripper, pose);
  Pulls pulls;
  std::vector<libgtd::BearingContact> bearing;
  for (const libgtd::GripContact& contact : ours.contacts) {
    EXPECT_TRUE(contact.by_spines);
    // Facet angle 0 and no spine limit: friction only.
    bearing.emplace_back(contact, std::vector<double>{0.0}, friction, 1e6);
    pulls.falling -= contact.normal.z() / static_cast<double>(ours.contacts.size());
  }
  EXPECT_EQ(bearing.size(), 8U);
  libgtd::HoldingOptions options;
  options.load_point = ours.patch_from_gripper.translation();
  options.closing_force_n = gripper.fingers->closing_force_n;
  options.holds_when_closed = false;
  pulls.ours_n = libgtd::holding_force(bearing, direction, options);
  StaticMesh mesh(shape);
  HandInBullet hand(gripper, mesh);
  const ClosedByBullet closed = hand.close(pose, libgtd::ClosingOptions().start_height_m);
  pulls.theirs_n =
      PulledGripper(gripper, hand, closed, mesh, friction).pull_out(direction, pulls.ours_n);
  return pulls;
}

// SCAR-E with a larger curl, so that the tips reach a post.
Gripper curled_gripper() { return grasp_test::gripper({{"fingers.curl_deg", "50"}}); }

Shape post_to_pull(double radius) {
  return {fmt::format("post of {} m", radius),
          on_plane(post(radius, 0.15, 256), 0.4),
          {0.0, 0.0, 0.15}};
}

// High enough for the fingers not to meet the plane.
Shape sphere_to_pull(double radius) {
  return {fmt::format("sphere of {} m", radius),
          on_plane(sphere(radius, 1.2 * radius, 192), 0.4),
          {0.0, 0.0, 2.2 * radius}};
}

TEST(BulletGripper, ComesOffAPostAtTheSamePull) {
  const Gripper gripper = curled_gripper();
  const double closing_n = 8.0 * gripper.fingers->closing_force_n;
  for (const double radius : {0.032, 0.038, 0.042})
    for (const double friction : {0.2, 0.39, 0.8}) {
      const Shape shape = post_to_pull(radius);
      const Pulls pulls = pulls_of(shape, gripper, friction, Eigen::Vector3d::UnitZ());
      EXPECT_NEAR(pulls.ours_n, closing_n * friction, 0.002 * closing_n * friction)
          << shape.name << ", friction " << friction;
      EXPECT_NEAR(pulls.theirs_n / pulls.ours_n, 1.0, 0.1)
          << shape.name << ", friction " << friction;
    }
}

TEST(BulletGripper, ComesOffASphereAtTheSamePull) {
  const Gripper gripper = grasp_test::gripper();
  const double closing_n = 8.0 * gripper.fingers->closing_force_n;
  for (const double radius : {0.057, 0.060, 0.064, 0.070})
    for (const double friction : {0.39, 0.8}) {
      const Shape shape = sphere_to_pull(radius);
      const Pulls pulls = pulls_of(shape, gripper, friction, Eigen::Vector3d::UnitZ());
      const double expected = closing_n * std::tan(std::asin(pulls.falling) + std::atan(friction));
      EXPECT_NEAR(pulls.ours_n, expected, 0.01 * expected)
          << shape.name << ", friction " << friction;
      EXPECT_NEAR(pulls.theirs_n / pulls.ours_n, 1.0, 0.1)
          << shape.name << ", friction " << friction;
    }
}

// Tests all six rows of the equilibrium: the pull acts on the palm, above the contacts.
TEST(BulletGripper, ComesOffSidewaysAtTheSamePull) {
  const Eigen::Vector3d sideways = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d slanting = Eigen::Vector3d(1.0, 0.0, 1.0).normalized();
  for (const Eigen::Vector3d& direction : {sideways, slanting}) {
    const Pulls post = pulls_of(post_to_pull(0.038), curled_gripper(), 0.39, direction);
    EXPECT_NEAR(post.theirs_n / post.ours_n, 1.0, 0.1) << direction.x();
    const Pulls sphere = pulls_of(sphere_to_pull(0.057), grasp_test::gripper(), 0.39, direction);
    EXPECT_NEAR(sphere.theirs_n / sphere.ours_n, 1.0, 0.1) << direction.x();
  }
}

}  // namespace bullet_pull_test
