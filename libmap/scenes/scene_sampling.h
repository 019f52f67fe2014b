// Points on a scene of primitive shapes, with the truth of each.
#pragma once

#include <cstdint>

#include "libmap/core/point_cloud.h"
#include "libmap/scenes/primitive_scene.h"

namespace libmap {

struct SceneSamplingOptions {
  double spacing_m = 0.005;  // one sample per square of this side, on average
  std::uint64_t count = 0;   // if not 0, the spacing is chosen to give about so many (2 %)
  double jitter = 0.3;       // of the stratified grid, 0 to 1: gaps are up to (1 + jitter) spacing
  double noise_m = 0.0;      // standard deviation of a Gaussian shift along the normal
  std::uint64_t seed = 1;
  std::uint64_t max_points = 20'000'000;  // more is an Error
};

struct SceneSamples {
  // Positions (with noise), true normals and the fields shape, height, curvature_min and
  // curvature_max of SurfaceTruth, which are those of the point before noise.
  PointCloud cloud;
  double spacing_m = 0.0;  // as used
};

// Samples of the visible surface, even by area: a jittered grid on the parametrization of each
// face. On flat faces every square of side (1 + jitter) * spacing holds a point; elsewhere rounding
// to whole rows can widen gaps by a few percent. Equal input gives equal bytes.
SceneSamples sample_scene(const PrimitiveScene& scene, const SceneSamplingOptions& options);

}  // namespace libmap
