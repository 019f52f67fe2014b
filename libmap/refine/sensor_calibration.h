// Focal lengths, principal points, depth corrections, registration of depth to color and timing of
// a scan's cameras from the scan itself.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libmap/camera/camera_io.h"
#include "libmap/core/pose_graph.h"
#include "libmap/features/held_out.h"
#include "libmap/optimize/bundle_adjustment.h"

namespace libmap {

// What a calibration is estimated from.
struct CalibrationInput {
  const std::vector<FrameFeatures>& frames;  // with the stored cameras
  const std::vector<FeatureLink>& links;
  const std::map<int, Pose>& map_from_base;
  const std::vector<GraphLinkResult>& graph_links;  // other links than those of features
  const std::vector<GraphComponent>& components;
  BundleAdjustmentOptions options;
};

// Parts of a calibration: which are estimated.
struct CalibrationParts {
  bool intrinsics = false;
  bool depth = false;
  bool registration = false;
  bool timing = false;

  bool operator==(const CalibrationParts&) const = default;
  std::string name() const;  // "intrinsics_depth"; empty for none
};
// The parts that a calibration has.
CalibrationParts parts_of(const SensorCalibration& calibration);

struct CalibrationChoice {
  CalibrationParts parts{true, true, true, true};  // that may be estimated
  bool only_if_better = true;                      // if the held-out data fit clearly better
  bool leave_out = true;                           // drop parts that are not needed
  bool settle = true;       // the best to the tolerance of the options, not only as far as models
                            // are compared
  SensorCalibration start;  // where the search for registration and timing begins
};

struct CalibrationEstimate {
  std::size_t frames = 0;             // that it rests on
  SensorCalibration calibration;      // empty: what is stored stays
  BundleAdjustmentResult adjustment;  // of those frames, with the best tried; without information
  HeldOutEvaluation held_out;         // of those frames: as they were, and with the best model
  std::vector<std::pair<std::string, HeldOutEvaluation>> tried;  // the same of each model
  std::vector<std::pair<std::string, std::string>> impossible;   // models, and their exceeded bound
};

// Bundle adjustments with free intrinsics, depth corrections and registration of depth to color,
// all together at first, since a false focal length absorbs errors of depth. If that fits the
// held-out data clearly better, each of them is left out again unless the fit becomes clearly
// worse; if not, intrinsics alone are tried. Timing needs a motion for each frame, so it is tried
// last. A long scan is represented by the 80 frames that links join most closely to the one with
// most links: more frames do not improve the estimate.
CalibrationEstimate estimate_calibration(const CalibrationInput& input,
                                         const CalibrationChoice& choice);

// Repeats the calibration `known` from its values, with `count` alternatives.
BundleAdjustmentResult vary_calibration(const CalibrationInput& input,
                                        const SensorCalibration& known, std::size_t count);

// The motions of all frames with a pose at the timing of a calibration, in place of those of the
// frames that it rests on. The rest of the calibration stays.
void find_motions(const CalibrationInput& input, bool hold_poses, SensorCalibration& calibration);

// Whether registrations and timings of all cameras differ by no more than this.
bool takes_depth_from_near(const SensorCalibration& a, const SensorCalibration& b, double shift_m,
                           double turn_rad, double time_s);

// The first camera with the calibration, for a file; `picture` is the camera of its pictures,
// `graph` has the stamps of the nodes.
CameraFile calibrated_camera(const Camera& stored, const Camera& picture,
                             const SensorCalibration& calibration, const PoseGraph& graph);

// One sentence for each thing that was found wrong and corrected; `deviations` as
// BundleAdjustmentResult::deviations.
std::vector<std::string> findings(const SensorCalibration& calibration,
                                  const SensorCalibration& deviations,
                                  const std::vector<Camera>& cameras);

}  // namespace libmap
