// The solids of a scene, posed and ready to be asked: for sampling, meshing and sites.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/scenes/primitive_scene.h"

namespace libmap {

// One piece of a profile in coordinates (rho, a): distance from the axis, and along it. Pieces run
// from the top (large a) down, so that the outside lies on their left.
struct ProfileSegment {
  bool is_arc = false;
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  // of a line
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  double center_a = 0.0;  // of an arc, whose center lies on the axis
  double radius = 0.0;
  double angle_start = 0.0;  // from the +a direction, radians
  double angle_end = 0.0;

  // A straight segment; an arc about (center_a, 0).
  static ProfileSegment line(Eigen::Vector2d start, Eigen::Vector2d end);
  static ProfileSegment arc(double center_a, double radius, double angle_start, double angle_end);

  double length() const;  // of the segment, in meters
  double area() const;    // turned once about the axis
  // The part of area() between two places, t0 <= t1.
  double area_between(double t0, double t1) const;
  Eigen::Vector2d point(double t) const;  // t from 0 to 1 along the length
  // Outward unit normal at a point of the segment.
  Eigen::Vector2d normal_at(const Eigen::Vector2d& point) const;
  double curvature_along() const;  // of the profile itself
  // Of the surface in the direction round the axis (Meusnier).
  double curvature_around(const Eigen::Vector2d& point) const;
  // t such that the part of the area between t0 and t1 that lies before it is `share`.
  double t_of_area_share(double t0, double t1, double share) const;
  // Distance in the half-plane, without sign.
  double distance(const Eigen::Vector2d& point) const;
  // Whether a point of the half-plane is on the inner side of the line, or in the arc's sector
  // beyond its circle.
  bool is_beyond(const Eigen::Vector2d& point) const;
};

using Profile = std::vector<ProfileSegment>;

// Signed distance to the convex solid that a closed profile encloses.
double profile_signed_distance(const Profile& profile, const Eigen::Vector2d& point);

// A flat rectangle, |x| <= half_x and |y| <= half_y in its own frame, whose outside is +z.
struct FlatFace {
  Pose scene_from_face = Pose::Identity();
  double half_x = 0.0;
  double half_y = 0.0;
};

struct SceneSolid {
  int shape = 0;                             // index in the scene
  Pose scene_from_solid = Pose::Identity();  // the profile's axis is the solid's z
  Pose solid_from_scene = Pose::Identity();
  Profile profile;                                      // of a solid of revolution; else empty
  std::vector<FlatFace> faces;                          // of a box (six) or a plane (one)
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();  // of a box about its center
  bool is_plane = false;
  bool is_ground = false;  // the first plane, which bumps bend
  Eigen::Vector3d bound_center = Eigen::Vector3d::Zero();
  double bound_radius = 0.0;  // of a ball around the solid; infinite for a plane
};

// Height of the ground over its own plane, with first and second derivatives.
struct GroundHeight {
  double value = 0.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
};

class SceneGeometry {
 public:
  // Throws Error as PrimitiveScene::check().
  explicit SceneGeometry(const PrimitiveScene& scene);

  const std::vector<SceneSolid>& solids() const { return solids_; }
  const SceneSolid* ground() const { return ground_ < 0 ? nullptr : &solids_[index(ground_)]; }
  // A bump in the ground's frame.
  struct PlacedBump {
    Bump bump;
    Eigen::Vector2d center;
    int shape = 0;
  };
  const std::vector<PlacedBump>& bumps() const { return bumps_; }
  bool has_bumps() const { return !bumps_.empty(); }

  GroundHeight ground_height(double x, double y) const;  // of the ground at (x, y), bumps included

  // To the surface of one solid: negative inside.
  double signed_distance(const SceneSolid& solid, const Eigen::Vector3d& point) const;

  // The truth at parameters of a face.
  SurfaceTruth on_profile(const SceneSolid& solid, std::size_t segment, double t,
                          double angle) const;
  SurfaceTruth on_face(const SceneSolid& solid, const FlatFace& face, double x, double y) const;

  // Whether a surface point of `solid` is seen from outside the union; the second form asks about
  // one other solid alone. Of two faces that coincide and look the same way, the solid that stands
  // first in the scene has it.
  bool is_visible(const SceneSolid& solid, const Eigen::Vector3d& position,
                  const Eigen::Vector3d& normal) const;
  bool is_hidden_by(const SceneSolid& solid, const SceneSolid& other,
                    const Eigen::Vector3d& position, const Eigen::Vector3d& normal) const;

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  void add_bumps(const PrimitiveScene& scene);
  double height_of(const Eigen::Vector3d& point) const;
  int ground_shape_at(double x, double y) const;
  void bend_to_ground(const SceneSolid& ground, double x, double y, SurfaceTruth& truth) const;

  std::vector<SceneSolid> solids_;
  std::vector<PlacedBump> bumps_;
  int ground_ = -1;
};

// Throws Error, because of the option `field`, if it asks for more "triangles" than max_triangles.
void require_count(double count, std::uint64_t max_count, const std::string& what,
                   const std::string& field, const std::string& value);

}  // namespace libmap
