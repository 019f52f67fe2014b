#include "libmap/refine/frame_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace libmap {

namespace {

// The plane of depth that a feature's ray meets where depth lies otherwise to color than the
// surface's camera has it; false where there is none.
bool plane_at(const FrameFeatures& frame, const Feature& feature, SurfaceElement& element) {
  if (feature.camera >= frame.surfaces.size()) return false;
  const DepthSurface& surface = frame.surfaces[feature.camera];
  const Pose color_from_depth =
      frame.cameras[feature.camera].base_from_camera.inverse() * surface.camera().base_from_camera;
  const Eigen::Vector3d ray = feature.ray.cast<double>().homogeneous();
  double depth = static_cast<double>(feature.depth_m);
  // Where the ray meets the plane is where the plane is to be looked for.
  for (int round = 0; round < 4; ++round) {
    if (!surface.seen_at(color_from_depth.inverse() * (depth * ray), element)) return false;
    element.point = color_from_depth * element.point;
    element.normal = color_from_depth.linear() * element.normal;
    const double facing = element.normal.dot(ray);
    if (!(facing < -0.1 * ray.norm())) return false;
    const double met = element.normal.dot(element.point) / facing;
    if (!(std::abs(met - depth) < 0.2)) return false;
    depth = met;
  }
  element.point = depth * ray;
  return true;
}

DepthCorrection correction_for(const std::vector<FrameFeatures>& frames, std::size_t camera,
                               double knot_m) {
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = 0.0F;
  for (const FrameFeatures& frame : frames)
    for (const Feature& feature : frame.features)
      if (feature.camera == camera) {
        nearest = std::min(nearest, feature.depth_m);
        farthest = std::max(farthest, feature.depth_m);
      }
  DepthCorrection correction;
  if (!(farthest > nearest)) return correction;
  const double reach = static_cast<double>(farthest) - static_cast<double>(nearest);
  const double pieces = std::clamp(std::ceil(reach / knot_m), 1.0, 100.0);
  correction.first_m = static_cast<double>(nearest);
  correction.step_m = reach / pieces;
  correction.spline_m.assign(static_cast<std::size_t>(pieces) + 3, 0.0);
  return correction;
}

}  // namespace

Eigen::Vector2f moved_ray(const Feature& feature, const Camera& camera,
                          const IntrinsicsStep& step) {
  const Eigen::Vector2d ray = feature.ray.cast<double>();
  return Eigen::Vector2d((camera.fx * ray.x() - step.cx_px) / (camera.fx * (1.0 + step.fx_share)),
                         (camera.fy * ray.y() - step.cy_px) / (camera.fy * (1.0 + step.fy_share)))
      .cast<float>();
}

double squared_radius_of(const Feature& feature, const Camera& camera) {
  const Eigen::Vector2d pixel = distort_to_pixel(camera, feature.ray.cast<double>());
  return squared_image_radius(camera.width, camera.height, pixel.x(), pixel.y());
}

// The plane n p = h turned by w and shifted by t about the color camera is met by the ray r at
// z = (h + n t) / (n r + w (n x r)).
std::array<double, 6> depth_by_registration(const FrameFeatures& frame, const Feature& feature) {
  SurfaceElement element;
  if (!plane_at(frame, feature, element)) return {};
  const Eigen::Vector3d ray = feature.ray.cast<double>().homogeneous();
  const double facing = element.normal.dot(ray);
  const Eigen::Vector3d by_shift = element.normal / facing;
  const Eigen::Vector3d by_turn = -element.point.z() / facing * element.normal.cross(ray);
  return {by_shift.x(), by_shift.y(), by_shift.z(), by_turn.x(), by_turn.y(), by_turn.z()};
}

std::vector<DepthCorrection> corrections_for(const std::vector<FrameFeatures>& frames,
                                             std::size_t cameras, double knot_m) {
  std::vector<DepthCorrection> corrections;
  for (std::size_t n = 0; n < cameras; ++n)
    corrections.push_back(correction_for(frames, n, knot_m));
  return corrections;
}

Camera moved(Camera camera, const IntrinsicsStep& step) {
  camera.fx *= 1.0 + step.fx_share;
  camera.fy *= 1.0 + step.fy_share;
  camera.cx += step.cx_px;
  camera.cy += step.cy_px;
  return camera;
}

void move_intrinsics(FrameFeatures& frame, const std::vector<IntrinsicsStep>& steps) {
  for (Feature& feature : frame.features)
    feature.ray = moved_ray(feature, frame.cameras[feature.camera], steps[feature.camera]);
  for (std::size_t n = 0; n < frame.surfaces.size(); ++n) {
    // The depth image may have another size than the picture.
    const Camera& depth_camera = frame.surfaces[n].camera();
    IntrinsicsStep step = steps[n];
    step.cx_px *= static_cast<double>(depth_camera.width) / frame.cameras[n].width;
    step.cy_px *= static_cast<double>(depth_camera.height) / frame.cameras[n].height;
    frame.surfaces[n].set_camera(moved(depth_camera, step));
  }
  for (std::size_t n = 0; n < frame.cameras.size(); ++n)
    frame.cameras[n] = moved(frame.cameras[n], steps[n]);
}

void correct_depth(FrameFeatures& frame, const std::vector<DepthCorrection>& corrections) {
  for (Feature& feature : frame.features) {
    const auto z = static_cast<double>(feature.depth_m);
    const double radius2 = squared_radius_of(feature, frame.cameras[feature.camera]);
    const double corrected = z + corrections[feature.camera].at(z, radius2);
    if (corrected > 0.0) feature.depth_m = static_cast<float>(corrected);
  }
  for (std::size_t n = 0; n < frame.surfaces.size(); ++n) frame.surfaces[n].correct(corrections[n]);
}

void register_depth(FrameFeatures& frame, const std::vector<Pose>& color_from_depth) {
  // By how much the plane that the ray meets changes: features know their depth better than the
  // grid of planes does.
  std::vector<double> before(frame.features.size(), 0.0);
  SurfaceElement element;
  for (std::size_t n = 0; n < before.size(); ++n)
    if (plane_at(frame, frame.features[n], element)) before[n] = element.point.z();
  for (std::size_t n = 0; n < frame.surfaces.size(); ++n) {
    Camera camera = frame.surfaces[n].camera();
    camera.base_from_camera = camera.base_from_camera * color_from_depth[n];
    frame.surfaces[n].set_camera(camera);
  }
  for (std::size_t n = 0; n < before.size(); ++n) {
    Feature& feature = frame.features[n];
    if (before[n] > 0.0 && plane_at(frame, feature, element))
      feature.depth_m += static_cast<float>(element.point.z() - before[n]);
  }
}

}  // namespace libmap
