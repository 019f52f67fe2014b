// Moves surface elements along their normals to the mean of all views (second pass of fusion).
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

// Region around an element from which measurements are used.
struct SurfaceSearch {
  double disc_radius_m = 0.015;  // > 0: radius of the disc in which measurements are averaged
  double search_m = 0.01;        // >= 0: maximum distance of an element from the true surface
};

// Returns the maximum difference between a used depth and an element's plane, over all ranges, m.
double max_gate_m(const DepthSensor& sensor, const SurfaceSearch& search);
// Minimum radius of a disc, in pixels at the depth of the element.
inline constexpr double min_disc_pixels = 1.5;

// One camera of one frame, prepared for refinement.
struct RefinementView {
  std::uint32_t frame = 0;  // number of the frame
  Camera depth_camera;
  Camera color_camera;
  std::vector<float> depth_m;  // 0 for pixels without a ray; four entries of padding at the end
  float nearest_m = 0.0F;      // minimum measured depth
  float farthest_m = 0.0F;     // maximum measured depth
  ColorImage color;            // may be empty
  std::shared_ptr<const PixelRays> rays;
  Pose camera_from_grid = Pose::Identity();
};
RefinementView make_refinement_view(CameraView view, std::shared_ptr<const PixelRays> rays,
                                    const Pose& camera_from_grid, std::uint32_t frame);

struct RefinedElement {
  float shift_m = 0.0F;           // along the normal
  float expected_error_m = 0.0F;  // standard deviation along the normal
  std::uint32_t frames = 0;       // number of frames that measured the element
  // Sums over views of the cosine of incidence:
  float seen = 0.0F;          // views whose depth at the element's pixel agrees with the element
  float seen_through = 0.0F;  // views whose depth there is behind the element
  float missed = 0.0F;        // views without depth there, although the element is in range
  Color color{};
};

struct RefinedSurface {
  std::vector<SurfaceElement> elements;
  std::vector<RefinedElement> refined;  // one per element
  bool has_color = false;
};

// Refines the elements, in meters, with all views. `pose_error_m` >= 0 is the standard deviation of
// a frame's position along the normal. `each_group(add)` must call add(views) for groups of views
// until all views were added, in the order of frames. The order of frames affects the result by
// rounding only; the number of threads does not.
using AddViews = std::function<void(std::span<const RefinementView>)>;
RefinedSurface refine_surface(std::vector<SurfaceElement> elements, const DepthSensor& sensor,
                              const SurfaceSearch& search, double pose_error_m,
                              const std::function<void(const AddViews&)>& each_group);

// Mean height of one frame's measurements in the disc around an element.
struct SurfaceObservation {
  std::uint32_t element = 0;  // index of the element
  std::uint32_t frame = 0;    // RefinementView::frame
  float height_m = 0.0F;      // above the element, along the normal
  float variance_m2 = 0.0F;   // variance of height_m due to noise
};

// Measures the height of the surface above each element (in meters) in each view. Returns the
// observations by element, then by view.
std::vector<SurfaceObservation> observe_surface(std::span<const SurfaceElement> elements,
                                                std::span<const RefinementView> views,
                                                const DepthSensor& sensor,
                                                const SurfaceSearch& search);

}  // namespace libmap
