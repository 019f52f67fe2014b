// Samples points on the surface of a scene of primitive shapes, with exact normals and curvatures.
#pragma once

#include <cstdint>

#include "libmap/core/point_cloud.h"
#include "libmap/scenes/primitive_scene.h"

namespace libmap {

struct SceneSamplingOptions {
  double spacing_m = 0.005;  // > 0: mean spacing, i.e. one sample per spacing_m^2 of surface
  std::uint64_t count = 0;   // number of samples (within 2 %) instead of spacing_m; 0: not used
  double jitter = 0.3;       // 0 to 1: gaps of the stratified grid are up to (1 + jitter) spacing_m
  double noise_m = 0.0;      // standard deviation of a Gaussian displacement along the normal
  std::uint64_t seed = 1;
  std::uint64_t max_points = 20'000'000;  // maximum number of samples
};

struct SceneSamples {
  // Positions with noise. Normals and the fields shape, height, curvature_min and curvature_max
  // (see SurfaceTruth) are exact, for the positions without noise.
  PointCloud cloud;
  double spacing_m = 0.0;  // mean spacing of the samples
};

// Samples the visible surface uniformly by area: a jittered grid on the parametrization of each
// face. On flat faces, each square of side (1 + jitter) * spacing contains a point; on other faces,
// gaps may be wider by a few percent. Equal input yields equal bytes. Throws Error for an invalid
// scene, more than max_points visible points, or 10 max_points including hidden ones.
SceneSamples sample_scene(const PrimitiveScene& scene, const SceneSamplingOptions& options);

}  // namespace libmap
