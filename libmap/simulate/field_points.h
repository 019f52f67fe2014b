// Chooses locations for a field test (field points) on the rocks of a site, by shape alone.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libmap/core/table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// Shape of the surface within FieldPointOptions::radius_m, by area-weighted normals (normal voting:
// Medioni et al. 2000; Page et al. 2002). flat: equal normals. edge: normals vary in one direction,
// around a ridge. corner: normals vary in both directions, around a tip. irregular: partly concave,
// such as clefts, steps and feet of rocks.
enum class LocationKind { flat, edge, corner, irregular };
const std::string& location_kind_name(LocationKind kind);

struct FieldPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // a vertex, in the site's frame
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // mean within the radius
  LocationKind kind = LocationKind::flat;
  bool is_hard = false;    // difficult to reach: steeper than 60 degrees
  int rock = 0;            // index in RockSite::rocks
  double height_m = 0.0;   // above the ground, along the ground normal
  double slope_deg = 0.0;  // between surface and ground: 0 parallel, 90 a wall, above 90 an
                           // overhang
};

// Chooses `count` locations (FieldPointOptions) that are evenly distributed over rocks, then over
// kinds and difficulty, then as far apart as possible. Deterministic. Throws Error if the mesh has
// no face field "rock", or if too few vertices are high enough and far enough apart.
std::vector<FieldPoint> choose_field_points(const RockSite& site, const TriangleMesh& mesh);

// Table with the columns place, x, y, z, kind, difficulty (easy, hard), rock, height_m, slope_deg.
Table field_point_table(const RockSite& site, const std::vector<FieldPoint>& points);

}  // namespace libmap
