// DEMs as terrains, and maps for GIS, through the commands.
#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "tests/libmap/raster/gdal_programs.h"
#include "tests/tools/tool_test_support.h"

namespace raster_test {

using graspmap_test::AsciiGrid;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::gdal_values;
using graspmap_test::gdalinfo;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_dem;
using Words = std::vector<std::string>;

constexpr double west = 451234.5, south = 5412345.25, top_east = 0.44, top_north = 0.36;

// Ground at 800 m that rises by `slope` to the east, with a knob of 6 cm at (top_east, top_north).
AsciiGrid knob(double slope = 0.0) {
  AsciiGrid grid{.west = west, .south = south, .pixel = 0.01, .rows = {}};
  for (int row = 79; row >= 0; --row) {
    auto& heights = grid.rows.emplace_back();
    for (int column = 0; column < 80; ++column) {
      const double x = 0.01 * (column + 0.5), y = 0.01 * (row + 0.5);
      const double d = std::hypot(x - top_east, y - top_north);
      heights.push_back(800.0 + slope * x + std::sqrt(std::max(0.0, 0.0036 - d * d)));
    }
  }
  return grid;
}

const Words utm = {"-a_srs", "EPSG:32633"};
const Words score = {"--voxel-size", "0.01", "--method", "corrected", "--curvature-radius", "0"};

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// Easting, northing and height of the highest pixels, the mean of those equally high: heights of a
// map are those of voxels.
Eigen::Vector3d highest(const std::string& file) {
  const auto heights = gdal_values(file, 1);
  const auto transform = gdalinfo(file).at("geoTransform").get<std::vector<double>>();
  const auto columns = gdalinfo(file).at("size")[0].get<std::size_t>();
  double best = -HUGE_VAL;
  for (const double height : heights)
    if (height > best) best = height;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (std::size_t n = 0; n < heights.size(); ++n) {
    if (!(heights[n] > best - 1e-3)) continue;
    const double column = static_cast<double>(n % columns) + 0.5;
    const double row = static_cast<double>(n / columns) + 0.5;
    sum += Eigen::Vector3d(transform[0] + transform[1] * column + transform[2] * row,
                           transform[3] + transform[4] * column + transform[5] * row, heights[n]);
    ++count;
  }
  return sum / count;
}

TEST(Raster, AMapIsWhereItsDemIs) {
  write_dem("dem.tif", knob(), utm);
  ASSERT_TRUE(succeeded(graspmap(with({"score", "dem.tif", "-o", "map.pcd"}, score))));
  const auto manifest = json_of("map.pcd.json");
  EXPECT_EQ(manifest["georeference"]["origin_m"], nlohmann::json({451000, 5412000, 800}));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "map.tif"})));
  const auto info = gdalinfo("map.tif");
  EXPECT_EQ(info["stac"]["proj:epsg"], 32633);
  const Eigen::Vector3d found = highest("map.tif");
  EXPECT_NEAR(found.x(), west + top_east, 0.012);  // to a voxel
  EXPECT_NEAR(found.y(), south + top_north, 0.012);
  EXPECT_NEAR(found.z(), 800.06, 0.012);
  // Bands are the map's fields.
  const libmap::PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  Words bands = {"height"};
  for (const libmap::ScalarField& field : map.fields)
    if (field.name.size() > 1) bands.push_back(field.name);
  ASSERT_EQ(info["bands"].size(), bands.size());
  for (std::size_t n = 0; n < bands.size(); ++n)
    EXPECT_EQ(info["bands"][n]["description"], bands[n]);
  double best = 0.0;
  for (const double value : map.find_field("score")->values) best = std::max(best, value);
  double best_in_raster = 0.0;
  for (const double value : gdal_values("map.tif", 2))
    if (!std::isnan(value)) best_in_raster = std::max(best_in_raster, value);
  EXPECT_EQ(best_in_raster, best);
}

// Undeclared -9999 is dropped; other values for "no height" turn the plane and are refused.
TEST(Raster, HeightsThatWereNotMeasured) {
  AsciiGrid grid = knob();
  for (std::size_t row = 0; row < 20; ++row)
    for (std::size_t column = 0; column < 20; ++column) grid.rows[row][column] = -9999;
  const Words undeclared = with(utm, {"-a_nodata", "none"});
  write_dem("dem.tif", grid, undeclared);
  for (const std::string map : {"map.pcd", "map.tiles"}) {
    const auto result = graspmap(with({"score", "dem.tif", "-o", map}, score));
    ASSERT_TRUE(succeeded(result));
    EXPECT_TRUE(warned(result, {"dem.tif", "400 points"}));
  }
  const auto manifest = json_of("map.pcd.json");
  EXPECT_EQ(manifest["results"]["input_points"], 6000);
  EXPECT_EQ(manifest["results"]["up_source"], "direction");
  for (std::size_t row = 0; row < 20; ++row)
    for (std::size_t column = 0; column < 20; ++column) grid.rows[row][column] = 0;
  write_dem("zeros.tif", grid, undeclared);
  EXPECT_TRUE(bad_input(graspmap(with({"score", "zeros.tif", "-o", "zeros.pcd"}, score)),
                        {.file = "zeros.tif",
                         .field = "tilt of the plane",
                         .value = "90.0 deg",
                         .bound = "<= 75 deg"}));
}

