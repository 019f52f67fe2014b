// Georeference of a terrain: relation of local coordinates to a coordinate reference system (CRS)
// of the Earth or another body.
#pragma once

#include <Eigen/Core>
#include <string>

namespace libmap {

// Local coordinates (x east, y north, z up, meters) are projected coordinates minus an offset,
// which keeps numbers small: easting = (origin_m.x + x) / unit_m, northing = (origin_m.y + y) /
// unit_m, height = origin_m.z + z in meters.
struct Georeference {
  std::string crs_wkt;  // WKT 2 (ISO 19162:2019); empty: unknown reference system
  double unit_m = 1.0;  // meters per unit of eastings and northings
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  // the offset: east, north, up

  bool operator==(const Georeference&) const = default;
};

}  // namespace libmap
