// Renders images of clouds, meshes and graspability maps offscreen.
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

// automatic: cubes if the points are on a lattice, else squares.
// cube:      aligned with the axes of the terrain frame.
// square:    facing the camera.
enum class PointShape { automatic, cube, square };

// automatic: meshes, cubes, and clouds of one color with normals are shaded; all others have the
//            exact colors of the legend or texture.
// none:      exact colors.
// full:      clouds with normals and textured meshes are shaded, too.
enum class Shading { automatic, none, full };

// A cloud or mesh; a textured mesh without pages is drawn as a mesh. Non-finite points, and
// triangles with non-finite corners, are dropped.
struct SceneLayer {
  std::variant<PointCloud, TriangleMesh, TexturedMesh> shape{};
  Coloring coloring{};
  PointShape point_shape = PointShape::automatic;
  Shading shading = Shading::automatic;
  double point_size_m = 0.0;  // side of a cube or square; 0: from the spacing, with gaps closed
};
// Binds all fields except the shape, the zero plane and the legend of own colors.
void bind(ParameterTable& table, SceneLayer& layer);

// Verdict on a marked location. Markers are dark (none), green (pass) or red (fail).
enum class Verdict { none, pass, fail };

// A labeled point, drawn over the scene. Markers outside of the view are omitted.
struct Marker {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // scene frame, meters
  std::string label{};                                 // may be empty
  Verdict verdict = Verdict::none;
};

// A dimension as in technical drawings: a line with arrow heads at both ends and a text beside the
// center, drawn over the scene.
struct DimensionLine {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // scene frame, meters
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  std::string text{};
};

struct Scene {
  std::vector<SceneLayer> layers;  // in the scene frame, meters
  std::vector<Marker> markers;
  std::vector<DimensionLine> dimension_lines{};
  // Views, axes, heights, the zero plane and cubes refer to the terrain frame.
  Pose terrain_from_scene = Pose::Identity();
};

struct SceneViewOptions {
  int width = 1600;   // pixels, 1 to 16384
  int height = 1200;  // pixels, 1 to 16384
  Viewpoint view = Viewpoint::top;
  CameraPlacement camera;  // for Viewpoint::camera, in the scene frame
  std::string title;       // empty: none
  bool axes = true;
  bool scale_bar = true;
  bool legend = true;
  int font_px = 0;                     // font size, pixels; 0: from the image size
  std::string background = "#5f6b7a";  // behind the scene: "#rrggbb" or a name
  // Box to which the view is fitted, meters in the terrain frame, for equal views of several
  // scenes; nullopt: the bounding box of the scene.
  std::optional<Bounds3d> extent{};
  // Title, legend, axes and scale bar are beside the scene; a small image omits them.
};
// Binds the keys for all images.
void bind(ParameterTable& table, SceneViewOptions& options);
// Binds the keys for images of a single scene: size, legend and axes.
void bind_single(ParameterTable& table, SceneViewOptions& options);

// Renders `scene`; equal scenes and options give equal bytes on one machine. Clouds and meshes are
// freed after preparation. Each call starts a VirtualDisplay if no display answers; create one
// before several calls to start it once. Calls from several threads are serialized. Throws Error as
// color_points does, and if there is nothing to draw, a size, a color or the camera is invalid, or
// arrays of a layer are inconsistent. Throws Error (failed) if rendering is not possible.
ColorImage render_scene(Scene scene, const SceneViewOptions& options);

struct SceneContents {
  Bounds3d extent;              // bounding box in the terrain frame, with the size of points
  std::vector<Legend> legends;  // distinct legends of the layers
};
SceneContents contents_of(const Scene& scene);  // throws Error as render_scene does

// Returns the camera that render_scene uses: camera.pixel_of(terrain_from_scene * point) is the
// pixel of a point of the scene. Requires no display. Throws Error as render_scene does.
SceneCamera camera_of(const Scene& scene, const SceneViewOptions& options);

}  // namespace libmap
