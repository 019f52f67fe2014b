// Offscreen pictures of clouds, meshes and graspability maps.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/view/color_map.h"
#include "libmap/view/image_io.h"
#include "libmap/view/scene_camera.h"

namespace libmap {

// automatic: cubes where the points lie on a lattice, else squares.
// cube:      axis-aligned in the terrain frame.
// square:    facing the camera.
enum class PointShape { automatic, cube, square };

// automatic: meshes, the sides of cubes, and clouds of one color (by their normals) are shaded;
//            all else has exactly the colors of the legend, or those of its texture.
// none:      exact colors everywhere.
// full:      squares of a cloud with normals and textures are shaded too.
enum class Shading { automatic, none, full };

// One cloud or mesh; a textured mesh that has no pages is a mesh. Points that are not finite are
// left out, as are triangles with such corners.
struct SceneLayer {
  std::variant<PointCloud, TriangleMesh, TexturedMesh> shape{};
  Coloring coloring{};
  PointShape point_shape = PointShape::automatic;
  Shading shading = Shading::automatic;
  double point_size_m = 0.0;  // side of a cube or square; 0: from the spacing, gaps closed
};
// All but the shape, the height of the zero plane and the legend of own colors.
void bind(ParameterTable& table, SceneLayer& layer);

// What is known of a marked place: green, red, or dark before there is a verdict.
enum class Verdict { none, pass, fail };

// A labeled point, drawn over everything. One that the view does not contain is left out.
struct Marker {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // scene frame, meters
  std::string label{};                                 // may be empty
  Verdict verdict = Verdict::none;
};

// A measure as technical drawings give it: a line with an arrow head at both ends and its text
// beside its middle, drawn over everything.
struct DimensionLine {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // scene frame, meters
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  std::string text{};
};

struct Scene {
  std::vector<SceneLayer> layers;  // all in the scene's frame, meters
  std::vector<Marker> markers;
  std::vector<DimensionLine> dimension_lines{};
  // Views, axes, heights, the zero plane and cubes refer to the terrain frame.
  Pose terrain_from_scene = Pose::Identity();
};

struct SceneViewOptions {
  int width = 1600;   // pixels, 1 to 16384
  int height = 1200;  // pixels, 1 to 16384
  Viewpoint view = Viewpoint::top;
  CameraPlacement camera;  // of Viewpoint::camera, in the scene's frame
  std::string title;
  bool axes = true;
  bool scale_bar = true;
  bool legend = true;
  int font_px = 0;                     // of the texts, pixels; 0: from the size of the picture
  std::string background = "#5f6b7a";  // behind the scene: "#rrggbb" or a name
  // What the view is fitted to, meters in the terrain frame, so that several scenes are shown
  // alike; default: all that is drawn.
  std::optional<Bounds3d> extent{};
  // On the page around the scene lie title, legend, axes and scale bar; parts for which a small
  // picture has no room are left out.
};
// The keys of any picture; and those of one of a single scene: its size, legend and axes.
void bind(ParameterTable& table, SceneViewOptions& options);
void bind_single(ParameterTable& table, SceneViewOptions& options);

// The picture of `scene`, whose clouds and meshes are freed before they are drawn; the same scene
// and options give the same bytes on the same machine. Starts a VirtualDisplay of its own if no
// display answers: hold one around several calls to start only one. Calls from several threads are
// run one after the other. Throws Error: no point to draw, a size or color or camera that cannot
// be, a layer whose arrays do not fit each other, and what color_points throws; (failed) if no
// picture can be drawn here.
ColorImage render_scene(Scene scene, const SceneViewOptions& options);

// Of a scene, before it is drawn: the box in the terrain frame that its view is fitted to, with the
// widths of its points, and the legends of its layers, each once. Throws as render_scene does.
struct SceneContents {
  Bounds3d extent;
  std::vector<Legend> legends;
};
SceneContents contents_of(const Scene& scene);

// The part of the picture that shows the scene, and the camera that does: where a point falls is
// camera.pixel_of(terrain_from_scene * point). Needs no display.
SceneCamera camera_of(const Scene& scene, const SceneViewOptions& options);

}  // namespace libmap
