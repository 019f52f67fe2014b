// The best places of a map, for a planner of steps.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/result_table.h"

namespace libgtd {

struct FootholdOptions {
  double separation_m = 0.1;  // > 0: no two footholds lie nearer to each other
  double min_score = 0.0;     // of a foothold
  // Where the map has hold_probability: at least one half. Else where it is `graspable`.
  bool graspable_only = true;
  bool border = false;             // also where the mask's window leaves the scanned area
  double surface_radius_m = 0.05;  // > 0: the surface's normal and curvatures are fitted within
  int max_count = 0;               // the best ones alone; 0: all
};
void bind(libmap::ParameterTable& table, FootholdOptions& options);

// What is known of the frame of the map's points.
struct FootholdFrame {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // outside of the regression plane
};

struct Foothold {
  std::size_t map_point = 0;
  double score = 0.0;    // the map's hold_probability if it has this field, else its score
  double force_n = 0.0;  // the map's holding_force_n, else 0: orders equal scores
  // Mean score of the map points within half of the separation, weighted by Epanechnikov's kernel:
  // of equal scores and forces the one with the larger mean comes first, the middle of a plateau
  // rather than its border.
  double mean_score = 0.0;
  std::size_t graspable_points = 0;  // within half of the separation
  // Of the surface: unit normal outward (where the map's normals face, else up), principal
  // curvatures in 1/m as in curvature.h, angle between normal and up. NaN where they could not be
  // fitted.
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float k1 = 0.0F;
  float k2 = 0.0F;
  double slope_deg = 0.0;
  // Unit vector along which the gripper comes, against the axis of the mask that was matched: the
  // map's normal if it has normals, else up.
  Eigen::Vector3d approach = Eigen::Vector3d::Zero();
};

struct FootholdResult {
  std::vector<Foothold> footholds;  // best first
  std::size_t candidates = 0;       // map points that may be one
  std::size_t at_border = 0;        // would be candidates, but for the option `edges`
};
// Names the results of a search (libmap/core/result_table.h).
void describe(libmap::ResultTable& table, const FootholdResult& result);

// Local maxima of the score by non-maximum suppression: the best candidate is a foothold, those
// nearer to it than the separation are none, and so on. Of equals, the order of the map's points
// decides. Throws Error: an empty map, one without a field that the options need ("score",
// "graspable", "border"), options out of their bounds, an `up` of no length.
FootholdResult find_footholds(const libmap::PointCloud& map, const FootholdOptions& options = {},
                              const FootholdFrame& frame = {});

// A point for each: its place, normal and color; the map's own fields, but for slope_deg, which is
// that of this normal; mean_score, graspable_points, approach_x, approach_y, approach_z, slope_deg,
// k1, k2.
libmap::PointCloud to_cloud(const FootholdResult& result, const libmap::PointCloud& map);

}  // namespace libgtd
