// What a frame's features and surfaces are when its cameras are others than the stored ones.
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

// Steps away from a camera's own.
struct IntrinsicsStep {
  double fx_share = 0.0;  // of fx
  double fy_share = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
};

// When a camera takes what it stores as one frame. Rows of a picture are exposed one after the
// other, the middle row at the time of the frame's pose; depth is taken at one moment.
struct CameraTiming {
  double depth_delay_s = 0.0;  // depth after the picture's middle row, beyond what the stamps of
                               // both say (FrameFeatures::depth_later_s)
  double rolling_shutter_s = 0.0;  // from the first to the last row of the picture
};

// How cameras differ from the stored ones, of each camera of the rig; empty: they do not.
struct SensorCalibration {
  std::vector<IntrinsicsStep> intrinsics{};
  std::vector<DepthCorrection> depth{};
  std::vector<Pose> color_from_depth{};  // where registered depth was taken from
  std::vector<CameraTiming> timing{};
  // With timing only: how the base moves at each node, in its own frame: m/s, rad/s.
  std::map<int, Vector6d> motion{};

  bool empty() const {
    return intrinsics.empty() && depth.empty() && color_from_depth.empty() && timing.empty();
  }
};

// The frame as if it had been recorded with the calibration: features and surfaces.
void calibrate(FrameFeatures& frame, const SensorCalibration& calibration);

// The frame as if its depth camera had another noise.
void set_depth_noise(FrameFeatures& frame, const DepthNoise& before, const DepthNoise& after);

// Its cameras and features alone, without surfaces and descriptors.
FrameFeatures calibrated_features(const FrameFeatures& frame, const SensorCalibration& calibration);

// The camera with the step.
Camera moved(Camera camera, const IntrinsicsStep& step);

// Where the feature is in its image, as DepthCorrection takes it; and its row, from -0.5 (first) to
// 0.5 (last), of which the picture's exposure is a part of CameraTiming::rolling_shutter_s late.
double squared_radius_of(const Feature& feature, const Camera& camera);
double row_share_of(const Feature& feature, const Camera& camera);

// The motion of the base as the camera has it.
Vector6d motion_in_camera(const Camera& camera, const Vector6d& base_motion);
// Where registered depth is taken from, seen from the color camera when it sees the feature.
Pose color_from_depth_of(const FrameFeatures& frame, const Feature& feature,
                         const SensorCalibration& calibration);

// The depth of a feature if depth is taken from `color_from_depth`: what is added to that of the
// stored registration, and by a small step (rigid_motion.h) of the color camera's view of it. Not
// known, and 0, where there is no plane behind it: its depth is then of something else.
struct RegisteredDepth {
  bool known = false;
  double added_m = 0.0;
  Vector6d by_step = Vector6d::Zero();
};
inline constexpr float unknown_depth_m = 1.0F;  // standard deviation then
RegisteredDepth registered_depth(const FrameFeatures& frame, const Feature& feature,
                                 const Pose& color_from_depth);
// Whether there is a plane behind it by the stored registration; at edges there is none.
bool has_plane(const FrameFeatures& frame, const Feature& feature);

// Whether coefficients of the one are those of the other.
bool has_same_knots(const DepthCorrection& a, const DepthCorrection& b);

// No correction yet: knots for the depths of the features of each camera.
std::vector<DepthCorrection> corrections_for(const std::vector<FrameFeatures>& frames,
                                             std::size_t cameras, double knot_m);

}  // namespace libmap
