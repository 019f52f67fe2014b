// Focal lengths, principal points and depth corrections of a scan's cameras from the scan itself.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libmap/image/camera_io.h"
#include "libmap/refine/bundle_adjustment.h"
#include "libmap/refine/held_out.h"

namespace libmap {

// How the cameras differ from the stored ones, of each camera of the rig; empty: they do not.
struct SensorCalibration {
  std::vector<IntrinsicsStep> intrinsics;
  std::vector<DepthCorrection> depth;
  std::vector<Pose> color_from_depth;  // where registered depth was taken from

  bool empty() const { return intrinsics.empty() && depth.empty() && color_from_depth.empty(); }
};
// The frame as if it had been recorded with the calibration.
void calibrate(FrameFeatures& frame, const SensorCalibration& calibration);

// What may be estimated, and whether only if it fits clearly better.
struct CalibrationChoice {
  bool intrinsics = true;
  bool depth = true;
  bool registration = true;
  bool only_if_better = true;
  bool leave_out = true;               // what is not needed
  std::vector<Pose> color_from_depth;  // where the search for it begins; empty: at the identity
};

struct CalibrationEstimate {
  std::size_t frames = 0;             // that it rests on
  SensorCalibration calibration;      // empty: what is stored stays
  BundleAdjustmentResult adjustment;  // of those frames, with the best that was tried
  HeldOutEvaluation held_out;         // of those frames: as they were, and adjusted so
  std::vector<std::pair<std::string, HeldOutEvaluation>> tried;  // each model, as it changes them
};

// Bundle adjustments with free intrinsics, depth corrections and registration of depth to color.
// Together first, since a false focal length absorbs errors of depth; where that fits what was held
// out clearly better, one after the other is left out again unless it fits clearly worse so; where
// it does not, intrinsics alone are tried. Of a long scan they are estimated from the `max_frames`
// frames that links join most closely to the one with most links: more do not tell them better than
// is needed, and the time does not grow with the scan. `links` join frames, `graph_links` are other
// links of the graph.
CalibrationEstimate estimate_calibration(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureLink>& links,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& graph_links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options,
    const CalibrationChoice& choice, std::size_t max_frames = 80);

// The n-th of the cameras as it is known by the calibration, for a file; `picture` is that of its
// pictures.
CameraFile calibrated_camera(const Camera& stored, const Camera& picture,
                             const SensorCalibration& calibration, std::size_t n);

// One sentence for each thing that was found wrong and corrected.
std::vector<std::string> findings(const SensorCalibration& calibration,
                                  const std::vector<Camera>& cameras);

}  // namespace libmap
