#include "libmap/raster/map_raster.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/raster/dem_reader.h"
#include "tests/libmap/raster/gdal_programs.h"

namespace map_raster_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::gdal_values;
using graspmap_test::gdalinfo;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using libmap::MapRaster;
using libmap::PointCloud;
using libmap::RasterGrid;

MapRaster raster_of(const PointCloud& cloud, const RasterGrid& grid) {
  return libmap::make_map_raster([&](const auto& visit) { visit(cloud); }, grid);
}

// Voxels of 0.1 m at (i, j, k), with a score and a force.
PointCloud voxels(const std::vector<std::array<int, 3>>& places) {
  PointCloud cloud;
  for (const auto& [i, j, k] : places)
    cloud.positions.emplace_back(0.1 * (i + 0.5), 0.1 * (j + 0.5), 0.1 * (k + 0.5));
  for (const char* name : {"score", "i", "force_n", "slope_deg"})
    cloud.add_field(name, libmap::ScalarType::float32);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    cloud.find_field("score")->values[n] = 0.25 * static_cast<double>(n);
    cloud.find_field("force_n")->values[n] = 10.0 + static_cast<double>(n);
    cloud.find_field("slope_deg")->values[n] = NAN;
  }
  return cloud;
}

TEST(MapRaster, TheTopmostVoxelOfAColumnCounts) {
  const MapRaster raster =
      raster_of(voxels({{2, 5, 0}, {2, 5, 3}, {2, 5, 1}, {4, 6, -2}}), {.pixel_size_m = 0.1});
  ASSERT_EQ(raster.columns, 3);
  ASSERT_EQ(raster.rows, 2);
  ASSERT_EQ(raster.bands.size(), 3U);
  EXPECT_EQ(raster.bands[0].name, "score");
  EXPECT_EQ(raster.bands[1].name, "force_n");
  EXPECT_EQ(raster.bands[1].unit, "N");
  EXPECT_EQ(raster.bands[2].unit, "deg");
  EXPECT_NEAR(raster.heights_m[3], 0.35, 1e-12);  // row 1, column 0: j 5, i 2
  EXPECT_EQ(raster.bands[0].values[3], 0.25F);
  EXPECT_NEAR(raster.heights_m[2], -0.15, 1e-12);
  EXPECT_EQ(raster.bands[0].values[2], 0.75F);
  for (const std::size_t empty : {0U, 1U, 4U, 5U}) {
    EXPECT_TRUE(std::isnan(raster.heights_m[empty]));
    EXPECT_TRUE(std::isnan(raster.bands[0].values[empty]));
  }
}

// Points in parts; pixels and points are both rotated by 30 degrees.
TEST(MapRaster, TurnedPointsOnTurnedPixelsAreTheSameRaster) {
  const PointCloud cloud = voxels({{0, 0, 0}, {3, 1, 0}, {3, 1, 2}, {7, 9, 1}});
  const MapRaster level = raster_of(cloud, {.pixel_size_m = 0.1});
  RasterGrid grid{.pixel_size_m = 0.1};
  grid.frame_from_points =
      Eigen::Translation3d(40, -7, 2) * Eigen::AngleAxisd(M_PI / 6, Eigen::Vector3d::UnitZ());
  grid.corner_m = grid.frame_from_points.translation().head<2>();
  grid.column_axis = {std::cos(M_PI / 6), std::sin(M_PI / 6)};
  const MapRaster turned = libmap::make_map_raster(
      [&](const auto& visit) {
        visit(libmap::select_points(cloud, {0, 1}));
        visit(PointCloud{});
        visit(libmap::select_points(cloud, {2, 3}));
      },
      grid);
  ASSERT_EQ(turned.columns, level.columns);
  ASSERT_EQ(turned.rows, level.rows);
  for (std::size_t n = 0; n < level.heights_m.size(); ++n) {
    ASSERT_EQ(std::isnan(turned.heights_m[n]), std::isnan(level.heights_m[n]));
    if (!std::isnan(level.heights_m[n])) {
      EXPECT_NEAR(turned.heights_m[n], level.heights_m[n] + 2.0, 1e-12);
    }
  }
  // Centers of pixels are the points.
  const Eigen::Vector2d center = turned.frame_from_pixel * Eigen::Vector3d(3.5, 8.5, 1.0);
  EXPECT_LT((center - (grid.frame_from_points * cloud.positions[1]).head<2>()).norm(), 1e-9);
}

libmap::Georeference utm_33() {
  graspmap_test::write_dem("crs.tif", {.rows = {{1, 2}, {3, 4}}}, {"-a_srs", "EPSG:32633"});
  auto georeference = libmap::read_georeference(scratch_folder() / "crs.tif").value();
  georeference.origin_m = {451000, 5412000, 800};
  return georeference;
}

