// What differs between two maps of one ground, voxel by voxel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "libgtd/evaluate/map_surface.h"
#include "libgtd/evaluate/roc.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

struct MapChangeOptions {
  // Where the lattices differ: voxels are of one place if each is the other's nearest and their
  // centers lie at most so many edges of a voxel apart. Half a diagonal: no place is farther from
  // the nearest center of a lattice.
  double match_distance_voxels = 0.87;
  double height_bin_m = 0.05;
  double slope_bin_deg = 5.0;
  bool border = false;  // voxels whose mask's window leaves the scanned area count too
};
void bind(libmap::ParameterTable& table, MapChangeOptions& options);

// lattice: both maps lie on one lattice, voxels with the same indices are of one place.
enum class VoxelMatching { lattice, nearest };
std::string_view to_text(VoxelMatching matching);

// Whether a place can be held: in neither map, in both, in OTHER alone, in MAP alone; or the place
// is in one map alone.
enum class ChangeClass : std::uint8_t { neither, both, gained, lost, only_map, only_other };

struct VoxelPair {
  std::uint32_t map = 0;  // entries of the two maps
  std::uint32_t other = 0;
};

// Of a pair of voxels by whether each can be held.
ChangeClass class_of(const VoxelMap& map, const VoxelMap& other, const VoxelPair& pair);

// Of the scores of OTHER less those of MAP, over pairs that both have a score.
struct ScoreDifference {
  std::size_t count = 0;
  double mean = 0.0;
  double mean_absolute = 0.0;
  double rms = 0.0;
  double low_5 = 0.0;   // 5th and 95th percentile by nearest rank, each from its own end
  double median = 0.0;  // of an even number of values, the mean of the two in the middle
  double high_95 = 0.0;
  double min = 0.0;
  double max = 0.0;
  std::optional<double> correlation;  // Pearson's; nothing where one of them is constant
};

// Of a set of pairs.
struct ChangeSummary {
  double low = 0.0;  // of a bin
  double high = 0.0;
  Confusion graspable;  // MAP evaluates, OTHER is the reference
  std::optional<Kappa> kappa;
  ScoreDifference difference;
  double both_area_m2 = 0.0;  // of MAP's surface
  double gained_area_m2 = 0.0;
  double lost_area_m2 = 0.0;

  std::size_t gained() const { return graspable.false_negatives; }
  std::size_t lost() const { return graspable.false_positives; }
};

struct MapChange {
  VoxelMatching matching = VoxelMatching::lattice;
  std::vector<VoxelPair> pairs;         // ascending by MAP's voxel
  std::vector<std::uint32_t> only_map;  // ascending
  std::vector<std::uint32_t> only_other;
  std::size_t only_map_graspable = 0;
  std::size_t only_other_graspable = 0;
  ChangeSummary common;                  // all pairs
  ChangeSummary evaluated;               // those evaluated in both maps (VoxelMap::evaluated)
  std::vector<ChangeSummary> by_height;  // of those evaluated, in MAP's terrain frame
  std::vector<ChangeSummary> by_slope;   // of MAP's surface; without those of unknown slope
};

// `map_terrain_from_other_terrain` carries OTHER's terrain frame to MAP's. Exchanging the maps
// transposes the counts and turns the signs of the differences. Throws Error: options out of their
// bounds, no voxel in common.
MapChange compare_maps(const VoxelMap& map, const MapSurface& surface, const VoxelMap& other,
                       const libmap::Pose& map_terrain_from_other_terrain,
                       const MapChangeOptions& options = {});

// A point for each pair and for each voxel that is in one map alone, at its place in the frame of
// MAP's points (of pairs MAP's voxel), with the fields score_map, score_other, difference (NaN
// where there is none), graspable_map, graspable_other, evaluated and change (ChangeClass).
libmap::PointCloud to_cloud(const MapChange& change, const VoxelMap& map, const VoxelMap& other,
                            const libmap::Pose& map_terrain_from_other_terrain, bool border);

}  // namespace libgtd
