// Evaluates a map without a field test: compares each voxel inside regions of known graspability,
// for example "the top of a ball is graspable", with the expectation.
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
  std::optional<bool> graspable;  // expectation; nullopt: region is "undecided"
  std::string reason;             // reason of the expectation

  // Returns true if the point is at most radius_m from the segment.
  bool contains(const Eigen::Vector3d& point) const;
};

struct ExpectedMap {
  std::vector<ExpectedRegion> regions;

  // Throws Error naming the region if the name is empty or not unique, the radius is not positive
  // and finite, or a coordinate is not finite. Throws Error if two regions overlap and only one of
  // them is expected to be graspable, and if all regions are undecided.
  void check() const;
};

// Parses the columns region, x, y, z, to_x, to_y, to_z, radius, graspable, why; all are required,
// others are rejected. Lengths are in meters; to_* (the other end of the segment) are empty for a
// ball; `graspable` is empty if undecided, else a label (parse_label, roc_tables.h). Throws Error
// naming file, row and column, and like ExpectedMap::check().
ExpectedMap parse_expected_map(const libmap::Table& table);

// Returns the regions in the frame of a map.
ExpectedMap transformed(const ExpectedMap& expected, const libmap::Pose& map_from_expected);

struct RegionResult {
  std::size_t voxels = 0;  // with a score; if decided, only voxels that are in no undecided region
  std::size_t reaching_cutoff = 0;   // voxels with score >= cutoff
  std::size_t graspable = 0;         // voxels that are marked graspable and no obstacles
  std::optional<double> mean_score;  // nullopt without voxels
  std::optional<double> median_score;
  // Returns true if at least half of the voxels reach the cutoff; nullopt without voxels.
  std::optional<bool> predicted() const;
};

struct ExpectedMapResult {
  std::vector<RegionResult> regions;  // one per region, including undecided ones
  std::size_t undecided_voxels = 0;   // voxels with a score in undecided regions
  std::size_t unlisted_voxels = 0;    // voxels in no region or without a score
  // Confusion matrices of the voxels with a score in decided regions only, including voxels below
  // the zero plane (minimum height of a target) and at the border of the scanned area. A voxel is
  // predicted graspable if score >= cutoff (voxels_by_score), or if the map's flag `graspable` is
  // set and the voxel is no obstacle (voxels_by_flag). A voxel in several regions counts once.
  // Wilson intervals of these rates are too narrow, because neighboring voxels are not independent.
  Confusion voxels_by_score;
  std::optional<Confusion> voxels_by_flag;  // nullopt if the map has no field "graspable"
  Confusion region_confusion;               // decided regions, by RegionResult::predicted()
  std::optional<AreaUnderCurve> auc;        // of voxel scores; nullopt unless both labels occur
};

// Returns sensitivity + specificity - 1 (Youden 1950); nullopt without positives or negatives.
std::optional<double> youden_index(const Confusion& counts);

// Evaluates a map with a field "score" in the frame of the regions; `cutoff` as in reaches_cutoff.
// Throws like ExpectedMap::check(), and Error for a map without points or without this field.
ExpectedMapResult evaluate_expected_map(const libmap::PointCloud& map, const ExpectedMap& expected,
                                        double cutoff);

}  // namespace libgtd
