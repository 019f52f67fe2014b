// One maximal set of Poisson-disk samples of a given radius. Inner part of libmap/mesh.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_fragments.h"

namespace libmap {

struct SampledSurface {
  const TriangleMesh& mesh;  // its vertices finite
  Eigen::Vector3d low;       // corner of its bounding box
  SurfacePieces triangles;
  double area_m2 = 0.0;  // > 0
  // Positions are rounded to single precision, which moves them so far at most; 0: they are not.
  double rounding_m = 0.0;
  // Samples of other surfaces: no sample is nearer to them, and what they cover needs none.
  std::vector<Eigen::Vector3d> others{};
};

struct DiskSamples {
  std::vector<Eigen::Vector3d> positions;
  std::vector<TrianglePoint> places;  // of the positions before they were rounded
};

// Of saturated random discs in the plane: samples times squared radius over area (discs of half the
// radius cover 0.547 of it).
inline constexpr double saturation_density = 0.6965;
// Share of them that darts over the whole surface find before gaps are looked for, about.
inline constexpr double share_of_darts = 0.808;

// Darts over the whole surface, then, if goes_on(samples so far), into the gaps; else the samples
// are not maximal. Throws Error if the mesh is too large for the radius.
DiskSamples sample_disks(const SampledSurface& surface, double radius_m, std::uint64_t seed,
                         const std::function<bool(std::size_t thrown)>& goes_on,
                         Progress& progress);

// The smallest distance of two positions, at least one pair of which is expected near
// `expected_m`; 0 if there are fewer than two.
double smallest_distance(const std::vector<Eigen::Vector3d>& positions, double expected_m);

}  // namespace libmap
