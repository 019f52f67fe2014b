// The same fingers closed by a physics engine, Bullet (Coumans 2010, zlib license): which links
// touch the ground and where, and the pull that takes the gripper off where it holds by Coulomb
// friction alone. Bullet gets millimeters, and links of its own: capsules about the finger's
// straight lines, and a disc.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletCollisionCommon.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/grasp/bearing.h"
#include "libgtd/grasp/finger_closing.h"
#include "libgtd/grasp/gripper_closing.h"
#include "libgtd/grasp/ground.h"
#include "libgtd/grasp/holding_force.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/angle.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/triangle_mesh.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace bullet_test {

using libgtd::ApproachPose;
using libgtd::ClosedGripper;
using libgtd::FingerEnd;
using libgtd::Gripper;
using libmap::RandomStream;
using libmap::TriangleMesh;

constexpr double pi = std::numbers::pi;
constexpr double radians = libmap::radians_per_degree;

// ---- Shapes

// About the z axis, from the top down; (r, z) in meters.
TriangleMesh revolved(const std::vector<Eigen::Vector2d>& outline, std::uint32_t sides) {
  TriangleMesh mesh;
  for (const Eigen::Vector2d& point : outline)
    for (std::uint32_t n = 0; n < sides; ++n) {
      const double angle = 2.0 * pi * (n + 0.5) / sides;
      mesh.vertices.emplace_back(point.x() * std::cos(angle), point.x() * std::sin(angle),
                                 point.y());
    }
  for (std::uint32_t row = 0; row + 1 < outline.size(); ++row)
    for (std::uint32_t n = 0; n < sides; ++n) {
      const std::uint32_t next = (n + 1) % sides;
      const std::uint32_t a = row * sides + n;
      const std::uint32_t b = row * sides + next;
      if (outline[row + 1].x() > 0.0) mesh.triangles.push_back({a, a + sides, b + sides});
      if (outline[row].x() > 0.0) mesh.triangles.push_back({a, b + sides, b});
    }
  return mesh;
}

// Its center is at this height.
TriangleMesh sphere(double radius, double center, std::uint32_t sides = 96) {
  std::vector<Eigen::Vector2d> outline;
  const std::uint32_t rows = sides / 2;
  for (std::uint32_t n = 0; n <= rows; ++n) {
    const double angle = pi * n / rows;
    outline.emplace_back(n % rows == 0 ? 0.0 : radius * std::sin(angle),
                         center + radius * std::cos(angle));
  }
  return revolved(outline, sides);
}

TriangleMesh post(double radius, double height, std::uint32_t sides = 96) {
  return revolved({{0.0, height}, {radius, height}, {radius, 0.0}}, sides);
}

TriangleMesh cone(double radius, double height) {
  return revolved({{0.0, height}, {radius, 0.0}}, 96);
}

TriangleMesh box(double half_x, double half_y, double height) {
  TriangleMesh mesh = post(std::numbers::sqrt2, height, 4);
  for (Eigen::Vector3d& vertex : mesh.vertices) {
    vertex.x() *= half_x;
    vertex.y() *= half_y;
  }
  return mesh;
}

// A ridge along x.
TriangleMesh wedge(double half_length, double half_width, double height) {
  TriangleMesh mesh;
  mesh.vertices = {{-half_length, 0.0, height},      {half_length, 0.0, height},
                   {-half_length, -half_width, 0.0}, {half_length, -half_width, 0.0},
                   {half_length, half_width, 0.0},   {-half_length, half_width, 0.0}};
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {0, 1, 4}, {0, 4, 5}, {0, 5, 2}, {1, 3, 4}};
  return mesh;
}

TriangleMesh field(double half, std::uint32_t cells,
                   const std::function<double(double, double)>& height) {
  TriangleMesh mesh;
  for (std::uint32_t row = 0; row <= cells; ++row)
    for (std::uint32_t column = 0; column <= cells; ++column) {
      const double x = half * (2.0 * column / cells - 1.0);
      const double y = half * (2.0 * row / cells - 1.0);
      mesh.vertices.emplace_back(x, y, height(x, y));
    }
  for (std::uint32_t row = 0; row < cells; ++row)
    for (std::uint32_t column = 0; column < cells; ++column) {
      const std::uint32_t a = row * (cells + 1) + column;
      const std::uint32_t c = a + cells + 1;
      mesh.triangles.push_back({a, a + 1, c + 1});
      mesh.triangles.push_back({a, c + 1, c});
    }
  return mesh;
}

