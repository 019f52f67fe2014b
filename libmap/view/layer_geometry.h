// Converts the layers of a scene to colored triangles for rendering.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/pose.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/view/color_map.h"
#include "libmap/view/scene_camera.h"
#include "libmap/view/scene_view.h"

namespace libmap {

// A colored layer in the terrain frame without invalid points and triangles.
struct PreparedLayer {
  std::vector<Eigen::Vector3d> positions;  // all finite
  std::vector<Color> colors;               // one per position
  std::vector<Eigen::Vector3f> normals;    // empty, or one per position of length 1 or 0
  std::vector<Triangle> triangles;         // empty if not a mesh
  bool is_mesh = false;
  bool cubes = false;          // points are cubes, otherwise squares
  bool shaded = false;         // shaded by normals, or cubes by the direction of their sides
  double point_size_m = 0.0;   // 0 for a mesh
  double filler_size_m = 0.0;  // side of the squares that close gaps (fillers); 0: none
  Legend legend;
  const ColorImage* texture = nullptr;         // page of a textured mesh, multiplied by `colors`
  std::vector<Eigen::Vector2f> coordinates{};  // in `texture`, one per position, from the top left
};

// Prepares a layer. A textured mesh becomes one layer per page, which refers to the page in
// `layer`, and one of triangles without a page, in untextured_color. Other shapes become one layer.
// Throws Error as color_points does, for an array of wrong length, and for mode `texture` if there
// is no texture.
std::vector<PreparedLayer> prepare_layers(const SceneLayer& layer, const Pose& terrain_from_scene);

inline constexpr Color untextured_color{128, 128, 128};

struct PointSpacing {
  // Pitch of the lattice, else the median distance of nearest neighbors; 0 if all points coincide.
  double distance_m = 0.0;
  bool lattice = false;  // the points are on a lattice along the axes
  bool gaps = false;     // over 15 % of points have fewer than 8 neighbors; true without a lattice
};
// Estimates the spacing, and whether the points are on a lattice along the axes.
PointSpacing estimate_spacing(const std::vector<Eigen::Vector3d>& positions);

struct ColoredTriangles {
  std::vector<Eigen::Vector3f> vertices;  // meters, relative to `origin`
  std::vector<Color> colors;              // one per vertex
  std::vector<Triangle> triangles;
  const ColorImage* texture = nullptr;  // as in PreparedLayer
  std::vector<Eigen::Vector2f> coordinates{};
};

// Returns the triangles of a layer: a mesh unchanged, a cloud as squares or visible sides of cubes,
// at least 1.3 pixels wide. With filler_size_m, each point also has a filler, a larger square
// behind the point as seen from the camera, which fills gaps with the color of a neighboring point.
// In top views, fillers are below the whole layer, so that they do not cover any of its points. In
// other views, fillers cover only surfaces far behind the points.
ColoredTriangles triangles_of(const PreparedLayer& layer, const SceneCamera& camera,
                              const Eigen::Vector3d& origin);

}  // namespace libmap
