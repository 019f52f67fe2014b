// Clouds and maps as rasters: one band per field, one pixel per column of points.
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

// Square pixels on the horizontal plane of a frame whose z is up.
struct RasterGrid {
  double pixel_size_m = 0.0;
  Pose frame_from_points = Pose::Identity();
  // In the frame: a corner of a pixel, and the direction of the columns (unit length).
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d column_axis = Eigen::Vector2d::UnitX();
};

struct RasterBand {
  std::string name;
  std::string unit;           // by the end of the name: _m, _deg, _n; else empty
  std::vector<float> values;  // NaN: no data
};

// Row by row from the north; column and row axes are `column_axis` and its right.
struct MapRaster {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  Eigen::Matrix<double, 2, 3> frame_from_pixel;  // m, of (column, row, 1); corners at whole numbers
  std::vector<double> heights_m;                 // z in the frame; NaN: no data
  std::vector<RasterBand> bands;                 // beside the height
  Georeference georeference;                     // of the frame
};

// Calls the visitor with each part of a cloud; called twice.
using CloudParts = std::function<void(const std::function<void(const PointCloud&)>& visit)>;

// Each pixel gets the height and the fields of its topmost point, of the first one where heights
// are equal. Bands: the scalar fields of the first part but for i, j and k. Throws Error: no
// points, or a raster that takes more than half of the machine's memory.
MapRaster make_map_raster(const CloudParts& parts, const RasterGrid& grid);

// A tiled GeoTIFF (256 x 256 pixels, deflate) with overviews above 512 pixels: band 1 `height`,
// then the others; nodata is NaN. float32, or float64 where that moves a height by more than 1e-5
// m. Throws Error (failed): it cannot be written, or graspmap was built without GDAL.
void write_map_raster(const std::filesystem::path& path, const MapRaster& raster);

}  // namespace libmap