TriangleMesh on_plane(const TriangleMesh& shape, double half) {
  return graspmap_test::join_meshes(field(half, 8, [](double, double) { return 0.0; }), shape);
}

struct Shape {
  std::string name;
  TriangleMesh mesh;
  Eigen::Vector3d location;  // its top, or the middle of a field
};

constexpr int shape_count = 50;

// Sizes for a finger of this length, m.
Shape make_shape(int number, double reach) {
  RandomStream random(2026, static_cast<std::uint64_t>(number));
  const auto size = [&](double low, double high) { return reach * random.uniform(low, high); };
  const double half = 4.0 * reach;
  if (number < 14) {
    const double radius = size(0.2, 1.3);
    // The last ones float.
    const double center = radius * (random.uniform(0.2, 1.0) + (number < 10 ? 0.0 : 1.0));
    return {"sphere", on_plane(sphere(radius, center), half), {0.0, 0.0, radius + center}};
  }
  if (number < 22) {
    const double height = size(0.2, 1.4);
    return {"post", on_plane(post(size(0.2, 1.1), height), half), {0.0, 0.0, height}};
  }
  if (number < 30) {
    const double height = size(0.2, 1.4);
    return {"box", on_plane(box(size(0.2, 0.9), size(0.2, 0.9), height), half), {0.0, 0.0, height}};
  }
  if (number < 36) {
    const double height = size(0.3, 1.4);
    return {"cone", on_plane(cone(size(0.5, 1.4), height), half), {0.0, 0.0, height}};
  }
  if (number < 42) {
    const double height = size(0.3, 1.4);
    return {
        "wedge", on_plane(wedge(size(0.5, 1.5), size(0.3, 1.2), height), half), {0.0, 0.0, height}};
  }
  if (number < 44) {
    const double slope = std::tan(random.uniform(5.0, 40.0) * radians);
    return {"tilted plane",
            field(half, 8, [slope](double x, double) { return slope * x; }),
            {0.0, 0.0, 0.0}};
  }
  struct Bump {
    double x, y, width, height;
  };
  std::vector<Bump> bumps;
  for (int n = 0; n < 40; ++n)
    bumps.push_back({size(-1.8, 1.8), size(-1.8, 1.8), size(0.1, 0.4), size(-0.3, 0.6)});
  const auto height = [&](double x, double y) {
    double sum = 0.0;
    for (const Bump& bump : bumps)
      sum += bump.height * std::exp(-0.5 * (std::pow(x - bump.x, 2) + std::pow(y - bump.y, 2)) /
                                    std::pow(bump.width, 2));
    return sum;
  };
  return {"bumps", field(2.2 * reach, 100, height), {0.0, 0.0, height(0.0, 0.0)}};
}

// ---- Bullet: distances

btVector3 mm(const Eigen::Vector3d& meters) {
  return {1000.0 * meters.x(), 1000.0 * meters.y(), 1000.0 * meters.z()};
}
Eigen::Vector3d meters(const btVector3& mm) {
  return {0.001 * mm.x(), 0.001 * mm.y(), 0.001 * mm.z()};
}

btTransform in_mm(const Eigen::Isometry3d& frame) {
  const Eigen::Quaterniond turn(frame.linear());
  return btTransform(btQuaternion(turn.x(), turn.y(), turn.z(), turn.w()), mm(frame.translation()));
}

// A static mesh, its origin in the location.
class StaticMesh {
 public:
  explicit StaticMesh(const Shape& shape) {
    for (const libmap::Triangle& triangle : shape.mesh.triangles)
      triangles_.addTriangle(mm(shape.mesh.vertices[triangle[0]] - shape.location),
                             mm(shape.mesh.vertices[triangle[1]] - shape.location),
                             mm(shape.mesh.vertices[triangle[2]] - shape.location));
    surface_.emplace(&triangles_, true);
    surface_->setMargin(0.0);
  }
  btBvhTriangleMeshShape* surface() { return &*surface_; }

