// Recomputes a frame's features and surfaces for a changed camera calibration.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <map>
#include <vector>

#include "libmap/camera/depth_correction.h"
#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

// Change of a camera's intrinsics.
struct IntrinsicsStep {
  double fx_relative = 0.0;  // change of fx divided by fx
  double fy_relative = 0.0;  // change of fy divided by fy
  double cx_px = 0.0;        // change of cx
  double cy_px = 0.0;
};

// Times of exposure within a frame. Image rows are exposed one after the other, the middle row at
// the time of the frame's pose. All depth is measured at one time.
struct CameraTiming {
  double depth_delay_s = 0.0;      // delay of the depth relative to the middle image row, in
                                   // addition to FrameFeatures::depth_stamp_offset_s
  double rolling_shutter_s = 0.0;  // time from the first to the last image row
};

// Differences from the stored calibration, one element per camera of the rig; empty: no difference.
struct SensorCalibration {
  std::vector<IntrinsicsStep> intrinsics{};
  std::vector<DepthCorrection> depth{};
  std::vector<Pose> color_from_depth{};  // true pose of depth camera relative to its stored pose
  std::vector<CameraTiming> timing{};
  // Used only with `timing`: velocity of the base by node, in the base frame, m/s and rad/s.
  std::map<int, Vector6d> motion{};

  bool empty() const {
    return intrinsics.empty() && depth.empty() && color_from_depth.empty() && timing.empty();
  }
};

// Applies the calibration to the features, surfaces and cameras of a frame.
void calibrate(FrameFeatures& frame, const SensorCalibration& calibration);

// Rescales the depth noise of features and surfaces from the model `before` to `after`.
void set_depth_noise(FrameFeatures& frame, const DepthNoise& before, const DepthNoise& after);

// Returns a calibrated copy of the frame's cameras and features, without surfaces.
FrameFeatures calibrated_features(const FrameFeatures& frame, const SensorCalibration& calibration);

// Returns the camera with changed intrinsics.
Camera moved(Camera camera, const IntrinsicsStep& step);

// Returns the squared distance of a feature from the image center, 1 at the corner pixels.
double squared_radius_of(const Feature& feature, const Camera& camera);
// Returns the fraction f of a feature's image row, from -0.5 (first row) to 0.5 (last row). The row
// is exposed f * CameraTiming::rolling_shutter_s after the middle row.
double row_fraction(const Feature& feature, const Camera& camera);

// Converts a velocity of the base (base frame, m/s, rad/s) to that of the camera (optical frame).
Vector6d motion_in_camera(const Camera& camera, const Vector6d& base_motion);
// Returns the depth camera's pose relative to the color camera at the exposure of the feature.
Pose color_from_depth_of(const FrameFeatures& frame, const Feature& feature,
                         const SensorCalibration& calibration);

// Change of a feature's depth if the depth camera is at `color_from_depth` instead of its stored
// pose relative to the color camera.
struct RegisteredDepth {
  bool known = false;    // false, and values 0: no depth plane is on the ray of the feature
  double added_m = 0.0;  // change of the depth
  // Derivative of the depth by s in moved(Pose::Identity(), s) * color_from_depth (rigid_motion.h).
  Vector6d by_step = Vector6d::Zero();
};
inline constexpr float unknown_depth_m = 1.0F;  // standard deviation of an unknown depth, m
RegisteredDepth registered_depth(const FrameFeatures& frame, const Feature& feature,
                                 const Pose& color_from_depth);
// Returns true if the feature is on a plane of the depth image as stored; false at depth edges.
bool has_plane(const FrameFeatures& frame, const Feature& feature);

// Returns true if the splines of a and b have equal knots, so that coefficients can be exchanged.
bool has_same_knots(const DepthCorrection& a, const DepthCorrection& b);

// Returns zero corrections, one per camera. The knots cover the depths of the camera's features
// from the 1st to the 99th percentile, in at most 100 equal intervals, of at most `knot_m` if 100
// suffice. A correction is empty if the camera's depths are equal or there are none.
std::vector<DepthCorrection> corrections_for(const std::vector<FrameFeatures>& frames,
                                             std::size_t cameras, double knot_m);

}  // namespace libmap
