// Graspability map as arrays with one entry per voxel: the common input of map statistics, regions
// and comparisons (analyze_map, find_regions, compare_maps).
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

// Properties of a map that are stored in the manifest, not in the points.
struct MapInfo {
  std::optional<VoxelLattice> lattice{};  // in the terrain frame; nullopt: unknown
  libmap::Pose terrain_from_map = libmap::Pose::Identity();        // from the frame of the points
  double zero_plane_m = -std::numeric_limits<double>::infinity();  // minimum terrain z of a target
};

// Reads a MapInfo from a manifest of `graspmap score`; missing properties keep their defaults.
// Throws Error if the lattice is not finite.
MapInfo map_info(const libmap::Manifest& manifest);

// Arrays with one entry per voxel, ascending by voxel, for any order of the map's points.
struct VoxelMap {
  VoxelLattice lattice;                                            // in the terrain frame
  libmap::Pose terrain_from_map = libmap::Pose::Identity();        // from the frame of the points
  double zero_plane_m = -std::numeric_limits<double>::infinity();  // minimum terrain z of a target
  std::vector<Voxel> voxels;
  std::vector<float> scores;              // NaN: no score
  std::vector<std::uint8_t> graspable;    // 1: marked graspable, has a score, no obstacle
  std::vector<std::uint8_t> border;       // 1: window of the mask leaves the scanned area
  std::vector<std::uint8_t> obstacle;     // 1: obstacle or unreachable ground
  std::vector<std::uint32_t> map_points;  // index of the point in the map

  std::size_t size() const { return voxels.size(); }
  Eigen::Vector3d center_in_terrain(std::size_t n) const { return lattice.center_of(voxels[n]); }
  bool above_zero_plane(std::size_t n) const {
    return !(lattice.center_of(voxels[n]).z() < zero_plane_m);
  }
  // Returns true if the voxel has a score, is above the zero plane and, unless `with_border`, the
  // window of the mask is inside the scanned area.
  bool evaluated(std::size_t n, bool with_border) const {
    return scores[n] == scores[n] && above_zero_plane(n) && (with_border || border[n] == 0);
  }
};

// Converts a map with the fields "score" and "graspable"; missing fields "border" and "obstacle"
// are 0. Voxel indices are the fields i, j and k, or follow from a known lattice. An unknown
// lattice is fitted to the points in the terrain frame. Skips points that are not finite. Throws
// Error for a map without points, a missing or invalid field, and points that are not at voxel
// centers or share a voxel.
VoxelMap voxel_map_of(const libmap::PointCloud& map, const MapInfo& info = {});

}  // namespace libgtd