 private:
  btTriangleMesh triangles_{true, false};
  std::optional<btBvhTriangleMeshShape> surface_;
};

struct Nearest {
  double distance_mm = 0.0;
  Eigen::Vector3d point{0.0, 0.0, 0.0};  // of the ground, m
};

class Distances {
 public:
  explicit Distances(StaticMesh& mesh) { ground_.setCollisionShape(mesh.surface()); }

  // Of the ground from the shape without its margin: a capsule's line, a disc. Farther ground than
  // the horizon is not seen.
  Nearest nearest(btConvexShape& shape, const Eigen::Isometry3d& where) {
    struct Closest : btCollisionWorld::ContactResultCallback {
      Nearest nearest;
      btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper*, int, int,
                               const btCollisionObjectWrapper*, int, int) override {
        if (point.getDistance() < nearest.distance_mm)
          nearest = {point.getDistance(), meters(point.getPositionWorldOnB())};
        return 0.0;
      }
    } closest;
    closest.nearest.distance_mm = horizon_mm;
    closest.m_closestDistanceThreshold = horizon_mm;
    link_.setCollisionShape(&shape);
    link_.setWorldTransform(in_mm(where));
    world_.contactPairTest(&link_, &ground_, closest);
    closest.nearest.distance_mm += shape.getMargin();
    return closest.nearest;
  }

 private:
  static constexpr double horizon_mm = 8.0;

  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btCollisionWorld world_{&dispatcher_, &broadphase_, &configuration_};
  btCollisionObject ground_;
  btCollisionObject link_;
};

// ---- Bullet: closing

constexpr double link_radius_mm = 0.2;
constexpr double touch_mm = 0.001;
constexpr double clearance_m = 1e-5;  // of the open gripper before it closes

enum class Part : std::size_t { proximal, outer_half, inner_half, palm };

struct ClosedByBullet {
  bool palm_touches = false;
  Eigen::Isometry3d patch_from_gripper = Eigen::Isometry3d::Identity();
  struct Finger {
    FingerEnd end = FingerEnd::end_stop;
    double proximal_rad = 0.0;
    double curl_rad = 0.0;
    std::optional<Eigen::Vector3d> link;  // points of the ground, m
    std::optional<Eigen::Vector3d> spines;
  };
  std::vector<Finger> fingers;
};

// Moves parts until one of them touches. The distance bounds how far they may go without touching
// (conservative advancement, Mirtich 1996).
class HandInBullet {
 public:
  HandInBullet(const Gripper& gripper, StaticMesh& mesh)
      : distances_(mesh),
        joint_(0.0005 * gripper.finger_joint_diameter_mm),
        proximal_(0.001 * gripper.finger_length_mm),
        distal_(0.001 * gripper.spine_length_mm),
        opening_(radians * gripper.opening_angle_deg),
        closing_(radians * gripper.closing_angle_deg),
        curl_(radians * gripper.fingers->curl_deg),
        curl_limit_(radians * gripper.fingers->curl_limit_deg),
        count_(gripper.fingers->count),
        proximal_shape_(link_radius_mm, 1000.0 * proximal_),
        half_shape_(link_radius_mm, 500.0 * distal_),
        palm_shape_(btVector3(0.5 * gripper.palm_diameter_mm + palm_margin_mm,
                              0.5 * gripper.palm_diameter_mm + palm_margin_mm,
                              palm_half_mm + palm_margin_mm)) {
    palm_shape_.setMargin(palm_margin_mm);
  }

