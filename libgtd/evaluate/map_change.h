// Compares two maps of the same ground, MAP and OTHER, voxel by voxel: graspability and scores.
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
  // Maximum distance of corresponding voxel centers if the lattices differ, in edge lengths of the
  // larger voxel. The default is half a diagonal, the maximum distance from any point to the
  // nearest center of a lattice.
  double match_distance_voxels = 0.87;
  double height_bin_m = 0.05;
  double slope_bin_deg = 5.0;
  bool border = false;  // true: voxels at the border of the scanned area are evaluated, too
};
// Binds match_distance_voxels; MapAnalysisOptions binds the keys of the other fields.
void bind(libmap::ParameterTable& table, MapChangeOptions& options);

// Correspondence of voxels. lattice: same indices on a common lattice. nearest: mutually nearest.
enum class VoxelMatching { lattice, nearest };
std::string_view to_text(VoxelMatching matching);

// Graspability of a voxel in two maps: in neither, in both, gained (only in OTHER), lost (only in
// MAP); or the voxel is only in one map.
enum class ChangeClass : std::uint8_t { neither, both, gained, lost, only_map, only_other };

struct VoxelPair {
  std::uint32_t map = 0;  // indices of the voxels in the two maps
  std::uint32_t other = 0;
};

// Returns the class of a pair of voxels.
ChangeClass class_of(const VoxelMap& map, const VoxelMap& other, const VoxelPair& pair);

// Statistics of the score differences OTHER - MAP over pairs with both scores.
struct ScoreDifference {
  std::size_t count = 0;
  double mean = 0.0;
  double mean_absolute = 0.0;
  double rms = 0.0;
  double low_5 = 0.0;    // 5th percentile: nearest rank, counted from the smallest value
  double median = 0.0;   // for an even number of pairs: mean of the two middle values
  double high_95 = 0.0;  // 95th percentile: nearest rank, counted from the largest value
  double min = 0.0;
  double max = 0.0;
  std::optional<double> correlation;  // Pearson; nullopt if one map is constant
};

// Statistics of the voxel pairs of one bin, or of all pairs.
struct ChangeSummary {
  double low = 0.0;  // bounds of the bin, m or degrees; 0 without bins
  double high = 0.0;
  Confusion graspable;         // MAP is the prediction, OTHER the reference
  std::optional<Kappa> kappa;  // nullopt if undefined
  ScoreDifference difference;
  double both_area_m2 = 0.0;  // surface areas of pairs by ChangeClass, measured on MAP
  double gained_area_m2 = 0.0;
  double lost_area_m2 = 0.0;

  std::size_t gained() const { return graspable.false_negatives; }
  std::size_t lost() const { return graspable.false_positives; }
};

struct MapChange {
  VoxelMatching matching = VoxelMatching::lattice;
  std::vector<VoxelPair> pairs;         // ascending by the voxel of MAP
  std::vector<std::uint32_t> only_map;  // voxels of MAP without a partner, ascending
  std::vector<std::uint32_t> only_other;
  std::size_t only_map_graspable = 0;
  std::size_t only_other_graspable = 0;
  ChangeSummary common;                  // all pairs
  ChangeSummary evaluated;               // pairs evaluated in both maps (VoxelMap::evaluated)
  std::vector<ChangeSummary> by_height;  // evaluated pairs by height in MAP's terrain frame
  std::vector<ChangeSummary> by_slope;   // evaluated pairs by slope of MAP, if known
};

// Compares two maps. `map_terrain_from_other_terrain` transforms OTHER's terrain frame to MAP's.
// Exchanging the maps transposes the confusion matrices and negates the differences. Throws Error
// for options out of range, maps without a common voxel and a surface of a different size than MAP.
MapChange compare_maps(const VoxelMap& map, const MapSurface& surface, const VoxelMap& other,
                       const libmap::Pose& map_terrain_from_other_terrain,
                       const MapChangeOptions& options = {});

// Returns one point per pair (at MAP's voxel) and per voxel in one map only, in the frame of MAP's
// points, with score_map, score_other, difference (NaN if undefined), graspable_map,
// graspable_other, evaluated (in each map that has the voxel, with `border`), change (ChangeClass).
libmap::PointCloud to_cloud(const MapChange& change, const VoxelMap& map, const VoxelMap& other,
                            const libmap::Pose& map_terrain_from_other_terrain, bool border);

}  // namespace libgtd
