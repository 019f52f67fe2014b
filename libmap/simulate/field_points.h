// Places for a field test, chosen on the rocks of a site by their form alone.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libmap/core/table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// By normal vectors within the radius, weighted by area (normal voting: Medioni et al. 2000; Page
// et al. 2002): flat: they agree. edge: they spread along one arc, about a ridge. corner: they
// spread both ways, about a tip. irregular: the surface bends inward somewhere: clefts, steps,
// feet.
enum class PlaceKind { flat, edge, corner, irregular };
const std::string& place_kind_name(PlaceKind kind);

struct FieldPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // a vertex, in the site's frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  PlaceKind kind = PlaceKind::flat;
  bool is_hard = false;    // to reach: steeper than 60 degrees
  int rock = 0;            // index in the site
  double height_m = 0.0;   // above the ground, along its normal
  double slope_deg = 0.0;  // of the surface against the ground: 0 as the ground, 90 a wall, more an
                           // overhang
};

// As many as the site's options ask for: spread over the rocks first, then over kinds and over easy
// and hard places, then as far from the others as can be. Deterministic. Throws Error if the mesh
// has no face field "rock" or too few places are high enough.
std::vector<FieldPoint> choose_field_points(const RockSite& site, const TriangleMesh& mesh);

// Columns place, x, y, z, kind, difficulty (easy, hard), rock, height_m, slope_deg.
Table field_point_table(const RockSite& site, const std::vector<FieldPoint>& points);

}  // namespace libmap
