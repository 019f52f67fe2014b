// Chooses test locations (field points) on the rocks of a site by the shape of the surface only.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libmap/core/table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/simulate/rock_site.h"

namespace libmap {

// Shape of the surface within FieldPointOptions::radius_m, by the eigenvalues of area-weighted
// normals (normal voting: Medioni et al. 2000; Page et al. 2002). flat: equal normals. edge:
// normals vary in one direction, as at a ridge. corner: normals vary in two directions, as at a
// tip. irregular: partly concave, as in clefts and at the feet of rocks.
enum class LocationKind { flat, edge, corner, irregular };
const std::string& location_kind_name(LocationKind kind);

struct FieldPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // a vertex, in the site's frame, m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // mean within the radius, in the site's frame
  LocationKind kind = LocationKind::flat;
  bool is_hard = false;    // true if the slope exceeds 60 degrees, so that it is hard to reach
  int rock = 0;            // index in RockSite::rocks
  double height_m = 0.0;   // height above the ground, along the ground normal
  double slope_deg = 0.0;  // angle between surface and ground; > 90: an overhang
};

// Chooses FieldPointOptions::count locations: evenly distributed over rocks, then over kinds and
// difficulty, then as far apart as possible. Deterministic. Throws Error if the mesh has no face
// field "rock" (site_mesh.h), or too few vertices are high enough and at least a radius apart.
std::vector<FieldPoint> choose_field_points(const RockSite& site, const TriangleMesh& mesh);

// Table: place ("P01"), x, y, z, kind, difficulty (easy, hard), rock (name), height_m, slope_deg.
Table field_point_table(const RockSite& site, const std::vector<FieldPoint>& points);

}  // namespace libmap
