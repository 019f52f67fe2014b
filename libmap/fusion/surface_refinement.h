// Elements of a surface moved along their normals to where all views of their place together put
// it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/pose.h"
#include "libmap/fusion/depth_noise.h"
#include "libmap/fusion/depth_projection.h"
#include "libmap/fusion/surface_voxels.h"

namespace libmap {

// Which measurements count for an element.
struct SurfaceSearch {
  double disc_radius_m = 0.015;  // > 0: measurements this near along the surface are averaged
  double search_m = 0.01;        // >= 0: maximum error of an element along its normal
};

// Depths that differ more from an element's plane have no weight, at any distance, m.
double max_gate_m(const DepthSensor& sensor, const SurfaceSearch& search);
// Radius of the smallest disc.
inline constexpr double min_disc_pixels = 1.5;

// One camera of one frame, made ready.
struct RefinementView {
  std::uint32_t frame = 0;  // ascending; views of one frame count as one
  Camera depth_camera;
  Camera color_camera;
  std::vector<float> depth_m;  // 0 where there is no ray; four more than pixels
  float nearest_m = 0.0F;      // of these depths
  float farthest_m = 0.0F;
  ColorImage color;  // may be empty
  std::shared_ptr<const PixelRays> rays;
  Pose camera_from_grid = Pose::Identity();
};
RefinementView make_refinement_view(CameraView view, std::shared_ptr<const PixelRays> rays,
                                    const Pose& camera_from_grid, std::uint32_t frame);

struct RefinedElement {
  float shift_m = 0.0F;  // along the normal
  float expected_error_m = 0.0F;
  std::uint32_t frames = 0;   // that measured it
  float seen = 0.0F;          // views on whose central pixel it lies, by their cosine
  float seen_through = 0.0F;  // views that see beyond it there
  float missed = 0.0F;        // views that measured nothing around it, though within their range
  Color color{};
};

struct RefinedSurface {
  std::vector<SurfaceElement> elements;
  std::vector<RefinedElement> refined;  // one an element
  bool has_color = false;
};

// What the views measured of every element. `pose_error_m` >= 0 is the standard deviation of a
// whole frame along the normal. `each_group(add)` calls add(views) for all views, by frame: their
// order changes the result by rounding, their grouping and the number of threads do not. Elements
// in meters.
using AddViews = std::function<void(std::span<const RefinementView>)>;
RefinedSurface refine_surface(std::vector<SurfaceElement> elements, const DepthSensor& sensor,
                              const SurfaceSearch& search, double pose_error_m,
                              const std::function<void(const AddViews&)>& each_group);

// What one frame measured of an element: the mean height within its disc.
struct SurfaceObservation {
  std::uint32_t element = 0;
  std::uint32_t frame = 0;
  float height_m = 0.0F;     // over the element, along its normal
  float variance_m2 = 0.0F;  // by noise
};

// By element, then by view. The same for any number of threads.
std::vector<SurfaceObservation> observe_surface(std::span<const SurfaceElement> elements,
                                                std::span<const RefinementView> views,
                                                const DepthSensor& sensor,
                                                const SurfaceSearch& search);

}  // namespace libmap
