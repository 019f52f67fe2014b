#include "libmap/features/frame_calibration.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace libmap {

namespace {

constexpr double plane_radius_px = 3.0;       // radius of the disc to which a plane is fitted
constexpr double unmeasured_fraction = 0.01;  // ignored share of the depths at either end

// Finds the depth plane that a feature's ray intersects if the depth camera is at
// `color_from_depth`. Returns false if there is none.
bool plane_at(const FrameFeatures& frame, const Feature& feature, const Pose& color_from_depth,
              SurfacePatch& element) {
  if (feature.camera >= frame.surfaces.size()) return false;
  const DepthSurface& surface = frame.surfaces[feature.camera];
  const Pose seen_from = color_from_depth *
                         frame.cameras[feature.camera].base_from_camera.inverse() *
                         surface.camera().base_from_camera;
  const Pose from_seen = seen_from.inverse();
  const Eigen::Vector3d ray = feature.ray.cast<double>().homogeneous();
  double depth = static_cast<double>(feature.depth_m);
  // The lookup needs the intersection of ray and plane, which is found by iteration.
  for (int round = 0; round < 4; ++round) {
    if (!surface.interpolated_at(from_seen * (depth * ray), element)) return false;
    element.point = seen_from * element.point;
    element.normal = seen_from.linear() * element.normal;
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
  std::vector<float> depths;
  for (const FrameFeatures& frame : frames)
    for (const Feature& feature : frame.features)
      if (feature.camera == camera) depths.push_back(feature.depth_m);
  DepthCorrection correction;
  if (depths.empty()) return correction;
  const auto quantile = [&](double fraction) {
    const auto at = depths.begin() +
                    static_cast<std::ptrdiff_t>(fraction * static_cast<double>(depths.size() - 1));
    std::nth_element(depths.begin(), at, depths.end());
    return *at;
  };
  const float nearest = quantile(unmeasured_fraction);
  const float farthest = quantile(1.0 - unmeasured_fraction);
  if (!(farthest > nearest)) return correction;
  const double reach = static_cast<double>(farthest) - static_cast<double>(nearest);
  const double pieces = std::clamp(std::ceil(reach / knot_m), 1.0, 100.0);
  correction.first_m = static_cast<double>(nearest);
  correction.step_m = reach / pieces;
  correction.spline_m.assign(static_cast<std::size_t>(pieces) + 3, 0.0);
  return correction;
}

Eigen::Vector2f moved_ray(const Feature& feature, const Camera& camera,
                          const IntrinsicsStep& step) {
  const Eigen::Vector2d ray = feature.ray.cast<double>();
  return Eigen::Vector2d(
             (camera.fx * ray.x() - step.cx_px) / (camera.fx * (1.0 + step.fx_relative)),
             (camera.fy * ray.y() - step.cy_px) / (camera.fy * (1.0 + step.fy_relative)))
      .cast<float>();
}

void register_surfaces(FrameFeatures& frame, const SensorCalibration& calibration) {
  for (std::size_t n = 0; n < frame.surfaces.size(); ++n) {
    Camera camera = frame.surfaces[n].camera();
    if (n < calibration.color_from_depth.size())
      camera.base_from_camera = camera.base_from_camera * calibration.color_from_depth[n];
    const auto motion = calibration.motion.find(frame.node);
    if (n < calibration.timing.size() && motion != calibration.motion.end())
      camera.base_from_camera =
          moved(
              Pose::Identity(),
              (calibration.timing[n].depth_delay_s + frame.depth_stamp_offset_s) * motion->second) *
          camera.base_from_camera;
    frame.surfaces[n].set_camera(camera);
  }
}

void correct_depth(FrameFeatures& frame, const std::vector<DepthCorrection>& corrections) {
  for (Feature& feature : frame.features) {
    const auto z = static_cast<double>(feature.depth_m);
    const double radius2 = squared_radius_of(feature, frame.cameras[feature.camera]);
    const double corrected = z + corrections[feature.camera].at(z, radius2);
    if (corrected > 0.0) feature.depth_m = static_cast<float>(corrected);
  }
}

// Motion of the camera from the frame's time to the exposure of each feature's row.
std::vector<Pose> row_motions(const FrameFeatures& frame, const SensorCalibration& calibration) {
  const auto motion = calibration.motion.find(frame.node);
  if (calibration.timing.empty() || motion == calibration.motion.end()) return {};
  std::vector<Pose> motions;
  for (const Feature& feature : frame.features) {
    const Camera& camera = frame.cameras[feature.camera];
    const double time_s =
        calibration.timing[feature.camera].rolling_shutter_s * row_fraction(feature, camera);
    motions.push_back(moved(Pose::Identity(), time_s * motion_in_camera(camera, motion->second)));
  }
  return motions;
}

void move_surfaces(FrameFeatures& frame, const std::vector<IntrinsicsStep>& steps) {
  for (std::size_t n = 0; n < frame.surfaces.size(); ++n) {
    // The depth image may differ in size from the color image.
    const Camera& depth_camera = frame.surfaces[n].camera();
    IntrinsicsStep step = steps[n];
    step.cx_px *= static_cast<double>(depth_camera.width) / frame.cameras[n].width;
    step.cy_px *= static_cast<double>(depth_camera.height) / frame.cameras[n].height;
    frame.surfaces[n].set_camera(moved(depth_camera, step));
  }
}

}  // namespace

Camera moved(Camera camera, const IntrinsicsStep& step) {
  camera.fx *= 1.0 + step.fx_relative;
  camera.fy *= 1.0 + step.fy_relative;
  camera.cx += step.cx_px;
  camera.cy += step.cy_px;
  return camera;
}

void set_depth_noise(FrameFeatures& frame, const DepthNoise& before, const DepthNoise& after) {
  for (Feature& feature : frame.features) {
    if (feature.depth_noise_m >= unknown_depth_m) continue;
    const auto z = static_cast<double>(feature.depth_m);
    feature.depth_noise_m *= static_cast<float>(after.axial_at(z) / before.axial_at(z));
  }
  for (DepthSurface& surface : frame.surfaces) surface.set_noise(before, after);
}

FrameFeatures calibrated_features(const FrameFeatures& frame,
                                  const SensorCalibration& calibration) {
  FrameFeatures result;
  result.node = frame.node;
  result.stamp_s = frame.stamp_s;
  result.depth_stamp_offset_s = frame.depth_stamp_offset_s;
  result.cameras = frame.cameras;
  result.features = frame.features;
  // Pixels refer to the stored camera.
  const std::vector<Pose> motions = row_motions(frame, calibration);
  if (!calibration.color_from_depth.empty() || !motions.empty())
    for (Feature& feature : result.features) {
      const RegisteredDepth depth =
          registered_depth(frame, feature, color_from_depth_of(frame, feature, calibration));
      feature.depth_m += static_cast<float>(depth.added_m);
      if (!depth.known) feature.depth_noise_m = unknown_depth_m;
    }
  if (!calibration.depth.empty()) correct_depth(result, calibration.depth);
  if (!calibration.intrinsics.empty()) {
    for (Feature& feature : result.features)
      feature.ray =
          moved_ray(feature, frame.cameras[feature.camera], calibration.intrinsics[feature.camera]);
    for (std::size_t n = 0; n < frame.cameras.size(); ++n)
      result.cameras[n] = moved(frame.cameras[n], calibration.intrinsics[n]);
  }
  for (std::size_t n = 0; n < motions.size(); ++n) {
    Feature& feature = result.features[n];
    const Eigen::Vector3d point =
        motions[n] * Eigen::Vector3d(static_cast<double>(feature.depth_m) *
                                     feature.ray.cast<double>().homogeneous());
    feature.ray = point.hnormalized().cast<float>();
    feature.depth_m = static_cast<float>(point.z());
  }
  return result;
}

void calibrate(FrameFeatures& frame, const SensorCalibration& calibration) {
  FrameFeatures calibrated = calibrated_features(frame, calibration);
  if (!calibration.color_from_depth.empty() || !calibration.timing.empty())
    register_surfaces(frame, calibration);
  for (std::size_t n = 0; n < std::min(frame.surfaces.size(), calibration.depth.size()); ++n)
    frame.surfaces[n].correct(calibration.depth[n]);
  if (!calibration.intrinsics.empty()) move_surfaces(frame, calibration.intrinsics);
  // Copied in place, because callers keep references to the elements.
  std::copy(calibrated.features.begin(), calibrated.features.end(), frame.features.begin());
  std::copy(calibrated.cameras.begin(), calibrated.cameras.end(), frame.cameras.begin());
}

double squared_radius_of(const Feature& feature, const Camera& camera) {
  const Eigen::Vector2d pixel = distort_to_pixel(camera, feature.ray.cast<double>());
  return squared_image_radius(camera.width, camera.height, pixel.x(), pixel.y());
}

double row_fraction(const Feature& feature, const Camera& camera) {
  const double row = distort_to_pixel(camera, feature.ray.cast<double>()).y();
  return row / std::max(1, camera.height - 1) - 0.5;
}

Vector6d motion_in_camera(const Camera& camera, const Vector6d& base_motion) {
  const Eigen::Matrix3d camera_from_base = camera.base_from_camera.linear().transpose();
  const Eigen::Vector3d turn = base_motion.tail<3>();
  Vector6d motion;
  motion << camera_from_base *
                (base_motion.head<3>() + turn.cross(camera.base_from_camera.translation())),
      camera_from_base * turn;
  return motion;
}

Pose color_from_depth_of(const FrameFeatures& frame, const Feature& feature,
                         const SensorCalibration& calibration) {
  Pose pose = Pose::Identity();
  if (feature.camera < calibration.color_from_depth.size())
    pose = calibration.color_from_depth[feature.camera];
  const auto motion = calibration.motion.find(frame.node);
  if (feature.camera >= calibration.timing.size() || motion == calibration.motion.end())
    return pose;
  const Camera& camera = frame.cameras[feature.camera];
  const CameraTiming& timing = calibration.timing[feature.camera];
  const double later_s = timing.depth_delay_s + frame.depth_stamp_offset_s -
                         timing.rolling_shutter_s * row_fraction(feature, camera);
  return moved(Pose::Identity(), later_s * motion_in_camera(camera, motion->second)) * pose;
}

// The ray r intersects the plane n p = h, rotated by w and translated by t about the color camera,
// at z = (h + n t) / (n r + w (n x r)).
RegisteredDepth registered_depth(const FrameFeatures& frame, const Feature& feature,
                                 const Pose& color_from_depth) {
  SurfacePatch before;
  SurfacePatch element;
  RegisteredDepth depth;
  if (!plane_at(frame, feature, Pose::Identity(), before) ||
      !plane_at(frame, feature, color_from_depth, element))
    return depth;
  // For a small shift in the depth image, only the difference of both planes is added, since a
  // feature's own depth is more accurate than the grid. Planes at a larger shift share no pixels,
  // and the noise of both would add up.
  const Camera& camera = frame.cameras[feature.camera];
  const Eigen::Vector2d shift =
      (color_from_depth.inverse() * element.point).hnormalized() - before.point.hnormalized();
  const double common = std::max(0.0, 1.0 - camera.fx * shift.norm() / plane_radius_px);
  const auto depth_m = static_cast<double>(feature.depth_m);
  depth.known = true;
  depth.added_m = element.point.z() - depth_m + common * (depth_m - before.point.z());
  const Eigen::Vector3d ray = feature.ray.cast<double>().homogeneous();
  const double facing = element.normal.dot(ray);
  depth.by_step << element.normal / facing, -element.point.z() / facing * element.normal.cross(ray);
  return depth;
}

bool has_plane(const FrameFeatures& frame, const Feature& feature) {
  SurfacePatch element;
  return plane_at(frame, feature, Pose::Identity(), element);
}

bool has_same_knots(const DepthCorrection& a, const DepthCorrection& b) {
  return a.first_m == b.first_m && a.step_m == b.step_m && a.spline_m.size() == b.spline_m.size();
}

std::vector<DepthCorrection> corrections_for(const std::vector<FrameFeatures>& frames,
                                             std::size_t cameras, double knot_m) {
  std::vector<DepthCorrection> corrections;
  for (std::size_t n = 0; n < cameras; ++n)
    corrections.push_back(correction_for(frames, n, knot_m));
  return corrections;
}

}  // namespace libmap
