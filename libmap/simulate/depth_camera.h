// A time-of-flight depth camera with a registered color camera, looking at a triangle mesh.
//
// First what an ideal camera sees, then what the sensor makes of it. Every pixel has random numbers
// of its own: the same seed gives the same image at any thread count.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

class RayCaster;

// x/z, y/z of the rays through a camera's pixels and their corners; NaN where there is no ray.
struct ViewRays {
  int width = 0;
  int height = 0;
  std::vector<Eigen::Vector2d> centers;  // width * height
  std::vector<Eigen::Vector2d> corners;  // (width + 1) * (height + 1); (0, 0) is at pixel -0.5 -0.5
};
ViewRays make_view_rays(const Camera& camera);

// One view without noise. Depths are 0 where there is no surface.
struct SurfaceView {
  DepthImage depth;              // at the pixels' centers
  DepthImage corner_depth;       // at their corners, as ViewRays::corners
  Image<float> incidence_cos;    // of the angle between ray and normal at the center
  Image<Eigen::Vector3f> color;  // 0 to 1: half the center's, an eighth of each corner's
};

// Where colors come from: the mesh's vertices, or rock_color(); automatic: the vertices, unless
// they have no colors or all the same.
enum class TextureSource { automatic, mesh, rock };

// Where the normals that light falls on come from: the mesh's vertices must have them.
enum class ShadingNormals { estimated, of_vertices };

// Meshes ready to be looked at; copies share them. Light comes from the sky and a little more from
// one side.
class VisibleSurface {
 public:
  // Throws Error as RayCaster does, and where the mesh's own colors are asked for and there are
  // none. The mesh may go away afterwards.
  explicit VisibleSurface(const TriangleMesh& mesh,
                          TextureSource texture = TextureSource::automatic,
                          std::uint64_t texture_seed = 1,
                          ShadingNormals normals = ShadingNormals::estimated);
  // All parts together; where several are equally near, the first is seen.
  explicit VisibleSurface(std::span<const VisibleSurface> parts);

  // Rows in parallel. May be called from several threads at once. Without `with_color` the view's
  // color is empty.
  SurfaceView view(const ViewRays& rays, const Pose& world_from_camera,
                   bool with_color = true) const;
  // The same of a camera that moves while it reads its rows one after the other; row -0.5 is the
  // upper border of the first.
  using PoseOfRow = std::function<Pose(double row)>;
  SurfaceView view(const ViewRays& rays, const PoseOfRow& world_from_camera,
                   bool with_color = true) const;

  // Of the first part.
  const RayCaster& caster() const;
  const TriangleMesh& mesh() const;  // with vertex normals

 private:
  struct Part;
  struct Seen;
  using Sink = std::function<void(std::size_t column, const Seen& seen)>;
  void view_row(std::span<const Eigen::Vector2d> rays, const Pose& world_from_camera,
                bool with_color, const Sink& sink) const;

  std::vector<std::shared_ptr<const Part>> parts_;
};

// Defaults: the Kinect v2's limits (0.5 to 4.5 m, whole millimeters) and the noise of the scans
// that this toolkit is tested on, 2 mm and 0.5 % of range.
struct DepthSensorOptions {
  double noise_m = 0.002;         // standard deviation along the ray at range 0 ...
  double noise_of_range = 0.005;  // ... and what it grows by, m a m of range
  double noise_of_square = 0.0;   // ... and of range squared, as of stereo cameras, 1/m
  double depth_offset_m = 0.0;    // added to every range
  double depth_step_m = 0.001;    // depths are multiples of it; 0: not rounded
  double near_m = 0.5;            // of the measured depth
  double far_m = 4.5;
  double max_incidence_deg = 80.0;  // surfaces seen flatter give nothing; 90: all give something
  double edge_gap_m = 0.05;         // a larger jump of depth within one pixel is an edge
  double flying_pixels = 0.35;      // share of the edge pixels that lie between front and back
  double edge_dropouts = 0.35;      // share of the edge pixels that give nothing

  void check() const;  // throws Error naming the first field that cannot be
};
void bind(ParameterTable& table, DepthSensorOptions& options);
// All but step and limits.
void bind_noise(ParameterTable& table, DepthSensorOptions& options);
// No noise, no losses, no rounding.
DepthSensorOptions ideal_depth_sensor(double near_m, double far_m);

struct DepthMeasurement {
  DepthImage depth;
  std::size_t measured = 0;  // pixels with a depth
  std::size_t edges = 0;     // pixels that see a jump of depth
  std::size_t flying = 0;    // of these, measured between front and back
};

// Grazing measurements are lost more and more over the last 10 degrees before max_incidence_deg.
DepthMeasurement measure_depth(const SurfaceView& view, const ViewRays& rays,
                               const DepthSensorOptions& options, std::uint64_t seed);

struct PhotoOptions {
  double vignetting = 0.25;  // how much darker the image's corners are, 0 to 1
  double color_noise = 2.0;  // standard deviation, of 255
};
void bind(ParameterTable& table, PhotoOptions& options);

// The photograph of the view: shaded texture, vignetting, noise drawn from `seed`.
ColorImage take_photo(const SurfaceView& view, const PhotoOptions& options, std::uint64_t seed);

}  // namespace libmap
