// Poses of depth frames corrected so that what the frames measured of a surface agrees. Inner part
// of depth_fusion.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/fusion/surface_refinement.h"

namespace libmap {

struct FrameRegistrationOptions {
  // > 0: standard deviations of the poses as they are given.
  double place_error_m = 0.02;
  double rotation_error_deg = 1.0;
  // > 0: frames that differ from the others by more than this have less weight.
  double scatter_m = 0.005;
  // > 0: heights of a frame, on the mean, that count as independent, however many there are.
  // Against the errors of the poses: normals of a plane scatter a little, and a frame slid along it
  // would seem to fit better.
  double independent_heights = 150.0;
};

struct FrameRegistration {
  std::vector<Pose> corrected_from_given;  // one a frame, in the elements' frame
  // Root mean square of frames' heights about their elements' means, by weight.
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;  // to first order
  double correction_m = 0.0;          // root mean square of what heights change by
};

// All frames at once: turns and shifts, small, that minimize the weighted squares of the heights
// about each element's own mean (point to plane, Chen and Medioni 1991; all views jointly, Bergevin
// et al. 1996), by conjugate gradients. Robust by weights after Geman and McClure (1987). Elements
// in meters; `centers` are where the frames turn about. The same for any number of threads.
FrameRegistration register_frames(std::span<const SurfaceElement> elements,
                                  std::span<const SurfaceObservation> observations,
                                  std::span<const Eigen::Vector3d> centers,
                                  const FrameRegistrationOptions& options = {});

}  // namespace libmap
