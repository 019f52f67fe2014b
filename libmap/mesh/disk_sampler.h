// One maximal set of Poisson-disk samples of a given radius. Private to libmap/mesh.
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

// A part of a triangle: its corners as (u, v) of that triangle.
struct Fragment {
  std::uint32_t triangle = 0;
  std::array<Eigen::Vector2d, 3> corners;
};

// A fragment with its corners in space.
struct PlacedFragment {
  Fragment fragment;
  std::array<Eigen::Vector3d, 3> corners;

  // Of the fragment's triangle.
  double area_m2() const;
  double square_of_longest_side() const;
  // Cut through the middle of its longest side (Rivara 1984).
  std::array<PlacedFragment, 2> halves() const;
};
PlacedFragment placed(const TriangleMesh& mesh, const Fragment& fragment);

// Where two numbers from 0 to 1 put a point, evenly over the fragment.
TrianglePoint point_of(const Fragment& fragment, double first, double second);

// Consecutive pieces of a surface.
struct SurfaceBlock {
  std::size_t begin = 0;
  std::size_t end = 0;
  double area_m2 = 0.0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double reach_m = 0.0;    // no point of them is farther from the center
  double longest_m = 0.0;  // of their sides
};

// A surface in pieces: triangles of its mesh, and parts of those that are too large.
class SurfacePieces {
 public:
  // All triangles as they are. The mesh must stay while the pieces are used.
  explicit SurfacePieces(const TriangleMesh& mesh);
  // `triangles` cut until no side is longer than `longest_m`. Throws Error if that yields more than
  // `max_parts`.
  SurfacePieces(const SurfacePieces& triangles, double longest_m, std::size_t max_parts);

  const std::vector<SurfaceBlock>& blocks() const { return blocks_; }
  // Of all pieces together; one piece by its number.
  double area_m2() const;
  PlacedFragment piece(std::size_t number) const;

 private:
  void cut(const PlacedFragment& fragment, double longest_m, std::size_t max_parts);
  void add_blocks(std::size_t begin, std::size_t end);
  SurfaceBlock measured(std::size_t begin, std::size_t end) const;

  const TriangleMesh& mesh_;
  std::vector<Fragment> parts_;  // numbered behind the triangles
  std::vector<SurfaceBlock> blocks_;
};

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
