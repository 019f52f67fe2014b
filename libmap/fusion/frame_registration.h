// Corrects poses of depth frames so that the surfaces of the frames agree. Private to depth_fusion.
// A height is the distance of a frame's surface from a surface element, along the normal.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/fusion/surface_refinement.h"

namespace libmap {

struct FrameRegistrationOptions {
  // > 0: standard deviations of the given poses.
  double position_error_m = 0.02;
  double rotation_error_deg = 1.0;
  // > 0: heights that differ by more than this from the heights of other frames have less weight.
  double scatter_m = 0.005;
  // > 0: mean number of observations per frame above which all weights are reduced in proportion.
  // Limits the weight of heights against the given poses, because with noisy normals, motions along
  // a plane seem to improve the fit.
  double independent_heights = 150.0;
};

struct FrameRegistration {
  std::vector<Pose> corrected_from_given;  // one per frame, in the elements' frame
  // Weighted RMS of frames' heights about the mean height of each element, with given poses.
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;  // with corrected poses, to first order
  double correction_m = 0.0;          // RMS change of the heights
};

// Estimates small rotations and shifts of all frames jointly. They minimize the weighted squares of
// the heights about each element's mean height (point to plane, Chen and Medioni 1991; all views
// jointly, Bergevin et al. 1996), by conjugate gradients with robust weights (Geman and McClure
// 1987). `centers` are the frames' centers of rotation. Elements and centers are in meters.
// `observations` must be sorted by element.
FrameRegistration register_frames(std::span<const SurfaceElement> elements,
                                  std::span<const SurfaceObservation> observations,
                                  std::span<const Eigen::Vector3d> centers,
                                  const FrameRegistrationOptions& options = {});

}  // namespace libmap
