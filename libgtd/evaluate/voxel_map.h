// A map as arrays on its lattice, for what counts, joins or compares its voxels.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"
#include "libmap/core/manifest.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace libgtd {

// What is known of a map beside its points.
struct MapFacts {
  std::optional<VoxelLattice> lattice{};                           // in the terrain frame
  libmap::Pose terrain_from_map = libmap::Pose::Identity();        // of the map's points
  double zero_plane_m = -std::numeric_limits<double>::infinity();  // in the terrain frame
};

// As `graspmap score` writes it down: parameters, frame, transforms and the lattice's origin.
MapFacts facts_of(const libmap::Manifest& manifest);

// One entry per voxel in each array, ascending by voxel, whatever the order of the map's points.
struct VoxelMap {
  VoxelLattice lattice;                                      // in the terrain frame
  libmap::Pose terrain_from_map = libmap::Pose::Identity();  // of the map's points
  double zero_plane_m = -std::numeric_limits<double>::infinity();
  std::vector<Voxel> voxels;
  std::vector<float> scores;              // NaN: none
  std::vector<std::uint8_t> graspable;    // and scored, and no obstacle
  std::vector<std::uint8_t> border;       // 0 where the map has no such field
  std::vector<std::uint8_t> obstacle;     // the same
  std::vector<std::uint32_t> map_points;  // index among the map's points

  std::size_t size() const { return voxels.size(); }
  Eigen::Vector3d center_in_terrain(std::size_t n) const { return lattice.center_of(voxels[n]); }
  bool above_zero_plane(std::size_t n) const {
    return !(lattice.center_of(voxels[n]).z() < zero_plane_m);
  }
  // A voxel whose score counts: it has one, and lies above the zero plane; one whose mask's window
  // leaves the scanned area only if `with_border`.
  bool evaluated(std::size_t n, bool with_border) const {
    return scores[n] == scores[n] && above_zero_plane(n) && (with_border || border[n] == 0);
  }
};

// Needs the fields "score" and "graspable", and voxels: the fields i, j and k, or a known lattice.
// With the fields alone, the lattice is fitted to the points, carried to the terrain frame.
// Points without a position are left out. Throws Error: no points, a field that is missing or holds
// no voxel, points that do not lie at their voxels, two points of one voxel.
VoxelMap voxel_map_of(const libmap::PointCloud& map, const MapFacts& facts = {});

}  // namespace libgtd
