// A map against places whose graspability is expected by reasons, not found by a field test: every
// voxel at a place counts.
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

// All points at most `radius_m` from the segment, in space: a ball where its ends coincide.
struct ExpectedRegion {
  std::string name;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // meters
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  std::optional<bool> graspable;  // nothing: undecided
  std::string why;

  // Whether the point lies within radius_m of the line from `from` to `to`.
  bool contains(const Eigen::Vector3d& point) const;
};

struct ExpectedMap {
  std::vector<ExpectedRegion> regions;

  // Throws Error naming the region: a name that is a duplicate or is empty, a radius that is not
  // > 0, a coordinate that is not finite, two regions of different verdicts that overlap, no region
  // with a verdict.
  void check() const;
};

// Columns region, x, y, z, to_x, to_y, to_z, radius, graspable, why: meters; the three of the
// segment's other end empty for a ball; `graspable` empty where it is undecided. All columns are
// required, and no other is known. Throws Error naming file, row and column.
ExpectedMap parse_expected_map(const libmap::Table& table);

// Carried into the frame of a map.
ExpectedMap transformed(const ExpectedMap& expected, const libmap::Pose& map_from_expected);

struct RegionResult {
  std::size_t voxels = 0;            // within it; of a decided one those that no undecided holds
  std::size_t reached = 0;           // with a score that reaches the cutoff
  std::size_t graspable = 0;         // with the map's flag
  std::optional<double> mean_score;  // nothing without a voxel
  std::optional<double> median_score;
  // Whether at least half of its voxels reach the cutoff.
  std::optional<bool> predicted() const;
};

struct ExpectedMapResult {
  std::vector<RegionResult> regions;  // one a region; undecided ones too
  std::size_t undecided_voxels = 0;   // left out: in an undecided region
  std::size_t unlisted_voxels = 0;    // left out: in none, or without a score
  // Of all voxels with a score, those below the zero plane and at the edge included. A voxel is
  // predicted graspable where its score reaches the cutoff, or where the map's flag says so and it
  // is no obstacle. One that lies in several regions counts once. Neighboring voxels are not
  // independent: Wilson intervals of their rates are too narrow, those of the places are not.
  Confusion voxels_by_score;
  std::optional<Confusion> voxels_by_flag;  // nothing if the map has no field "graspable"
  Confusion places;                         // a region a place; those without a voxel are left out
  std::optional<AreaUnderCurve> area;  // of the voxels' scores; nothing unless both classes are
                                       // there
};

// Sensitivity + specificity - 1 (Youden 1950); nothing where one of them has no value.
std::optional<double> youden_index(const Confusion& counts);

// Of a map with the field "score", in the frame of the regions. `cutoff` is met as in roc.h. Throws
// Error as check() does, and for a map without points or without scores.
ExpectedMapResult evaluate_expected_map(const libmap::PointCloud& map, const ExpectedMap& expected,
                                        double cutoff);

}  // namespace libgtd
