// Scale of refined poses. Images and depth do not reveal a depth scale error. The depth camera sets
// the scale unless known lengths or the odometry of a robot determine it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/features/frame_calibration.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// Distance between two points that are given as pixels of images, measured in the field.
struct KnownLength {
  struct End {
    int node = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  };
  End from;
  End to;
  double length_m = 0.0;  // > 0
};

// Parses NODE:X:Y-NODE:X:Y=METERS with pixels X:Y, e.g. "12:320:240-31:100:200.5=1.5". Throws Error
// with the text as value.
KnownLength parse_known_length(const std::string& text);

// Factor by which all lengths must be multiplied.
struct ScaleEstimate {
  double factor = 1.0;
  double deviation = 0.0;   // standard deviation of the factor
  std::size_t lengths = 0;  // number of measurements used
  double chi_square = 0.0;  // of the measurements, per degree of freedom; 0 for a single one
};

// Checks the ends of known lengths before poses are estimated. Throws Error naming an end with a
// node without frame, or with a pixel outside the image or without depth.
void check_known_lengths(const std::vector<FrameFeatures>& frames,
                         const std::vector<KnownLength>& lengths);

// Estimates the scale by least squares of the ratios of true and estimated lengths. Each end has
// the noise of the depth plane and of half a pixel; errors of the poses are neglected. `frames`
// have the stored calibration; `calibration` is applied to them. Throws the errors of
// check_known_lengths, and Error if a length is not longer than three standard deviations.
ScaleEstimate scale_by_lengths(const std::vector<FrameFeatures>& frames,
                               const SensorCalibration& calibration,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<KnownLength>& lengths);

// Estimates the scale from links of odometry and covariances of links. Returns nullopt without such
// links.
std::optional<ScaleEstimate> scale_by_odometry(const std::vector<GraphLinkResult>& links,
                                               const std::map<int, Pose>& map_from_base);

// Scales positions about the position of `fixed_node`, and the calibration so that depth after
// registration and correction is multiplied by `factor`. `cameras`: number in the rig.
void apply_scale(double factor, int fixed_node, std::size_t cameras,
                 std::map<int, Pose>& map_from_base, SensorCalibration& calibration);

}  // namespace libmap
