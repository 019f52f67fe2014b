// From the layers of a scene to colored triangles, as they are drawn.
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

// A layer in the terrain frame, colored, with nothing in it that cannot be drawn.
struct PreparedLayer {
  std::vector<Eigen::Vector3d> positions;  // all finite
  std::vector<Color> colors;               // one a position
  std::vector<Eigen::Vector3f> normals;    // empty, or unit length (or zero) one a position
  std::vector<Triangle> triangles;         // of a mesh
  bool is_mesh = false;
  bool cubes = false;
  bool shaded = false;         // by the normals; for cubes: by the side
  double point_size_m = 0.0;   // 0 for a mesh
  double filler_size_m = 0.0;  // of the squares that close gaps; 0: none
  Legend legend;
  // Of a page of a textured mesh: its colors are times `colors`.
  const ColorImage* texture = nullptr;
  std::vector<Eigen::Vector2f> coordinates{};  // one a position, from the top left
};

// One layer, but of a textured mesh that is to be shown so a layer a page, which must outlive it;
// triangles without a page are of the color of untextured_color. Throws Error: arrays of a wrong
// length, the texture asked of a layer without any, and what color_points throws.
std::vector<PreparedLayer> prepare_layers(const SceneLayer& layer, const Pose& terrain_from_scene);

inline constexpr Color untextured_color{128, 128, 128};

struct PointSpacing {
  // Meters, 0 if no two points are apart: on a lattice along the axes its pitch, else the median
  // distance to the nearest other point.
  double distance_m = 0.0;
  bool lattice = false;
  bool gaps = false;  // cells of a surface on the lattice are empty; always where there is none
};
// From the points themselves: their lattice, if they lie on one, else the median distance of
// nearest neighbors.
PointSpacing estimate_spacing(const std::vector<Eigen::Vector3d>& positions);

struct ColoredTriangles {
  std::vector<Eigen::Vector3f> vertices;  // meters from the `origin` that was given
  std::vector<Color> colors;              // one a vertex
  std::vector<Triangle> triangles;
  const ColorImage* texture = nullptr;  // as in PreparedLayer
  std::vector<Eigen::Vector2f> coordinates{};
};

// Squares or the visible sides of cubes for a cloud, at least 1.3 pixels wide; a mesh as it is. The
// fillers are larger squares behind the points, seen from the camera: what is seen through a gap is
// the color of a point beside it. From above they lie below the whole layer, so that every column
// shows its highest point; in other views they cover only what is far behind.
ColoredTriangles triangles_of(const PreparedLayer& layer, const SceneCamera& camera,
                              const Eigen::Vector3d& origin);

}  // namespace libmap
