// Self-calibration of a scan's cameras: focal lengths, principal points, depth corrections,
// registration of depth to color, and timing.
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

// Data that a calibration is estimated from.
struct CalibrationInput {
  const std::vector<FrameFeatures>& frames;  // with the stored cameras
  const std::vector<FeatureLink>& links;
  const std::map<int, Pose>& map_from_base;
  const std::vector<GraphLinkResult>& graph_links;  // links of the pose graph except `links`
  const std::vector<GraphComponent>& components;
  BundleAdjustmentOptions options;
};

// Parts of a calibration; true: the part is estimated.
struct CalibrationParts {
  bool intrinsics = false;
  bool depth = false;
  bool registration = false;
  bool timing = false;

  bool operator==(const CalibrationParts&) const = default;
  std::string name() const;  // names joined by _, e.g. "intrinsics_depth"; empty for none
};
// Returns the parts that the calibration contains.
CalibrationParts parts_of(const SensorCalibration& calibration);

struct CalibrationChoice {
  CalibrationParts parts{true, true, true, true};  // parts that may be estimated
  bool only_if_better = true;  // require that held-out data (held_out.h) fit clearly better
  bool drop_unneeded = true;   // drop parts that do not clearly improve the fit
  // Estimate the registration in all cases. Required for depth with a coarse registration, because
  // other parts would absorb the error of this registration.
  bool keeps_registration = false;
  bool converge = true;     // iterate the best model to BundleAdjustmentOptions::tolerance
  SensorCalibration start;  // initial values; empty: the stored cameras
};

struct CalibrationEstimate {
  std::size_t frames = 0;             // number of frames used
  SensorCalibration calibration;      // empty: the stored calibration remains
  BundleAdjustmentResult adjustment;  // best model on these frames, without information
  HeldOutEvaluation held_out;         // change from the stored calibration to the best model
  std::vector<std::pair<std::string, HeldOutEvaluation>>
      evaluated_models;                                         // name and held_out of each model
  std::vector<std::pair<std::string, std::string>> impossible;  // models and the bounds they exceed
};

// Selects a model (set of parts) by bundle adjustments of at most 80 linked frames:
// 1. Timing alone, if the held-out data fit clearly better and adding all parts is no clear gain.
// 2. Otherwise, intrinsics, depth corrections and registration are estimated together, because a
//    false focal length absorbs depth errors; if this is not clearly better, intrinsics alone.
// 3. A part is dropped if the held-out data do not fit clearly worse without it.
// 4. Timing is added if the held-out data then fit clearly better.
// Throws Error if an option is out of range.
CalibrationEstimate estimate_calibration(const CalibrationInput& input,
                                         const CalibrationChoice& choice);

// Repeats the adjustment of the parts of `known` from their values, with `count` alternatives.
BundleAdjustmentResult vary_calibration(const CalibrationInput& input,
                                        const SensorCalibration& known, std::size_t count);

// Replaces the motions in `calibration` by motions of all frames with a pose, estimated with the
// timing of `calibration`. `fixes_poses` fixes the poses during the estimate. The initial values
// are the motions of `known`, if any. Changes nothing else in `calibration`.
void estimate_motions(const CalibrationInput& input, bool fixes_poses,
                      SensorCalibration& calibration, const SensorCalibration& known = {});

// Returns true if registration and timing of each camera differ by at most these bounds.
bool is_similar_registration(const SensorCalibration& a, const SensorCalibration& b, double shift_m,
                             double turn_rad, double time_s);

// Returns the first camera with the calibration applied, for a file. `image` is this camera at the
// size of the images, which may be smaller. `graph` contains the time stamps of the nodes.
CameraFile calibrated_camera(const Camera& stored, const Camera& image,
                             const SensorCalibration& calibration, const PoseGraph& graph);

// Returns one sentence per corrected error of a camera. `deviations` are standard deviations.
std::vector<std::string> findings(const SensorCalibration& calibration,
                                  const SensorCalibration& deviations,
                                  const std::vector<Camera>& cameras);

}  // namespace libmap
