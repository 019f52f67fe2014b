// Simulates a time-of-flight depth camera with a registered color camera that observes a mesh.
//
// First, a view without errors is rendered; then, sensor errors are applied. Each pixel has
// separate random numbers, so that the same seed yields the same image for any number of threads.
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

// Rays (x/z, y/z) through the pixels' centers and corners, row by row; NaN if there is no ray.
struct ViewRays {
  int width = 0;                         // image width, pixels
  int height = 0;                        // image height, pixels
  std::vector<Eigen::Vector2d> centers;  // width * height
  std::vector<Eigen::Vector2d> corners;  // (width + 1) * (height + 1); the first is at -0.5, -0.5
};
ViewRays make_view_rays(const Camera& camera);

// A view without sensor errors. Depth (z in the optical frame, m) is 0 if there is no surface.
struct SurfaceView {
  DepthImage depth;              // at pixel centers
  DepthImage corner_depth;       // at pixel corners, indexed as ViewRays::corners
  Image<float> incidence_cos;    // cosine of the angle between ray and normal at pixel centers
  Image<Eigen::Vector3f> color;  // 0 to 1; mean of the colors at the center (1/2) and corners (1/8)
};

// Source of colors. mesh: vertex colors; rock: rock_color(); automatic: mesh if its colors differ.
enum class TextureSource { automatic, mesh, rock };

// Source of the normals for shading: estimated from the mesh, or vertex normals of the mesh.
enum class ShadingNormals { estimated, per_vertex };

// Surface for rendering, shared by copies. Light is diffuse from above with a directional part.
class VisibleSurface {
 public:
  // Copies the mesh. Throws Error as RayCaster (ray_caster.h) does, and if `texture` or `normals`
  // require vertex colors or normals that the mesh does not have.
  explicit VisibleSurface(const TriangleMesh& mesh,
                          TextureSource texture = TextureSource::automatic,
                          std::uint64_t texture_seed = 1,
                          ShadingNormals normals = ShadingNormals::estimated);
  // Union of several surfaces. At equal depth, the first of them is visible.
  explicit VisibleSurface(std::span<const VisibleSurface> parts);

  // Renders a view on all threads; thread-safe. Without `with_color`, the view's color is empty.
  SurfaceView view(const ViewRays& rays, const Pose& world_from_camera,
                   bool with_color = true) const;
  // Renders a view with a pose per row (rolling shutter); row y begins at y - 0.5.
  using PoseOfRow = std::function<Pose(double row)>;
  SurfaceView view(const ViewRays& rays, const PoseOfRow& world_from_camera,
                   bool with_color = true) const;

  // Ray caster and mesh (with vertex normals) of the first surface of the union.
  const RayCaster& caster() const;
  const TriangleMesh& mesh() const;

 private:
  struct Part;
  struct Seen;
  using Sink = std::function<void(std::size_t column, const Seen& seen)>;
  void view_row(std::span<const Eigen::Vector2d> rays, const Pose& world_from_camera,
                bool with_color, const Sink& sink) const;

  std::vector<std::shared_ptr<const Part>> parts_;
};

// The noise at a range r is noise_m + noise_of_range r + noise_of_square r^2. Defaults: limits of
// the Kinect v2 (0.5 to 4.5 m, whole millimeters), and noise of 2 mm and 0.5 % of range.
struct DepthSensorOptions {
  double noise_m = 0.002;           // standard deviation along the ray: constant term
  double noise_of_range = 0.005;    // term proportional to range, m per m
  double noise_of_square = 0.0;     // term proportional to squared range (stereo cameras), 1/m
  double depth_offset_m = 0.0;      // offset added to every range
  double depth_step_m = 0.001;      // depth resolution; 0: depths are not rounded
  double near_m = 0.5;              // minimum measured depth
  double far_m = 4.5;               // maximum measured depth
  double max_incidence_deg = 80.0;  // maximum angle between ray and normal; 90: no limit
  double edge_gap_m = 0.05;         // edge pixel: a larger depth jump, or a corner without depth
  double flying_pixels = 0.35;      // fraction of edge pixels that mix foreground and background
  double edge_dropouts = 0.35;      // fraction of edge pixels without depth

  void check() const;  // throws Error if far_m <= near_m or flying_pixels + edge_dropouts > 1
};
void bind(ParameterTable& table, DepthSensorOptions& options);
// Binds all fields except depth_step_m, near_m and far_m.
void bind_noise(ParameterTable& table, DepthSensorOptions& options);
// Returns options without noise, losses and rounding.
DepthSensorOptions ideal_depth_sensor(double near_m, double far_m);

struct DepthMeasurement {
  DepthImage depth;          // m; 0: no measurement
  std::size_t measured = 0;  // number of pixels with a depth
  std::size_t edges = 0;     // number of edge pixels (edge_gap_m)
  std::size_t flying = 0;    // number of edge pixels measured between foreground and background
};

// Applies sensor errors to a view. The probability of a missing depth rises linearly from 0 to 1 in
// the last 10 degrees before max_incidence_deg.
DepthMeasurement measure_depth(const SurfaceView& view, const ViewRays& rays,
                               const DepthSensorOptions& options, std::uint64_t seed);

struct PhotoOptions {
  double vignetting = 0.25;  // 0 to 1: relative loss of brightness in the corners
  double color_noise = 2.0;  // standard deviation of noise, for values from 0 to 255
};
void bind(ParameterTable& table, PhotoOptions& options);

// Returns a photograph of a view: its color with vignetting and noise drawn from `seed`.
ColorImage take_photo(const SurfaceView& view, const PhotoOptions& options, std::uint64_t seed);

}  // namespace libmap
