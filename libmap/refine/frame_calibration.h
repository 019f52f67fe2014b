// What a frame's features and surfaces are when its cameras are others than the stored ones.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "libmap/image/depth_correction.h"
#include "libmap/refine/features.h"

namespace libmap {

// Steps away from a camera's own.
struct IntrinsicsStep {
  double fx_share = 0.0;  // of fx
  double fy_share = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
};
// The camera with the step; and all of a frame that its cameras made: rays of features, surfaces.
Camera moved(Camera camera, const IntrinsicsStep& step);
void move_intrinsics(FrameFeatures& frame, const std::vector<IntrinsicsStep>& steps);
// The frame as if its depth images had been corrected: features and surfaces.
void correct_depth(FrameFeatures& frame, const std::vector<DepthCorrection>& corrections);
// The frame as if depth had been taken from elsewhere than its registration to color claims.
void register_depth(FrameFeatures& frame, const std::vector<Pose>& color_from_depth);

// One feature's ray by the camera with the step.
Eigen::Vector2f moved_ray(const Feature& feature, const Camera& camera, const IntrinsicsStep& step);
// Where it lies in its image, as DepthCorrection takes it.
double squared_radius_of(const Feature& feature, const Camera& camera);
// Its depth by a small step (rigid_motion.h) of where depth is taken from, seen from the color
// camera. 0 where there is no plane behind it.
std::array<double, 6> depth_by_registration(const FrameFeatures& frame, const Feature& feature);

// No correction yet: knots for the depths of the features of each camera.
std::vector<DepthCorrection> corrections_for(const std::vector<FrameFeatures>& frames,
                                             std::size_t cameras, double knot_m);

}  // namespace libmap