TEST(MapRaster, GdalReadsValuesPlacesUnitsAndCrs) {
  MapRaster raster = raster_of(voxels({{2, 5, 0}, {2, 5, 3}, {4, 6, -2}}), {.pixel_size_m = 0.1});
  raster.georeference = utm_33();
  libmap::write_map_raster(scratch_folder() / "map.tif", raster);
  const auto info = gdalinfo("map.tif");
  EXPECT_EQ(info.at("stac").at("proj:epsg"), 32633);
  const auto& transform = info.at("geoTransform");
  const std::vector<double> expected = {451000.2, 0.1, 0, 5412000.7, 0, -0.1};
  for (std::size_t n = 0; n < 6; ++n) EXPECT_NEAR(transform[n].get<double>(), expected[n], 1e-9);
  ASSERT_EQ(info.at("bands").size(), 4U);
  EXPECT_EQ(info["bands"][0]["description"], "height");
  EXPECT_EQ(info["bands"][0]["unit"], "m");
  EXPECT_EQ(info["bands"][1]["description"], "score");
  EXPECT_EQ(info["bands"][2]["unit"], "N");
  EXPECT_EQ(info["bands"][0]["noDataValue"], "NaN");
  const auto heights = gdal_values("map.tif", 1);
  const auto scores = gdal_values("map.tif", 2);
  ASSERT_EQ(heights.size(), 6U);
  EXPECT_NEAR(heights[3], 800.35, 1e-9);  // float64: float32 would be off by 2e-5 m
  EXPECT_EQ(scores[3], 0.25);
  EXPECT_TRUE(std::isnan(scores[0]));
  // The raster can be read as a terrain.
  const PointCloud back = libmap::read_dem_cloud(scratch_folder() / "map.tif");
  ASSERT_EQ(back.size(), 2U);
  EXPECT_LT((back.positions[0] - Eigen::Vector3d(0.45, 0.65, -0.15)).norm(), 1e-7);
}

TEST(MapRaster, ARotatedTransformIsWritten) {
  RasterGrid grid{.pixel_size_m = 0.1};
  grid.column_axis = {0.6, 0.8};
  libmap::write_map_raster(scratch_folder() / "map.tif",
                           raster_of(voxels({{0, 0, 0}, {3, 1, 0}}), grid));
  const auto info = gdalinfo("map.tif");
  EXPECT_NEAR(info["geoTransform"][1].get<double>(), 0.06, 1e-12);
  EXPECT_NEAR(info["geoTransform"][2].get<double>(), 0.08, 1e-12);
  EXPECT_NEAR(info["geoTransform"][4].get<double>(), 0.08, 1e-12);
  EXPECT_NEAR(info["geoTransform"][5].get<double>(), -0.06, 1e-12);
  EXPECT_FALSE(info.contains("coordinateSystem"));
  EXPECT_EQ(info["bands"][0]["type"], "Float32");
}

TEST(MapRaster, LargeOnesHaveTilesAndOverviews) {
  PointCloud cloud;
  for (int i = 0; i < 700; ++i)
    for (int j = 0; j < 300; ++j) cloud.positions.emplace_back(i + 0.5, j + 0.5, 0.25 * (i % 5));
  libmap::write_map_raster(scratch_folder() / "a.tif", raster_of(cloud, {.pixel_size_m = 1.0}));
  libmap::write_map_raster(scratch_folder() / "b.tif", raster_of(cloud, {.pixel_size_m = 1.0}));
  const auto info = gdalinfo("a.tif");
  EXPECT_EQ(info["bands"][0]["block"], nlohmann::json({256, 256}));
  ASSERT_EQ(info["bands"][0]["overviews"].size(), 2U);
  EXPECT_EQ(info["bands"][0]["overviews"][0]["size"], nlohmann::json({350, 150}));
  EXPECT_EQ(graspmap_test::read_text(scratch_folder() / "a.tif"),
            graspmap_test::read_text(scratch_folder() / "b.tif"));
  const auto heights = gdal_values("a.tif", 1);
  ASSERT_EQ(heights.size(), 700U * 300U);
  for (std::size_t n = 0; n < heights.size(); ++n)
    ASSERT_EQ(heights[n], 0.25 * static_cast<double>(n % 700 % 5));
}

TEST(MapRaster, BadInput) {
  EXPECT_TRUE(is_error(error_of([] { raster_of({}, {.pixel_size_m = 0.1}); }),
                       {.field = "points of the input"}));
  PointCloud far = voxels({{0, 0, 0}, {1, 1, 1}});
  far.positions[1] = {4e6, 4e6, 0};
  EXPECT_EQ(error_of([&] { raster_of(far, {.pixel_size_m = 0.1}); }).context().field,
            "pixel_size_m");
  EXPECT_EQ(error_of([&] { raster_of(far, {.pixel_size_m = 1e-9}); }).context().field,
            "pixel_size_m");
  MapRaster raster = raster_of(voxels({{0, 0, 0}}), {.pixel_size_m = 0.1});
  raster.georeference.crs_wkt = "PROJCRS[\"nonsense\"]";
  EXPECT_EQ(
      error_of([&] { write_map_raster(scratch_folder() / "map.tif", raster); }).context().field,
      "georeference.crs_wkt");
  raster.georeference.crs_wkt.clear();
  const auto nowhere = scratch_folder() / "no/map.tif";
  EXPECT_TRUE(is_error(error_of([&] { write_map_raster(nowhere, raster); }),
                       {.file = nowhere, .kind = libmap::ErrorKind::failed}));
}

}  // namespace map_raster_test
