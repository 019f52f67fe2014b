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
  std::vector<Triangle> triangles;         // of a mesh
  bool is_mesh = false;
  bool cubes = false;          // points are cubes, otherwise squares
  bool shaded = false;         // by normals; cubes: by side
  double point_size_m = 0.0;   // 0 for a mesh
  double filler_size_m = 0.0;  // size of the squares that close gaps; 0: none
  Legend legend;
  // Page of a textured mesh, multiplied with `colors`.
  const ColorImage* texture = nullptr;
  std::vector<Eigen::Vector2f> coordinates{};  // one per position, from the top left
};

// Prepares a layer. A textured mesh becomes one layer per page, which refers to the page in
// `layer`; triangles without a page have untextured_color. Other shapes become one layer. Throws
// Error as color_points does, and if an array has a wrong length, or mode `texture` no texture.
std::vector<PreparedLayer> prepare_layers(const SceneLayer& layer, const Pose& terrain_from_scene);

inline constexpr Color untextured_color{128, 128, 128};

struct PointSpacing {
  // Pitch of the lattice along the axes, else the median distance of nearest neighbors; 0 if all
  // points coincide.
  double distance_m = 0.0;
  bool lattice = false;  // the points are on a lattice along the axes
  bool gaps = false;     // surface cells of the lattice are empty; true without a lattice
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

// Triangles of a layer: a mesh unchanged, a cloud as squares or visible cube sides of at least 1.3
// pixels. Fillers are larger squares behind the points, as seen from the camera; fillers show the
// color of a neighboring point in gaps. Seen from above, fillers are below the whole layer, so that
// each column shows the highest point. In other views, fillers cover only surfaces far behind.
ColoredTriangles triangles_of(const PreparedLayer& layer, const SceneCamera& camera,
                              const Eigen::Vector3d& origin);

}  // namespace libmap
