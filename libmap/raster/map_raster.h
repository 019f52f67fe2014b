// Converts clouds and maps to rasters (GeoTIFF): one band per field, one pixel per vertical column.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace libmap {

// Grid of square pixels on the horizontal plane of a frame with z up.
struct RasterGrid {
  double pixel_size_m = 0.0;                  // > 0
  Pose frame_from_points = Pose::Identity();  // from the frame of the clouds to this frame
  // x and y in this frame: a corner of any pixel, and the unit direction of increasing columns.
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d column_axis = Eigen::Vector2d::UnitX();
};

struct RasterBand {
  std::string name;           // name of the scalar field
  std::string unit;           // m, deg or N by the suffix of the name (_m, _deg, _n); else empty
  std::vector<float> values;  // NaN: no data
};

// Raster in row-major order. Columns increase along RasterGrid::column_axis, rows to its right.
struct MapRaster {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  // Maps (column, row, 1) to x and y in RasterGrid's frame, m; pixel corners are whole numbers.
  Eigen::Matrix<double, 2, 3> frame_from_pixel;
  std::vector<double> heights_m;  // z in the frame; NaN: no data
  std::vector<RasterBand> bands;  // bands other than the height
  Georeference georeference;      // georeference of the frame
};

// Calls `visit` with each part of a cloud. make_map_raster calls a CloudParts function twice.
using CloudParts = std::function<void(const std::function<void(const PointCloud&)>& visit)>;

// Returns a raster in which each pixel has the height and fields of the topmost point (of equal
// heights, the first point). Bands are the scalar fields of the first part except i, j and k.
// Throws Error if there are no points, or if the raster needs more than half of the machine's
// memory or has 2^31 or more columns or rows.
MapRaster make_map_raster(const CloudParts& parts, const RasterGrid& grid);

// Writes a tiled GeoTIFF (256 x 256 pixels, deflate), with overviews if a side has more than 512
// pixels. Band 1 is `height` (heights_m + origin_m.z), then `bands` follow; nodata is NaN. Values
// are float32, or float64 if float32 would move a height by more than 1e-5 m. Throws Error if the
// WKT of the CRS is invalid; Error (failed) if writing fails or graspmap was built without GDAL.
void write_map_raster(const std::filesystem::path& path, const MapRaster& raster);

}  // namespace libmap
