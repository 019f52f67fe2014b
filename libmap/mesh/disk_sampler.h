// Generates Poisson-disk samples for a given radius, for poisson_disk.h. Private to libmap/mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

// Part of a triangle of a mesh, or the whole triangle.
struct Fragment {
  std::uint32_t triangle = 0;              // index of the triangle
  std::array<Eigen::Vector2d, 3> corners;  // u and v in the triangle, as in TrianglePoint
};

// Fragment with the positions of its corners in the frame of the mesh, m.
struct PlacedFragment {
  Fragment fragment;
  std::array<Eigen::Vector3d, 3> corners;

  // Return the area and the squared length of the longest side, m2.
  double area_m2() const;
  double square_of_longest_side() const;
  // Returns the two parts after bisection at the midpoint of the longest side (Rivara 1984).
  std::array<PlacedFragment, 2> halves() const;
};
PlacedFragment placed(const TriangleMesh& mesh, const Fragment& fragment);

// Maps two random numbers from 0 to 1 to a uniformly distributed point of the fragment.
TrianglePoint point_of(const Fragment& fragment, double first, double second);

// Range of consecutive fragments of SurfaceFragments, with a bounding sphere.
struct SurfaceBlock {
  std::size_t begin = 0;                             // index of the first fragment
  std::size_t end = 0;                               // index after the last fragment
  double area_m2 = 0.0;                              // total area of the fragments
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // center of the bounding sphere, m
  double reach_m = 0.0;                              // radius of the bounding sphere
  double longest_m = 0.0;                            // longest side of a fragment
};

// A surface as fragments: the triangles of a mesh, and parts of triangles that are too large.
class SurfaceFragments {
 public:
  // Takes all triangles of `mesh`, which must outlive this object.
  explicit SurfaceFragments(const TriangleMesh& mesh);
  // Divides the fragments of `triangles` until no side is longer than `longest_m`. Drops parts
  // without area. Throws Error if there are more than `max_parts` parts.
  SurfaceFragments(const SurfaceFragments& triangles, double longest_m, std::size_t max_parts);

  const std::vector<SurfaceBlock>& blocks() const { return blocks_; }
  double area_m2() const;  // total area of the fragments
  // Returns triangle `number` of the mesh or, beyond the last triangle, a part of a triangle.
  PlacedFragment fragment_at(std::size_t number) const;

 private:
  void cut(const PlacedFragment& fragment, double longest_m, std::size_t max_parts);
  void add_blocks(std::size_t begin, std::size_t end);
  SurfaceBlock measured(std::size_t begin, std::size_t end) const;

  const TriangleMesh& mesh_;
  std::vector<Fragment> parts_;  // numbered after the triangles
  std::vector<SurfaceBlock> blocks_;
};

struct SampledSurface {
  const TriangleMesh& mesh;    // with finite vertices
  Eigen::Vector3d low;         // minimum of the bounding box
  SurfaceFragments triangles;  // all triangles of `mesh`
  double area_m2 = 0.0;        // > 0
  // Maximum displacement by rounding positions to single precision; 0: positions are not rounded.
  double rounding_m = 0.0;
  // Samples of adjacent surfaces. New samples keep the minimum distance from these samples.
  std::vector<Eigen::Vector3d> neighbor_samples{};
};

struct DiskSamples {
  std::vector<Eigen::Vector3d> positions;      // rounded if rounding_m > 0
  std::vector<TrianglePoint> triangle_points;  // positions on the mesh before rounding
};

// Expected value of samples * radius^2 / area for random samples in the plane without gaps: discs
// of half the radius cover 0.547 of the plane.
inline constexpr double saturation_density = 0.6965;
// Approximate share of the samples that sample_disks finds before it fills the gaps.
inline constexpr double dart_fraction = 0.808;

// Returns random samples with a minimum distance of `radius_m`. Tries random points (darts) over
// the whole surface. Then, if goes_on(number of samples) is true, fills the gaps: parts farther
// than `radius_m` from all samples. Throws Error if the mesh is too large for the radius.
DiskSamples sample_disks(const SampledSurface& surface, double radius_m, std::uint64_t seed,
                         const std::function<bool(std::size_t thrown)>& goes_on,
                         Progress& progress);

// Smallest distance of two positions, m; 0 for fewer than two. `expected_m`, > 0: its estimate.
double smallest_distance(const std::vector<Eigen::Vector3d>& positions, double expected_m);

}  // namespace libmap