// Ground that leans by 20 degrees: the fitted frame leans too, but not the raster.
TEST(Raster, AFittedPlaneDoesNotMoveTheMap) {
  const double slope = std::tan(20.0 * M_PI / 180.0);
  write_dem("dem.tif", knob(slope), utm);
  ASSERT_TRUE(succeeded(graspmap(with({"score", "dem.tif", "-o", "map.pcd"}, score))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "map.tif"})));
  const auto transform = gdalinfo("map.tif").at("geoTransform").get<std::vector<double>>();
  EXPECT_NEAR(std::hypot(transform[1], transform[4]), 0.01, 1e-9);
  const auto heights = gdal_values("map.tif", 1);
  const auto columns = gdalinfo("map.tif").at("size")[0].get<std::size_t>();
  std::size_t on_ground = 0, pixels = 0;
  for (std::size_t n = 0; n < heights.size(); ++n) {
    if (std::isnan(heights[n])) continue;
    const double column = static_cast<double>(n % columns) + 0.5;
    const double row = static_cast<double>(n / columns) + 0.5;
    const double x = transform[0] + transform[1] * column + transform[2] * row - west;
    const double y = transform[3] + transform[4] * column + transform[5] * row - south;
    if (std::hypot(x - top_east, y - top_north) < 0.1) continue;
    ++pixels;
    on_ground += std::abs(heights[n] - 800.0 - slope * x) < 0.015 ? 1 : 0;
  }
  EXPECT_GT(pixels, 500U);
  EXPECT_EQ(on_ground, pixels);
}

TEST(Raster, TheGeoreferenceIsCarriedThroughCropMeshAndTiles) {
  write_dem("dem.tif", knob(), utm);
  ASSERT_TRUE(succeeded(graspmap({"crop", "dem.tif", "--size", "0.7x0.7", "-o", "site.ply"})));
  ASSERT_TRUE(
      succeeded(graspmap({"resample", "site.ply", "--radius", "0.004", "-o", "terrain.pcd"})));
  ASSERT_TRUE(succeeded(
      graspmap(with({"score", "terrain.pcd", "--tile-size", "0.2", "-o", "map.tiles"}, score))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles", "-o", "tiles.tif"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles", "-o", "merged.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "merged.pcd", "-o", "merged.tif"})));
  EXPECT_EQ(content("tiles.tif"), content("merged.tif"));
  const Eigen::Vector3d found = highest("merged.tif");
  EXPECT_NEAR(found.x(), west + top_east, 0.015);
  EXPECT_NEAR(found.y(), south + top_north, 0.015);
  EXPECT_NEAR(found.z(), 800.06, 0.012);
}

// Pieces of a DEM in blocks, in a store, and the DEM as a whole.
TEST(Raster, PiecesInAStoreAreTheWholeDem) {
  write_dem("dem.tif", knob(), utm);
  std::filesystem::create_directory(scratch("pieces"));
  graspmap_test::gdal(
      {"gdal_translate", "-q", "-srcwin", "0", "0", "80", "37", "dem.tif", "pieces/a.tif"});
  graspmap_test::gdal(
      {"gdal_translate", "-q", "-srcwin", "0", "37", "80", "43", "dem.tif", "pieces/b.tif"});
  const Words plane = {"--plane", "none"};
  ASSERT_TRUE(succeeded(graspmap(with(with({"score", "dem.tif", "-o", "map.pcd"}, score), plane))));
  ASSERT_TRUE(
      succeeded(graspmap(with(with({"score", "pieces", "-o", "map.tiles"}, score), plane))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles", "-o", "merged.pcd"})));
  EXPECT_EQ(content("merged.pcd"), content("map.pcd"));
  EXPECT_EQ(json_of("merged.pcd.json")["georeference"], json_of("map.pcd.json")["georeference"]);
  // A piece before the first one would move all tiles.
  graspmap_test::gdal({"gdal_translate", "-q", "-a_ullr", "461234", "5412346", "461235", "5412345",
                       "dem.tif", "pieces/0.tif"});
  EXPECT_TRUE(bad_input(
      graspmap(with(with({"score", "pieces", "--append", "-o", "map.tiles"}, score), plane)),
      {.file = "map.tiles"}));
}

TEST(Raster, ADemIsAMeshForGrasp) {
  write_dem("dem.tif", knob(), utm);
  // In the DEM's local frame.
  graspmap_test::write_text(scratch("points.csv"), "place,x,y,z\nknob,234.94,345.61,0.06\n");
  ASSERT_TRUE(succeeded(graspmap({"grasp", "dem.tif", "--points", "points.csv", "--trials", "2",
                                  "--draws", "2", "-o", "trials.csv"})));
  EXPECT_NE(content("trials.csv").find("knob"), std::string::npos);
}

TEST(Raster, CloudsNeedAPixelSize) {
  graspmap_test::write_terrain();
  EXPECT_TRUE(bad_input(graspmap({"convert", "terrain.pcd", "-o", "a.tif"}),
                        {.file = "terrain.pcd", .field = "--pixel-size"}));
  ASSERT_TRUE(
      succeeded(graspmap({"convert", "terrain.pcd", "--pixel-size", "0.01", "-o", "a.tif"})));
  EXPECT_EQ(gdalinfo("a.tif")["size"], nlohmann::json({60, 60}));
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.tif", "-o", "again.pcd"})));
  EXPECT_EQ(libmap::read_cloud(scratch("again.pcd")).cloud.size(), 3600U);
  EXPECT_TRUE(bad_input(graspmap({"convert", "terrain.pcd", "--pixel-size", "0.01", "-o", "b.ply"}),
                        {.file = "b.ply", .field = "--pixel-size"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.tif", "-o", "b.tif"}), {.file = "a.tif"}));
}

}  // namespace raster_test
