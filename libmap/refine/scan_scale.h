// The scale of refined poses. Pictures and depth cannot tell a scale error of depth from a larger
// scene, so that the scale is that of the depth camera unless known lengths or the odometry of a
// robot determine it.
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

// The distance between what two pixels of pictures show, measured in the field.
struct KnownLength {
  struct Place {
    int node = 0;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  };
  Place from;
  Place to;
  double length_m = 0.0;  // > 0
};

// NODE:X:Y-NODE:X:Y=METERS, as "12:320:240-31:100:200.5=1.5". Throws Error with the text as value.
KnownLength parse_known_length(const std::string& text);

// What lengths are to be multiplied by.
struct ScaleEstimate {
  double factor = 1.0;
  double deviation = 0.0;   // standard deviation of the factor
  std::size_t lengths = 0;  // that it rests on
  double chi_square = 0.0;  // of the lengths about it, per degree of freedom; 0 of a single one
};

// Throws Error naming a place that no frame has, that is outside its picture or without depth:
// known before the poses are.
void check_known_lengths(const std::vector<FrameFeatures>& frames,
                         const std::vector<KnownLength>& lengths);

// By least squares of the ratios. Each end has the noise of its plane of depth and of half a pixel;
// errors of the poses are not counted. `frames` are as stored, the calibration is applied to them.
// Throws Error naming a place that no frame has, that is outside its picture or without depth.
ScaleEstimate scale_by_lengths(const std::vector<FrameFeatures>& frames,
                               const SensorCalibration& calibration,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<KnownLength>& lengths);

// Of the motions that links of odometry measure, with their covariances. Nothing without such
// links.
std::optional<ScaleEstimate> scale_by_odometry(const std::vector<GraphLinkResult>& links,
                                               const std::map<int, Pose>& map_from_base);

// Positions about that of `fixed_node`, and depth after registration and correction, both of which
// are in units of the depth camera. `cameras` of the rig.
void apply_scale(double factor, int fixed_node, std::size_t cameras,
                 std::map<int, Pose>& map_from_base, SensorCalibration& calibration);

}  // namespace libmap
