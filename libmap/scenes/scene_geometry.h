// Exact geometric queries on the shapes of a test scene, for sampling and meshing. Units: m, rad.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/scenes/primitive_scene.h"

namespace libmap {

// A segment of the profile of a solid of revolution. Points are (rho, a): distance from the axis,
// position along it. Segments are ordered from the top (large a) down; the outside is on the left.
struct ProfileSegment {
  bool is_arc = false;                              // true: arc; false: line
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  // ends of a line
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  double center_a = 0.0;     // center of an arc, on the axis
  double radius = 0.0;       // radius of an arc
  double angle_start = 0.0;  // angles of an arc's ends from the +a direction
  double angle_end = 0.0;

  // Return a straight segment, or an arc around (0, center_a).
  static ProfileSegment line(Eigen::Vector2d start, Eigen::Vector2d end);
  static ProfileSegment arc(double center_a, double radius, double angle_start, double angle_end);

  double length() const;  // length of the segment
  double area() const;    // area of the surface of revolution
  // Area of the surface of revolution between the parameters t0 <= t1 of point().
  double area_between(double t0, double t1) const;
  Eigen::Vector2d point(double t) const;  // t: fraction of the length, 0 at the start, 1 at the end
  // Outward unit normal at a point of the segment.
  Eigen::Vector2d normal_at(const Eigen::Vector2d& point) const;
  double curvature_along() const;  // curvature of the profile, 1/m; > 0 where convex
  // Curvature of the surface around the axis (Meusnier's theorem), 1/m.
  double curvature_around(const Eigen::Vector2d& point) const;
  // Returns t such that area_between(t0, t) is `fraction` of area_between(t0, t1).
  double t_of_area_fraction(double t0, double t1, double fraction) const;
  // Unsigned distance of a point (rho, a) from the segment.
  double distance(const Eigen::Vector2d& point) const;
  // True if a point (rho, a) is on the outer side of the line or, for an arc, in the arc's sector
  // and outside the circle.
  bool is_beyond(const Eigen::Vector2d& point) const;
};

using Profile = std::vector<ProfileSegment>;

// Returns the signed distance to the convex solid of a closed profile; negative inside.
double profile_signed_distance(const Profile& profile, const Eigen::Vector2d& point);

// A flat rectangle: |x| <= half_x and |y| <= half_y in the face frame, with the outside at +z.
struct FlatFace {
  Pose scene_from_face = Pose::Identity();
  double half_x = 0.0;
  double half_y = 0.0;
};

struct SceneSolid {
  int shape = 0;                             // index in PrimitiveScene::shapes
  Pose scene_from_solid = Pose::Identity();  // the profile's axis is the solid's z
  Pose solid_from_scene = Pose::Identity();
  Profile profile;                                      // only for solids of revolution
  std::vector<FlatFace> faces;                          // six of a box, one of a plane
  Eigen::Vector3d half_size = Eigen::Vector3d::Zero();  // only for a box; its center is the origin
  bool is_plane = false;
  bool is_ground = false;  // true for the first plane, which has the bumps
  Eigen::Vector3d bound_center = Eigen::Vector3d::Zero();  // center of a bounding sphere
  double bound_radius = 0.0;                               // infinite for a plane
};

// Height of the ground above the ground plane, with its derivatives in x and y.
struct GroundHeight {
  double value = 0.0;  // m
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
};

class SceneGeometry {
 public:
  // Throws Error as PrimitiveScene::check does.
  explicit SceneGeometry(const PrimitiveScene& scene);

  const std::vector<SceneSolid>& solids() const { return solids_; }
  // The first plane; nullptr without a plane.
  const SceneSolid* ground() const { return ground_ < 0 ? nullptr : &solids_[index(ground_)]; }
  struct PlacedBump {
    Bump bump;
    Eigen::Vector2d center;  // x, y in the ground's frame
    int shape = 0;           // index in PrimitiveScene::shapes
  };
  const std::vector<PlacedBump>& bumps() const { return bumps_; }
  bool has_bumps() const { return !bumps_.empty(); }

  GroundHeight ground_height(double x, double y) const;  // at (x, y) in the ground's frame

  // Signed distance to one solid, negative inside; a first-order approximation on bumpy ground.
  double signed_distance(const SceneSolid& solid, const Eigen::Vector3d& point) const;

  // Returns the surface of a solid of revolution on a segment of the profile, at the segment's
  // parameter t and the angle about the axis.
  SurfaceTruth on_profile(const SceneSolid& solid, std::size_t segment, double t,
                          double angle) const;
  // Returns the surface of a face at x, y in the face frame; on the ground, including bumps.
  SurfaceTruth on_face(const SceneSolid& solid, const FlatFace& face, double x, double y) const;

  // True if a surface point of `solid` is visible from outside the union of all solids.
  bool is_visible(const SceneSolid& solid, const Eigen::Vector3d& position,
                  const Eigen::Vector3d& normal) const;
  // True if `other` hides a surface point of `solid`. Of coincident faces with equal normal, the
  // face of the first solid in the scene is visible.
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

// Throws Error naming `field` and `value` if `count` exceeds `max_count`. `what` is the name of the
// counted objects, e.g. "triangles" for the option max_triangles.
void require_count(double count, std::uint64_t max_count, const std::string& what,
                   const std::string& field, const std::string& value);

}  // namespace libmap