  ClosedByBullet close(const ApproachPose& pose, double start_m) {
    ClosedByBullet closed;
    Eigen::Isometry3d& frame = closed.patch_from_gripper;
    frame.translate(Eigen::Vector3d(pose.offset_m.x(), pose.offset_m.y(), 0.0));
    const Eigen::Vector3d tilt(pose.tilt_rad.x(), pose.tilt_rad.y(), 0.0);
    if (tilt.norm() > 0.0) frame.rotate(Eigen::AngleAxisd(tilt.norm(), tilt.normalized()));
    frame.rotate(Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()));
    const auto lifted = [&frame](double height) -> Eigen::Isometry3d {
      return frame * Eigen::Translation3d(0.0, 0.0, height);
    };
    std::vector<Body> open = {{Part::palm, 1.0, [&](double height) -> Eigen::Isometry3d {
                                 return lifted(height) *
                                        Eigen::Translation3d(0.0, 0.0, 0.001 * palm_half_mm);
                               }}};
    for (int n = 0; n < count_; ++n)
      for (const Part part : {Part::proximal, Part::outer_half, Part::inner_half})
        open.push_back({part, 1.0, [&, n, part](double height) {
                          return lifted(height) * link(n, part, opening_, opening_ - curl_);
                        }});
    const auto rest = move(open, start_m, -1.0);
    if (!rest) return closed;
    closed.palm_touches = rest->part == Part::palm;
    frame = lifted(rest->at + clearance_m);
    for (int n = 0; n < count_; ++n) closed.fingers.push_back(close_finger(frame, n));
    return closed;
  }

  // From the parts of one finger to the ground, at least; mm.
  double distance(const Eigen::Isometry3d& frame, int finger, double proximal_rad,
                  double curl_rad) {
    double least = std::numeric_limits<double>::infinity();
    for (const Part part : {Part::proximal, Part::outer_half, Part::inner_half})
      least = std::min(least, distances_
                                  .nearest(shape(part), frame * link(finger, part, proximal_rad,
                                                                     proximal_rad - curl_rad))
                                  .distance_mm);
    return least;
  }

  // A part's place in the gripper's frame; its shape lies along z.
  Eigen::Isometry3d link(int finger, Part part, double proximal_rad, double distal_rad) const {
    if (part == Part::palm)
      return Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 0.001 * palm_half_mm));
    const double azimuth = 2.0 * pi * finger / count_;
    const auto along = [&](double angle) {
      return Eigen::Vector3d(std::sin(angle) * std::cos(azimuth),
                             std::sin(angle) * std::sin(azimuth), -std::cos(angle));
    };
    const Eigen::Vector3d joint(joint_ * std::cos(azimuth), joint_ * std::sin(azimuth), 0.0);
    const Eigen::Vector3d knuckle = joint + proximal_ * along(proximal_rad);
    const Eigen::Vector3d middle =
        part == Part::proximal
            ? Eigen::Vector3d(0.5 * (joint + knuckle))
            : Eigen::Vector3d(knuckle + (part == Part::inner_half ? 0.25 : 0.75) * distal_ *
                                            along(distal_rad));
    const Eigen::Vector3d direction = along(part == Part::proximal ? proximal_rad : distal_rad);
    Eigen::Isometry3d place = Eigen::Isometry3d::Identity();
    place.translation() = middle;
    place.linear() =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction).toRotationMatrix();
    return place;
  }

  btConvexShape& shape(Part part) {
    if (part == Part::palm) return palm_shape_;
    if (part == Part::proximal) return proximal_shape_;
    return half_shape_;
  }

 private:
  static constexpr double palm_half_mm = 0.5;
  static constexpr double palm_margin_mm = 0.04;

  struct Body {
    Part part = Part::palm;
    double speed = 1.0;  // m at most per unit of the parameter
    std::function<Eigen::Isometry3d(double)> at;
  };
  struct Touch {
    Part part = Part::palm;
    double at = 0.0;
    Eigen::Vector3d point{0.0, 0.0, 0.0};
  };

  // The parameter goes down. Where bodies touch at once, the first of them counts.
  std::optional<Touch> move(const std::vector<Body>& bodies, double from, double to) {
    double at = from;
    while (true) {
      double step = std::numeric_limits<double>::infinity();
      for (const Body& body : bodies) {
        const Nearest nearest = distances_.nearest(shape(body.part), body.at(at));
        if (nearest.distance_mm <= touch_mm) return Touch{body.part, at, nearest.point};
        step = std::min(step, 0.001 * nearest.distance_mm / body.speed);
      }
      if (at <= to) return std::nullopt;
      at = std::max(to, at - step);
    }
  }

  ClosedByBullet::Finger close_finger(const Eigen::Isometry3d& frame, int n) {
    const auto whole = [&](Part part) {
      return [&, n, part](double angle) -> Eigen::Isometry3d {
        return frame * link(n, part, angle, angle - curl_);
      };
    };
    ClosedByBullet::Finger finger;
    const double reach = proximal_ + distal_;
    const auto first = move({{Part::proximal, proximal_, whole(Part::proximal)},
                             {Part::outer_half, reach, whole(Part::outer_half)},
                             {Part::inner_half, reach, whole(Part::inner_half)}},
                            opening_, closing_);
    finger.proximal_rad = first ? first->at : closing_;
    finger.curl_rad = curl_;
    if (!first) return finger;
    finger.end = first->part == Part::outer_half ? FingerEnd::spines : FingerEnd::link;
    (first->part == Part::outer_half ? finger.spines : finger.link) = first->point;
    if (first->part != Part::proximal) return finger;
    const auto alone = [&](Part part) {
      return [&, n, part](double angle) -> Eigen::Isometry3d {
        return frame * link(n, part, finger.proximal_rad, angle);
      };
    };
    const double last = finger.proximal_rad - curl_limit_;
    const auto second = move({{Part::outer_half, distal_, alone(Part::outer_half)},
                              {Part::inner_half, distal_, alone(Part::inner_half)}},
                             finger.proximal_rad - curl_, last);
    finger.curl_rad = finger.proximal_rad - (second ? second->at : last);
    if (second && second->part == Part::outer_half) {
      finger.end = FingerEnd::spines;
      finger.spines = second->point;
    }
    return finger;
  }

  Distances distances_;
  double joint_;
  double proximal_;
  double distal_;
  double opening_;
  double closing_;
  double curl_;
  double curl_limit_;
  int count_;
  btCapsuleShapeZ proximal_shape_;
  btCapsuleShapeZ half_shape_;
  btCylinderShapeZ palm_shape_;
};

