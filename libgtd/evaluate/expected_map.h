// Evaluates a map against regions of known graspability, for example "the top of a ball is
// graspable", instead of a field test. Every voxel in a region counts.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/evaluate/roc.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/core/table.h"

namespace libgtd {

// Region of all points at most `radius_m` from a segment in 3D; a ball if both ends coincide.
struct ExpectedRegion {
  std::string name;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // ends of the segment, m
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::optional<bool> graspable;  // expectation; nullopt: undecided
  std::string reason;             // reason of the expectation

  // Returns true if the point is at most radius_m from the segment.
  bool contains(const Eigen::Vector3d& point) const;
};

struct ExpectedMap {
  std::vector<ExpectedRegion> regions;

  // Throws Error naming the region for a name that is empty or a duplicate, a radius that is 0,
  // negative or infinite, a coordinate that is not finite, and overlapping regions of which only
  // one is expected to be graspable. Throws Error if no region is decided.
  void check() const;
};

// Parses the columns region, x, y, z, to_x, to_y, to_z, radius, graspable, why. Lengths are in
// meters; to_* (the other end of the segment) are empty for a ball; `graspable` is empty if
// undecided, else a label (parse_label, roc_tables.h). All columns are required, others are
// rejected. Throws Error naming file, row and column, and like ExpectedMap::check().
ExpectedMap parse_expected_map(const libmap::Table& table);

// Returns the regions, transformed into the frame of a map.
ExpectedMap transformed(const ExpectedMap& expected, const libmap::Pose& map_from_expected);

struct RegionResult {
  std::size_t voxels = 0;            // with a score; if decided, without those in undecided regions
  std::size_t reaching_cutoff = 0;   // voxels with score >= cutoff
  std::size_t graspable = 0;         // voxels that the map marks graspable, without obstacles
  std::optional<double> mean_score;  // nullopt without voxels
  std::optional<double> median_score;
  // Returns true if at least half of the voxels reach the cutoff; nullopt without voxels.
  std::optional<bool> predicted() const;
};

struct ExpectedMapResult {
  std::vector<RegionResult> regions;  // one per region, including undecided ones
  std::size_t undecided_voxels = 0;   // ignored voxels in undecided regions
  std::size_t unlisted_voxels = 0;    // ignored voxels in no region or without a score
  // Confusion matrix of all voxels with a score, including voxels below the zero plane and at the
  // border. A voxel is predicted graspable if score >= cutoff (voxels_by_score), or if the map's
  // flag `graspable` is set and the voxel is no obstacle (voxels_by_flag). A voxel in several
  // regions counts once. Neighboring voxels are not independent, so that Wilson intervals of voxel
  // rates are too narrow; intervals of region rates are valid.
  Confusion voxels_by_score;
  std::optional<Confusion> voxels_by_flag;  // nullopt if the map has no field "graspable"
  Confusion region_confusion;               // each region with voxels counts once
  std::optional<AreaUnderCurve> auc;        // by voxel scores; nullopt unless both classes exist
};

// Returns sensitivity + specificity - 1 (Youden 1950); nullopt if one of them is undefined.
std::optional<double> youden_index(const Confusion& counts);

// Evaluates a map with a field "score" in the frame of the regions; `cutoff` as in reaches_cutoff.
// Throws like ExpectedMap::check(), and Error for a map without points or without this field.
ExpectedMapResult evaluate_expected_map(const libmap::PointCloud& map, const ExpectedMap& expected,
                                        double cutoff);

}  // namespace libgtd
