// libgraspmap_raster_gdal.so; see raster_module.h.
#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <gdal_frmts.h>
#include <ogr_srs_api.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/single_precision.h"
#include "libmap/core/text.h"
#include "libmap/raster/raster_module.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double max_height_m = 1e6;
constexpr double max_pixels = 0x1p33;
constexpr std::int64_t max_block_pixels = std::int64_t{1} << 24;
constexpr std::int64_t min_window_pixels = 65536;

struct CloseDataset {
  void operator()(GDALDatasetH dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<void, CloseDataset>;

// Restricts GDAL to the given file, and makes its output independent of the machine.
void prepare() {
  CPLSetErrorHandler(CPLQuietErrorHandler);
  for (const auto& [key, value] : {std::pair{"GDAL_PAM_ENABLED", "NO"},
                                   {"GDAL_DISABLE_READDIR_ON_OPEN", "EMPTY_DIR"},
                                   {"GDAL_NUM_THREADS", "1"},
                                   {"GDAL_CACHEMAX", "64"}})
    CPLSetConfigOption(key, value);
  GDALRegister_GTiff();
  CPLErrorReset();
}

std::string last_message() {
  std::string message = CPLGetLastErrorMsg();
  std::replace(message.begin(), message.end(), '\n', ' ');
  return message.empty() ? "unknown reason" : message;
}

Dataset open(const fs::path& path) {
  const char* const drivers[] = {"GTiff", nullptr};
  const char* const options[] = {"GEOREF_SOURCES=INTERNAL", nullptr};
  Dataset dataset(GDALOpenEx(path.c_str(),
                             GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR, drivers,
                             options, nullptr));
  if (!dataset) throw Error("not a readable GeoTIFF: " + last_message());
  return dataset;
}

// Returns the advice to project to the UTM zone (EPSG code) of `center`.
std::string utm_remedy(OGRSpatialReferenceH srs, const Eigen::Vector2d& center) {
  const bool is_earth = std::abs(OSRGetSemiMajor(srs, nullptr) - 6378137.0) < 1000.0;
  const bool is_place = std::abs(center.x()) <= 360.0 && std::abs(center.y()) <= 84.0;
  std::string target = "a projected CRS in meters";
  if (is_earth && is_place) {
    const int zone = 1 + static_cast<int>(std::floor((std::fmod(center.x() + 540.0, 360.0)) / 6.0));
    target = "EPSG:" + std::to_string((center.y() < 0.0 ? 32700 : 32600) + zone);
  }
  return "project it with gdalwarp -t_srs " + target + " IN.tif OUT.tif";
}

// Meters per unit of the heights of `band`.
double height_unit_m(GDALRasterBandH band, OGRSpatialReferenceH srs) {
  const std::string given = GDALGetRasterUnitType(band);
  const std::string unit = lower_case(given);
  if (unit.empty())
    return srs != nullptr && OSRIsCompound(srs) != 0
               ? OSRGetTargetLinearUnits(srs, "VERT_CS", nullptr)
               : 1.0;
  for (const char* const name : {"m", "meter", "meters", "metre", "metres"})
    if (unit == name) return 1.0;
  for (const char* const name : {"ft", "foot", "feet"})
    if (unit == name) return 0.3048;
  for (const char* const name : {"us-ft", "ftus", "us survey foot", "us_survey_foot", "sft"})
    if (unit == name) return 1200.0 / 3937.0;
  throw Error("unknown unit of heights",
              {.field = "unit of the height band", .value = given, .bound = "m, ft or us-ft"});
}

class Dem {
 public:
  Dem(const fs::path& path, const std::optional<Georeference>& frame) : dataset_(open(path)) {
    info_.columns = GDALGetRasterXSize(dataset_.get());
    info_.rows = GDALGetRasterYSize(dataset_.get());
    const double pixels = static_cast<double>(info_.columns) * static_cast<double>(info_.rows);
    if (pixels > max_pixels)
      throw Error("too many; crop the raster (gdal_translate -srcwin)",
                  {.field = "pixels", .value = to_text(pixels), .bound = "<= 2^33"});
    choose_band();
    choose_window();
    georeference(frame);
  }

  const DemInfo& info() const { return info_; }

  // Calls visit(block) with the local heights of each window.
  template <typename Visit>
  void for_each_block(const Visit& visit) const {
    DemBlock block;
    for (std::int64_t row = 0; row < info_.rows; row += window_rows_)
      for (std::int64_t column = 0; column < info_.columns; column += window_columns_) {
        block.column = column;
        block.row = row;
        block.columns = std::min(window_columns_, info_.columns - column);
        block.rows = std::min(window_rows_, info_.rows - row);
        read(block);
        if (!visit(block)) return;
      }
  }

 private:
  void choose_band() {
    const int count = GDALGetRasterCount(dataset_.get());
    constexpr std::array names = {"height", "elevation", "dem", "dsm", "dtm", "z"};
    int chosen = count == 1 ? 1 : 0;
    for (int n = count; n >= 1; --n) {
      const GDALRasterBandH band = GDALGetRasterBand(dataset_.get(), n);
      const std::string name = lower_case(GDALGetDescription(band));
      if (std::find(names.begin(), names.end(), name) != names.end()) chosen = n;
    }
    if (chosen == 0)
      throw Error(
          "no band is named height, elevation, dem, dsm, dtm or z; select one "
          "(gdal_translate -b N)",
          {.field = "bands", .value = std::to_string(count)});
    band_ = GDALGetRasterBand(dataset_.get(), chosen);
    const GDALDataType type = GDALGetRasterDataType(band_);
    info_.band_type = GDALGetDataTypeName(type);
    if (type == GDT_Byte || GDALDataTypeIsComplex(type) != 0 ||
        GDALGetRasterColorTable(band_) != nullptr)
      throw Error(
          "not a type of heights; if these are heights, convert them (gdal_translate -ot Float32)",
          {.field = "type of band " + std::to_string(chosen),
           .value = info_.band_type,
           .bound = "integers of 16 bits or more, or floating point"});
  }

  void choose_window() {
    int columns = 0, rows = 0;
    GDALGetBlockSize(band_, &columns, &rows);
    window_columns_ = std::max(1, columns);
    window_rows_ = std::max(1, rows);
    if (window_columns_ * window_rows_ > max_block_pixels)
      throw Error("too many; convert to tiles (gdal_translate -co TILED=YES -co COMPRESS=DEFLATE)",
                  {.field = "pixels of a strip or tile",
                   .value = std::to_string(window_columns_ * window_rows_),
                   .bound = "<= 2^24"});
    window_rows_ *= std::max<std::int64_t>(1, min_window_pixels / (window_columns_ * window_rows_));
  }

  void georeference(const std::optional<Georeference>& frame) {
    std::array<double, 6> transform{};
    if (GDALGetGeoTransform(dataset_.get(), transform.data()) != CE_None)
      throw Error(
          "none from pixels to coordinates; add one with gdal_translate -a_ullr, or with gdalwarp "
          "from control points",
          {.field = "affine transform"});
    Eigen::Matrix<double, 2, 3> crs_from_pixel;
    crs_from_pixel << transform[1], transform[2], transform[0], transform[4], transform[5],
        transform[3];
    const Eigen::Vector2d center =
        crs_from_pixel * Eigen::Vector3d(0.5 * static_cast<double>(info_.columns),
                                         0.5 * static_cast<double>(info_.rows), 1.0);
    const OGRSpatialReferenceH srs = GDALGetSpatialRef(dataset_.get());
    if (srs != nullptr) read_crs(srs, center);
    Georeference& own = info_.georeference;
    info_.local_from_pixel = own.unit_m * crs_from_pixel;
    const Eigen::Vector2d center_m = own.unit_m * center;
    const double area_m2 = std::abs(info_.local_from_pixel.leftCols<2>().determinant());
    if (!(area_m2 > 1e-12) || !(area_m2 < 1e12) ||
        !(info_.local_from_pixel.cwiseAbs().maxCoeff() < max_position_m) ||
        !(center_m.cwiseAbs().maxCoeff() < max_position_m))
      throw Error("the pixels have no area or are more than 1e8 m from the origin",
                  {.field = "affine transform",
                   .value = "pixels of " + to_text(static_cast<float>(area_m2)) + " m2"});
    height_scale_ = GDALGetRasterScale(band_, nullptr) * height_unit_m(band_, srs);
    height_offset_ = GDALGetRasterOffset(band_, nullptr) * height_unit_m(band_, srs);
    if (frame) {
      require_same_crs(*frame);
      own.origin_m = frame->origin_m;
    } else {
      const auto rounded = [](double value, double step) {
        return step * std::round(value / step);
      };
      own.origin_m = {rounded(center_m.x(), 1000.0), rounded(center_m.y(), 1000.0),
                      rounded(first_height(), 100.0)};
    }
    info_.local_from_pixel.col(2) -= own.origin_m.head<2>();
  }

  void read_crs(OGRSpatialReferenceH srs, const Eigen::Vector2d& center) {
    if (OSRIsGeographic(srs) != 0 || OSRIsGeocentric(srs) != 0)
      throw Error("not a projected CRS, e.g. in degrees; " + utm_remedy(srs, center),
                  {.field = "CRS", .value = OSRGetName(srs) == nullptr ? "" : OSRGetName(srs)});
    const char* const options[] = {"FORMAT=WKT2_2019", "MULTILINE=NO", nullptr};
    char* wkt = nullptr;
    OSRExportToWktEx(srs, &wkt, options);
    info_.georeference.crs_wkt = wkt == nullptr ? "" : wkt;
    CPLFree(wkt);
    info_.georeference.unit_m = OSRGetLinearUnits(srs, nullptr);
    if (!(info_.georeference.unit_m > 1e-6 && info_.georeference.unit_m < 1e6))
      throw Error("not between 1e-6 and 1e6 m",
                  {.field = "unit of the CRS, m", .value = to_text(info_.georeference.unit_m)});
  }

  void require_same_crs(const Georeference& frame) const {
    if (info_.georeference.crs_wkt != frame.crs_wkt || info_.georeference.unit_m != frame.unit_m)
      throw Error("differs from that of the first file of the terrain", {.field = "CRS"});
  }

  double first_height() const {
    double first = 0.0;
    for_each_block([&](const DemBlock& block) {
      const auto height = std::find_if(block.heights_m.begin(), block.heights_m.end(),
                                       [](double one) { return std::isfinite(one); });
      if (height == block.heights_m.end()) return true;
      first = *height;
      return false;
    });
    return first;
  }

  // GDAL reads a block that was never written as zeros.
  bool is_sparse(const DemBlock& block) const {
    const int status = GDALGetDataCoverageStatus(
        band_, static_cast<int>(block.column), static_cast<int>(block.row),
        static_cast<int>(block.columns), static_cast<int>(block.rows), 0, nullptr);
    return (status & GDAL_DATA_COVERAGE_STATUS_EMPTY) != 0 &&
           (status & GDAL_DATA_COVERAGE_STATUS_DATA) == 0;
  }

  void read_window(GDALRasterBandH band, const DemBlock& block, void* values,
                   GDALDataType type) const {
    const int columns = static_cast<int>(block.columns), rows = static_cast<int>(block.rows);
    if (GDALRasterIO(band, GF_Read, static_cast<int>(block.column), static_cast<int>(block.row),
                     columns, rows, values, columns, rows, type, 0, 0) != CE_None)
      throw Error("is truncated or damaged: " + last_message(),
                  {.field = "pixel (" + std::to_string(block.column) + ", " +
                            std::to_string(block.row) + ")"});
  }

  // True for values that customarily mean "no height"; no ground is that deep.
  bool is_undeclared_nodata(double raw) const {
    constexpr std::array customary = {-9999.0, -32768.0, -32767.0, -99999.0, -999999.0};
    return height_scale_ == 1.0 && height_offset_ == 0.0 &&
           std::find(customary.begin(), customary.end(), raw) != customary.end();
  }

  void read(DemBlock& block) const {
    const auto pixels = static_cast<std::size_t>(block.columns * block.rows);
    block.heights_m.assign(pixels, nan_value);
    if (is_sparse(block)) return;
    read_window(band_, block, block.heights_m.data(), GDT_Float64);
    std::vector<std::uint8_t> mask;
    if ((GDALGetMaskFlags(band_) & GMF_ALL_VALID) == 0) {
      mask.resize(pixels);
      read_window(GDALGetMaskBand(band_), block, mask.data(), GDT_Byte);
    }
    for (std::size_t n = 0; n < pixels; ++n) {
      double& height = block.heights_m[n];
      if ((!mask.empty() && mask[n] == 0) || !std::isfinite(height)) {
        height = nan_value;
        continue;
      }
      if (is_undeclared_nodata(height)) {
        height = -std::numeric_limits<double>::infinity();
        continue;
      }
      height = height * height_scale_ + height_offset_;
      if (!(std::abs(height) <= max_height_m))
        throw Error("not a height; if it marks missing data, declare it (gdal_translate -a_nodata)",
                    {.field = "height", .value = to_text(height), .bound = ">= -1e6 and <= 1e6"});
      height -= info_.georeference.origin_m.z();
    }
  }

  Dataset dataset_;
  GDALRasterBandH band_ = nullptr;
  std::int64_t window_columns_ = 1;
  std::int64_t window_rows_ = 1;
  double height_scale_ = 1.0;
  double height_offset_ = 0.0;
  DemInfo info_;
};

void read_dem(const fs::path& path, const std::optional<Georeference>& frame,
              const std::function<void(const DemInfo&)>& head,
              const std::function<void(const DemBlock&)>& block) {
  prepare();
  const Dem dem(path, frame);
  head(dem.info());
  dem.for_each_block([&](const DemBlock& one) {
    block(one);
    return true;
  });
}

void require(bool is_good) {
  if (!is_good) throw Error("cannot be written: " + last_message(), {}, ErrorKind::failed);
}

bool needs_double(const MapRaster& raster) {
  constexpr double kept_m = 1e-5;
  return std::any_of(raster.heights_m.begin(), raster.heights_m.end(), [&](double height) {
    const double in_crs = height + raster.georeference.origin_m.z();
    return std::abs(rounded_to_single(in_crs) - in_crs) > kept_m;
  });
}

void write_georeference(GDALDatasetH dataset, const MapRaster& raster) {
  const Georeference& georeference = raster.georeference;
  Eigen::Matrix<double, 2, 3> crs_from_pixel = raster.frame_from_pixel;
  crs_from_pixel.col(2) += georeference.origin_m.head<2>();
  crs_from_pixel /= georeference.unit_m;
  std::array<double, 6> transform = {crs_from_pixel(0, 2), crs_from_pixel(0, 0),
                                     crs_from_pixel(0, 1), crs_from_pixel(1, 2),
                                     crs_from_pixel(1, 0), crs_from_pixel(1, 1)};
  require(GDALSetGeoTransform(dataset, transform.data()) == CE_None);
  if (georeference.crs_wkt.empty()) return;
  const std::unique_ptr<void, void (*)(OGRSpatialReferenceH)> srs(
      OSRNewSpatialReference(georeference.crs_wkt.c_str()), &OSRDestroySpatialReference);
  if (!srs)
    throw Error("not a coordinate reference system: " + last_message(),
                {.field = "georeference.crs_wkt"});
  OSRSetAxisMappingStrategy(srs.get(), OAMS_TRADITIONAL_GIS_ORDER);
  require(GDALSetSpatialRef(dataset, srs.get()) == CE_None);
}

void write_band(GDALDatasetH dataset, int number, const std::string& name, const std::string& unit,
                const void* values, GDALDataType type) {
  const GDALRasterBandH band = GDALGetRasterBand(dataset, number);
  GDALSetDescription(band, name.c_str());
  if (!unit.empty()) require(GDALSetRasterUnitType(band, unit.c_str()) == CE_None);
  require(GDALSetRasterNoDataValue(band, nan_value) == CE_None);
  const int columns = GDALGetRasterXSize(dataset), rows = GDALGetRasterYSize(dataset);
  // GDAL's C interface takes input by pointers to non-const.
  require(GDALRasterIO(band, GF_Write, 0, 0, columns, rows, const_cast<void*>(values), columns,
                       rows, type, 0, 0) == CE_None);
}

// Adds overviews by nearest neighbor, so that all values are values of the map, also class numbers.
void add_overviews(GDALDatasetH dataset) {
  constexpr int small = 256;
  std::vector<int> factors;
  const int side = std::max(GDALGetRasterXSize(dataset), GDALGetRasterYSize(dataset));
  if (side > 2 * small)
    for (int factor = 2; side / factor >= small / 2; factor *= 2) factors.push_back(factor);
  if (factors.empty()) return;
  require(GDALBuildOverviews(dataset, "NEAREST", static_cast<int>(factors.size()), factors.data(),
                             0, nullptr, nullptr, nullptr) == CE_None);
}

void write_raster(const fs::path& path, const MapRaster& raster) {
  prepare();
  const char* const options[] = {"TILED=YES",        "BLOCKXSIZE=256", "BLOCKYSIZE=256",
                                 "COMPRESS=DEFLATE", "PREDICTOR=3",    "INTERLEAVE=BAND",
                                 "BIGTIFF=IF_SAFER", nullptr};
  Dataset dataset(GDALCreate(GDALGetDriverByName("GTiff"), path.c_str(),
                             static_cast<int>(raster.columns), static_cast<int>(raster.rows),
                             1 + static_cast<int>(raster.bands.size()),
                             needs_double(raster) ? GDT_Float64 : GDT_Float32, options));
  require(dataset != nullptr);
  write_georeference(dataset.get(), raster);
  std::vector<double> heights_m = raster.heights_m;
  for (double& height : heights_m) height += raster.georeference.origin_m.z();
  write_band(dataset.get(), 1, "height", "m", heights_m.data(), GDT_Float64);
  int number = 1;
  for (const RasterBand& band : raster.bands)
    write_band(dataset.get(), ++number, band.name, band.unit, band.values.data(), GDT_Float32);
  GDALFlushCache(dataset.get());
  add_overviews(dataset.get());
  dataset.reset();
  // Closing writes data, which can fail.
  require(CPLGetLastErrorType() != CE_Failure);
}

}  // namespace

extern "C" const RasterModule graspmap_raster_module;
const RasterModule graspmap_raster_module = {&read_dem, &write_raster};

}  // namespace libmap