Gripper gripper_of(const std::string& name,
                   const std::vector<std::pair<std::string, std::string>>& overrides = {}) {
  return libgtd::read_gripper(graspmap_test::source_folder() / "data/grippers" / (name + ".yaml"),
                              overrides);
}

double reach_m(const Gripper& gripper) {
  return 0.001 * (gripper.finger_length_mm + gripper.spine_length_mm);
}

ClosedGripper closed_by_libgtd(const Shape& shape, const Gripper& gripper,
                               const ApproachPose& pose) {
  const libgtd::Ground ground(shape.mesh);
  const libgtd::ClosingOptions options;
  const libgtd::GroundPatch patch =
      libgtd::patch_around(ground, shape.location, Eigen::Vector3d::UnitZ(), gripper,
                           pose.offset_m.norm(), pose.tilt_rad.norm(), options);
  return libgtd::close_gripper(patch, gripper, pose, options);
}

// Two of 20,000 fingers on shapes that are drawn like these differ: one contact grazes, one is
// named for the other half of the distal link at the same angle.
TEST(BulletGripper, ClosesAlike) {
  std::map<FingerEnd, int> ends;
  int went_on_alone = 0;
  int palms = 0;
  for (int number = 0; number < shape_count; ++number) {
    const Gripper gripper = gripper_of(
        std::array{"scar-e", "limbero", "hubrobo"}[static_cast<std::size_t>(number % 3)]);
    const Shape shape = make_shape(number, reach_m(gripper));
    RandomStream random(7, static_cast<std::uint64_t>(number));
    ApproachPose pose;
    pose.yaw_rad = random.uniform(0.0, 2.0 * pi);
    pose.offset_m = 0.06 * reach_m(gripper) * Eigen::Vector2d(random.normal(), random.normal());
    pose.tilt_rad = 3.0 * radians * Eigen::Vector2d(random.normal(), random.normal());
    const ClosedGripper ours = closed_by_libgtd(shape, gripper, pose);
    StaticMesh mesh(shape);
    const ClosedByBullet theirs =
        HandInBullet(gripper, mesh).close(pose, libgtd::ClosingOptions().start_height_m);
    const std::string name = fmt::format("{} {} on {}", number, gripper.name, shape.name);
    EXPECT_EQ(ours.palm_touches, theirs.palm_touches) << name;
    EXPECT_TRUE(ours.patch_from_gripper.isApprox(theirs.patch_from_gripper, 1e-5)) << name;
    ASSERT_EQ(ours.fingers.size(), theirs.fingers.size()) << name;
    palms += ours.palm_touches ? 1 : 0;
    std::size_t points = 0;
    for (std::size_t n = 0; n < ours.fingers.size(); ++n) {
      const libgtd::FingerClosing& closing = ours.fingers[n].closing;
      const ClosedByBullet::Finger& finger = theirs.fingers[n];
      EXPECT_EQ(closing.end, finger.end) << name << ", finger " << n;
      EXPECT_EQ(closing.link.has_value(), finger.link.has_value()) << name << ", finger " << n;
      EXPECT_NEAR(closing.proximal_rad, finger.proximal_rad, 0.1 * radians) << name;
      EXPECT_NEAR(closing.curl_rad, finger.curl_rad, 0.1 * radians) << name;
      points += (finger.link ? 1 : 0) + (finger.spines ? 1 : 0);
      ++ends[closing.end];
      went_on_alone += closing.spines && closing.link ? 1 : 0;
    }
    EXPECT_EQ(ours.contacts.size(), points) << name;
    for (const libgtd::GripContact& contact : ours.contacts) {
      const ClosedByBullet::Finger& finger = theirs.fingers[contact.finger];
      const auto& point = contact.by_spines ? finger.spines : finger.link;
      if (!point) continue;  // told above
      EXPECT_LT((contact.point - *point).norm(), 1e-4) << name;
    }
  }
  EXPECT_GT(ends[FingerEnd::spines], 100);
  EXPECT_GT(ends[FingerEnd::link], 20);
  EXPECT_GT(ends[FingerEnd::end_stop], 50);
  EXPECT_GT(went_on_alone, 20);
  EXPECT_GT(palms, 10);
  EXPECT_LT(palms, shape_count - 10);
}

