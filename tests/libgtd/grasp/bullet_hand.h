// Closes the fingers with a physics engine, Bullet (Coumans 2010, zlib license). Bullet uses
// millimeters and its own links: capsules around the straight lines of the finger, and a disc.
#pragma once

#include <btBulletCollisionCommon.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "libgtd/grasp/finger_closing.h"
#include "libgtd/grasp/gripper_closing.h"
#include "libgtd/grasp/ground.h"
#include "libgtd/gripper/gripper.h"
#include "libmap/core/angle.h"
#include "tests/libgtd/grasp/bullet_shapes.h"

namespace bullet_test {

using libgtd::ApproachPose;
using libgtd::ClosedGripper;
using libgtd::FingerOutcome;
using libgtd::Gripper;

constexpr double radians = libmap::radians_per_degree;

// ---- Distances

inline btVector3 mm(const Eigen::Vector3d& meters) {
  return {1000.0 * meters.x(), 1000.0 * meters.y(), 1000.0 * meters.z()};
}
inline Eigen::Vector3d meters(const btVector3& mm) {
  return {0.001 * mm.x(), 0.001 * mm.y(), 0.001 * mm.z()};
}

inline btTransform in_mm(const Eigen::Isometry3d& frame) {
  const Eigen::Quaterniond turn(frame.linear());
  return btTransform(btQuaternion(turn.x(), turn.y(), turn.z(), turn.w()), mm(frame.translation()));
}

// Static mesh with its origin at the location.
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
  Eigen::Vector3d point{0.0, 0.0, 0.0};  // point of the ground, m
};

class Distances {
 public:
  explicit Distances(StaticMesh& mesh) { ground_.setCollisionShape(mesh.surface()); }

  // Distance of the ground from the shape without its margin (line of a capsule, disc). Ground
  // beyond the horizon is ignored.
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

// ---- Closing

constexpr double link_radius_mm = 0.2;
constexpr double touch_mm = 0.001;
constexpr double clearance_m = 1e-5;  // clearance of the open gripper before closing

enum class Part : std::size_t { proximal, outer_half, inner_half, palm };

struct ClosedByBullet {
  bool palm_touches = false;
  Eigen::Isometry3d patch_from_gripper = Eigen::Isometry3d::Identity();
  struct Finger {
    FingerOutcome outcome = FingerOutcome::end_stop;
    double proximal_rad = 0.0;
    double curl_rad = 0.0;
    std::optional<Eigen::Vector3d> link;  // points of the ground, m
    std::optional<Eigen::Vector3d> spines;
  };
  std::vector<Finger> fingers;
};

// Moves parts until one of them touches. The distance bounds the free movement (conservative
// advancement, Mirtich 1996).
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

  // Minimum distance of the parts of one finger from the ground, mm.
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

  // Pose of a part in the gripper frame; its shape is along z.
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
    double speed = 1.0;  // maximum m per unit of the parameter
    std::function<Eigen::Isometry3d(double)> at;
  };
  struct Touch {
    Part part = Part::palm;
    double at = 0.0;
    Eigen::Vector3d point{0.0, 0.0, 0.0};
  };

  // The parameter decreases. If bodies touch at the same time, the first of them counts.
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
    finger.outcome = first->part == Part::outer_half ? FingerOutcome::spines : FingerOutcome::link;
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
      finger.outcome = FingerOutcome::spines;
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

inline ClosedGripper closed_by_libgtd(const Shape& shape, const Gripper& gripper,
                                      const ApproachPose& pose) {
  const libgtd::Ground ground(shape.mesh);
  const libgtd::ClosingOptions options;
  const libgtd::GroundPatch patch =
      libgtd::patch_around(ground, shape.location, Eigen::Vector3d::UnitZ(), gripper,
                           pose.offset_m.norm(), pose.tilt_rad.norm(), options);
  return libgtd::close_gripper(patch, gripper, pose, options);
}

}  // namespace bullet_test
