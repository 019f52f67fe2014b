// Determines the scale of refined poses. Images and depth do not reveal a depth scale error, so the
// depth camera sets the scale unless known lengths or the odometry of a robot determine it.
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

// Distance, measured in the field, between two points that are given as pixels of images.
struct KnownLength {
  struct End {
    int node = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  };
  End from;
  End to;
  double length_m = 0.0;  // > 0: true length
};

// Parses NODE:X:Y-NODE:X:Y=METERS with pixels X:Y of the first camera, e.g.
// "12:320:240-31:100:200.5=1.5". Throws Error for any other text.
KnownLength parse_known_length(const std::string& text);

// Factor by which all lengths must be multiplied.
struct ScaleEstimate {
  double factor = 1.0;
  double deviation = 0.0;   // standard deviation of the factor
  std::size_t lengths = 0;  // number of measurements used
  double chi_square = 0.0;  // of the measurements, per degree of freedom; 0 for one or for odometry
};

// Checks the ends of known lengths before poses are estimated. Throws Error if an end's node has no
// frame, or if its pixel is outside the image or without depth.
void check_known_lengths(const std::vector<FrameFeatures>& frames,
                         const std::vector<KnownLength>& lengths);

// Estimates the scale by least squares of the ratios of true and estimated lengths. Each end has
// the noise of the depth plane and of half a pixel; errors of the poses are neglected. `frames`
// have the stored calibration; `calibration` is applied to them. Throws Error as
// check_known_lengths does, if an end's node has no pose, and if the estimated length is less than
// three times its standard deviation.
ScaleEstimate scale_by_lengths(const std::vector<FrameFeatures>& frames,
                               const SensorCalibration& calibration,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<KnownLength>& lengths);

// Estimates the scale from the translations of accepted odometry links (LinkType::neighbor) and
// their information. Returns nullopt if these links do not determine a scale.
std::optional<ScaleEstimate> scale_by_odometry(const std::vector<GraphLinkResult>& links,
                                               const std::map<int, Pose>& map_from_base);

// Scales positions about the position of `fixed_node` (the origin if it has no pose), and
// DepthCorrection::scale of all `cameras` in `calibration`.
void apply_scale(double factor, int fixed_node, std::size_t cameras,
                 std::map<int, Pose>& map_from_base, SensorCalibration& calibration);

}  // namespace libmap
