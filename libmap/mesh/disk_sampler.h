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

// Part of a triangle, with corners in barycentric coordinates (u, v) of that triangle.
struct Fragment {
  std::uint32_t triangle = 0;
  std::array<Eigen::Vector2d, 3> corners;
};

// Fragment with the positions of the corners (m).
struct PlacedFragment {
  Fragment fragment;
  std::array<Eigen::Vector3d, 3> corners;

  // Area, m^2.
  double area_m2() const;
  double square_of_longest_side() const;  // m^2
  // Bisects the longest side (Rivara 1984).
  std::array<PlacedFragment, 2> halves() const;
};
PlacedFragment placed(const TriangleMesh& mesh, const Fragment& fragment);

// Maps two random numbers from 0 to 1 to a uniformly distributed point of the fragment.
TrianglePoint point_of(const Fragment& fragment, double first, double second);

// Range of consecutive fragments of a surface, with the bounding box.
struct SurfaceBlock {
  std::size_t begin = 0;  // index of the first fragment
  std::size_t end = 0;    // index after the last fragment
  double area_m2 = 0.0;   // of all fragments
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach_m = 0.0;    // radius of a bounding sphere about the center
  double longest_m = 0.0;  // longest side
};

// A surface as fragments: the triangles of a mesh, and parts of triangles that are too large.
class SurfaceFragments {
 public:
  // Takes all triangles of `mesh`, which must outlive this object.
  explicit SurfaceFragments(const TriangleMesh& mesh);
  // Copies `triangles`, divided until no side is longer than `longest_m`. Parts without area are
  // dropped. Throws Error if there are more than `max_parts` parts.
  SurfaceFragments(const SurfaceFragments& triangles, double longest_m, std::size_t max_parts);

  const std::vector<SurfaceBlock>& blocks() const { return blocks_; }
  double area_m2() const;  // of all fragments
  // Fragment with an index of a block: first the triangles, then the parts of triangles.
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
  const TriangleMesh& mesh;  // with finite vertices
  Eigen::Vector3d low;       // minimum of the bounding box
  SurfaceFragments triangles;
  double area_m2 = 0.0;  // > 0
  // Maximum displacement by rounding positions to single precision; 0: positions are not rounded.
  double rounding_m = 0.0;
  // Samples of adjacent surfaces. New samples keep the minimum distance from these samples.
  std::vector<Eigen::Vector3d> neighbor_samples{};
};

struct DiskSamples {
  std::vector<Eigen::Vector3d> positions;      // rounded if rounding_m > 0
  std::vector<TrianglePoint> triangle_points;  // positions on the mesh before rounding
};

// Saturation density of random discs in the plane: samples * radius^2 / area. Discs of half the
// radius cover 0.547 of the plane.
inline constexpr double saturation_density = 0.6965;
// Approximate share of the samples found by darts (random points) over the whole surface.
inline constexpr double dart_fraction = 0.808;

// Tries random points (darts) over the whole surface. Then, if goes_on(samples so far) is true, it
// fills the gaps; otherwise gaps remain. Throws Error if the mesh is too large for the radius.
DiskSamples sample_disks(const SampledSurface& surface, double radius_m, std::uint64_t seed,
                         const std::function<bool(std::size_t thrown)>& goes_on,
                         Progress& progress);

// Smallest distance of two positions, m; 0 for fewer than two. `expected_m` (> 0): an estimate.
double smallest_distance(const std::vector<Eigen::Vector3d>& positions, double expected_m);

}  // namespace libmap
