// The solids of a scene, posed and ready to be asked. Inner part of libmap/simulate: sampling and
// meshing use it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/simulate/primitive_scene.h"
#include "libmap/simulate/scene_profile.h"

namespace libmap {

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
