// Selects the best positions of a map as footholds for a step planner.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/result_table.h"

namespace libgtd {

struct FootholdOptions {
  double separation_m = 0.1;  // minimum distance between footholds, > 0
  double min_score = 0.0;     // minimum score of a foothold
  // Only graspable points become footholds: hold_probability of at least 0.5, or the field
  // `graspable` if the map has no hold_probability.
  bool graspable_only = true;
  bool border = false;             // true: points at the border of the scanned area are candidates
  double surface_radius_m = 0.05;  // radius of the normal and curvature fits, > 0
  int max_count = 0;               // maximum number of footholds; 0: no limit
};
void bind(libmap::ParameterTable& table, FootholdOptions& options);

// Direction up in the frame of the map's points.
struct FootholdFrame {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // out of the ground, any length
};

struct Foothold {
  std::size_t map_point = 0;  // index of the point in the map
  double score = 0.0;         // hold_probability if the map has this field, else the score
  double force_n = 0.0;       // holding_force_n of the map, else 0; decides between equal scores
  // Mean score of the map points within separation_m / 2, weighted by the Epanechnikov kernel.
  // Decides between equal scores and forces: the middle of a plateau precedes its border.
  double mean_score = 0.0;
  std::size_t graspable_points = 0;  // graspable points within separation_m / 2
  // Fitted surface, NaN if the fit failed: outward unit normal (on the side of the map's normals,
  // or else of up), principal curvatures k1 >= k2, 1/m (curvature.h), angle between normal and up.
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float k1 = 0.0F;
  float k2 = 0.0F;
  double slope_deg = 0.0;
  // Unit direction of the gripper's approach: opposite to the normal of the map, or to up if the
  // map has no normals.
  Eigen::Vector3d approach = Eigen::Vector3d::Zero();
};

struct FootholdResult {
  std::vector<Foothold> footholds;  // best first
  std::size_t candidates = 0;       // map points that can become footholds
  std::size_t at_border = 0;        // points excluded only because of the border
};
// Names each result for manifests and tables (libmap/core/result_table.h).
void describe(libmap::ResultTable& table, const FootholdResult& result);

// Finds local maxima of the score by non-maximum suppression: the best candidate becomes a foothold
// and candidates within separation_m of this foothold are dropped, until none is left. Points that
// are equal in all criteria keep the order of the map. Throws Error for an empty map, a missing
// field that the options need ("score", "graspable", "border"), options out of range, and `up` = 0.
FootholdResult find_footholds(const libmap::PointCloud& map, const FootholdOptions& options = {},
                              const FootholdFrame& frame = {});

// Returns one point per foothold with position, normal, color and the fields of the map, followed
// by mean_score, graspable_points, approach_x, approach_y, approach_z, slope_deg, k1, k2. slope_deg
// is computed from the fitted normal and replaces the map's field.
libmap::PointCloud to_cloud(const FootholdResult& result, const libmap::PointCloud& map);

}  // namespace libgtd