// ---- Bullet: pulling

// The closed gripper as a body that floats without weight: the palm, and each finger's outer half,
// which slides along the finger's radius and is pressed toward the axis by the closing force.
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

  // The pull at which the palm begins to leave. It grows from half of `about_n`; infinity if the
  // gripper still holds at twice as much.
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
  static constexpr double growth = 1.0005;  // of the pull in a step
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
  double falling = 0.0;  // sine of the contacts' slope: 0 on a wall, above 0 below an equator
};

Pulls pulls_of(const Shape& shape, const Gripper& gripper, double friction,
               const Eigen::Vector3d& direction) {
  const ApproachPose pose{.yaw_rad = 0.3};
  const ClosedGripper ours = closed_by_libgtd(shape, gripper, pose);
  Pulls pulls;
  std::vector<libgtd::BearingContact> bearing;
  for (const libgtd::GripContact& contact : ours.contacts) {
    EXPECT_TRUE(contact.by_spines);
    // A lean of 0 and no limit of the spines: friction alone.
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
Gripper curled_gripper() { return gripper_of("scar-e", {{"fingers.curl_deg", "50"}}); }

Shape post_to_pull(double radius) {
  return {fmt::format("post of {} m", radius),
          on_plane(post(radius, 0.15, 256), 0.4),
          {0.0, 0.0, 0.15}};
}

// High enough that the fingers do not meet the plane.
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
  const Gripper gripper = gripper_of("scar-e");
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

// All six rows of the equilibrium count: the pull acts on the palm, above the contacts.
TEST(BulletGripper, ComesOffSidewaysAtTheSamePull) {
  const Eigen::Vector3d sideways = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d slanting = Eigen::Vector3d(1.0, 0.0, 1.0).normalized();
  for (const Eigen::Vector3d& direction : {sideways, slanting}) {
    const Pulls post = pulls_of(post_to_pull(0.038), curled_gripper(), 0.39, direction);
    EXPECT_NEAR(post.theirs_n / post.ours_n, 1.0, 0.1) << direction.x();
    const Pulls sphere = pulls_of(sphere_to_pull(0.057), gripper_of("scar-e"), 0.39, direction);
    EXPECT_NEAR(sphere.theirs_n / sphere.ours_n, 1.0, 0.1) << direction.x();
  }
}

}  // namespace bullet_test
