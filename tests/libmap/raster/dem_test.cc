#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/cloud_tiles.h"
#include "libmap/io/mesh_io.h"
#include "libmap/raster/dem_reader.h"
#include "tests/libmap/raster/gdal_programs.h"

namespace dem_test {

namespace fs = std::filesystem;
using graspmap_test::AsciiGrid;
using graspmap_test::error_of;
using graspmap_test::gdal;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::write_dem;
using libmap::PointCloud;

// 4 x 3 pixels of 2 m in UTM zone 33N, one without a height.
AsciiGrid small_grid() {
  return {.west = 451234.5,
          .south = 5412345.25,
          .pixel = 2.0,
          .rows = {{812.5, 812.625, 813, 814}, {811, 810, -9999, 815}, {809, 808, 807.125, 816}}};
}

const std::vector<std::string> utm = {"-a_srs", "EPSG:32633"};

// Position in the CRS.
Eigen::Vector3d in_crs(const libmap::Georeference& georeference, const Eigen::Vector3d& local) {
  return local + georeference.origin_m;
}

TEST(Dem, PixelCentersKeepTheirPlaceAndHeight) {
  const fs::path file = write_dem("dem.tif", small_grid(), utm);
  const auto georeference = libmap::read_georeference(file).value();
  EXPECT_NE(georeference.crs_wkt.find("32633"), std::string::npos);
  EXPECT_EQ(georeference.unit_m, 1.0);
  EXPECT_EQ(georeference.origin_m, Eigen::Vector3d(451000, 5412000, 800));
  const PointCloud cloud = libmap::read_cloud(file).cloud;
  ASSERT_EQ(cloud.size(), 11U);
  EXPECT_EQ(in_crs(georeference, cloud.positions[0]), Eigen::Vector3d(451235.5, 5412350.25, 812.5));
  EXPECT_EQ(in_crs(georeference, cloud.positions[6]), Eigen::Vector3d(451241.5, 5412348.25, 815));
  EXPECT_EQ(in_crs(georeference, cloud.positions[9]),
            Eigen::Vector3d(451239.5, 5412346.25, 807.125));
}

// As in many rasters, -9999 means no height, but is not declared as nodata.
TEST(Dem, UndeclaredNodataIsDroppedAndCounted) {
  AsciiGrid grid = small_grid();
  grid.rows[0][0] = -9999;
  const fs::path declared = write_dem("declared.tif", grid, utm);
  std::vector<std::string> words = utm;
  words.insert(words.end(), {"-a_nodata", "none"});
  const fs::path undeclared = write_dem("undeclared.tif", grid, words);
  EXPECT_EQ(libmap::read_cloud(declared).dropped_points, 0U);
  const libmap::CloudReadResult read = libmap::read_cloud(undeclared);
  EXPECT_EQ(read.dropped_points, 2U);
  EXPECT_EQ(read.cloud.positions, libmap::read_cloud(declared).cloud.positions);
  EXPECT_EQ(libmap::read_tile_info(undeclared).dropped_points, 2U);
  EXPECT_EQ(libmap::read_tile_info(undeclared).points, 10U);
  EXPECT_EQ(libmap::read_mesh(undeclared).mesh.vertices, libmap::read_mesh(declared).mesh.vertices);
}

TEST(Dem, TilesStripsAndPixelIsPointAreTheSamePoints) {
  AsciiGrid grid{.west = 100, .south = 50, .pixel = 0.5, .rows = {}};
  for (int row = 0; row < 70; ++row) {
    auto& heights = grid.rows.emplace_back();
    for (int column = 0; column < 90; ++column)
      heights.push_back((row * column) % 7 == 3 ? -9999 : std::sin(0.1 * row) + 0.01 * column);
  }
  const auto sorted = [](PointCloud cloud) {
    std::sort(cloud.positions.begin(), cloud.positions.end(), [](const auto& a, const auto& b) {
      return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
    });
    return cloud.positions;
  };
  const auto strips = sorted(libmap::read_dem_cloud(write_dem("strips.tif", grid)));
  EXPECT_LT(strips.size(), 70U * 90U);
  EXPECT_GT(strips.size(), 5000U);
  const std::vector<std::vector<std::string>> layouts = {
      {"-co", "TILED=YES", "-co", "BLOCKXSIZE=32", "-co", "BLOCKYSIZE=16", "-co", "COMPRESS=LZW"},
      {"-mo", "AREA_OR_POINT=Point"},
      {"-co", "BLOCKYSIZE=70", "-co", "COMPRESS=DEFLATE"}};
  for (const auto& layout : layouts)
    EXPECT_EQ(sorted(libmap::read_dem_cloud(write_dem("layout.tif", grid, layout))), strips);
}

// A VRT can have any affine transform, unit, scale and offset; gdal_translate converts it to
// GeoTIFF.
fs::path write_transformed(const std::string& name, const std::string& transform,
                           const std::string& band = "", std::vector<std::string> words = {}) {
  write_dem("source.tif", {.rows = {{0, 1}, {2, 4}, {3, 9}}});
  graspmap_test::write_text(
      scratch_folder() / "made.vrt",
      "<VRTDataset rasterXSize=\"2\" rasterYSize=\"3\"><GeoTransform>" + transform +
          "</GeoTransform><VRTRasterBand dataType=\"Float64\" band=\"1\">" + band +
          "<SimpleSource><SourceFilename relativeToVRT=\"1\">source.tif</SourceFilename>"
          "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>");
  words.insert(words.begin(), {"gdal_translate", "-q"});
  words.insert(words.end(), {"made.vrt", name});
  gdal(words);
  return scratch_folder() / name;
}

TEST(Dem, ARotatedTransformIsUsed) {
  // Columns go north, rows go east.
  const PointCloud cloud =
      libmap::read_dem_cloud(write_transformed("turned.tif", "10, 0, 3, 20, 2, 0"));
  EXPECT_EQ(cloud.positions[0], Eigen::Vector3d(11.5, 21, 0));
  EXPECT_EQ(cloud.positions[1], Eigen::Vector3d(11.5, 23, 1));
  EXPECT_EQ(cloud.positions[4], Eigen::Vector3d(17.5, 21, 3));
}

TEST(Dem, UnitsScaleAndOffsetOfHeights) {
  const std::string band = "<UnitType>ft</UnitType><Offset>100</Offset><Scale>10</Scale>";
  const fs::path file = write_transformed("feet.tif", "0, 1, 0, 3, 0, -1", band,
                                          {"-a_srs", "EPSG:2225"});  // US survey feet
  const auto georeference = libmap::read_georeference(file).value();
  EXPECT_NEAR(georeference.unit_m, 1200.0 / 3937.0, 1e-12);
  const PointCloud cloud = libmap::read_dem_cloud(file);
  EXPECT_NEAR(in_crs(georeference, cloud.positions[3]).z(), 0.3048 * (100 + 10 * 4), 1e-9);
  EXPECT_NEAR(in_crs(georeference, cloud.positions[3]).x(), 1.5 * 1200.0 / 3937.0, 1e-9);
}

// Area and normals in closed form: a plane that rises by 1/2 to the east.
TEST(Dem, MeshOfAPlaneFacesUpWhereverRowsLead) {
  for (const char* transform : {"0, 1, 0, 3, 0, -1", "0, 1, 0, 0, 0, 1", "9, 0, 1, 3, 1, 0"}) {
    const fs::path file = write_transformed("any.tif", transform);
    const libmap::TriangleMesh mesh = libmap::read_mesh(file).mesh;
    EXPECT_EQ(mesh.vertices.size(), 6U);
    EXPECT_EQ(mesh.triangles.size(), 4U);
    for (const libmap::Triangle& triangle : mesh.triangles)
      EXPECT_GT(libmap::area_normal(mesh, triangle).z(), 0.0) << transform;
  }
  AsciiGrid plane{.pixel = 2.0, .rows = {}};
  for (int row = 0; row < 6; ++row) {
    auto& heights = plane.rows.emplace_back();
    for (int column = 0; column < 5; ++column) heights.push_back(column);
  }
  EXPECT_NEAR(libmap::surface_area(libmap::read_dem_mesh(write_dem("plane.tif", plane))),
              8 * 10 * std::sqrt(1.25), 1e-9);
  plane.rows[0][0] = plane.rows[3][2] = -9999;  // a corner; one inside
  EXPECT_EQ(libmap::read_dem_mesh(write_dem("holes.tif", plane)).triangles.size(), 2U * 20 - 1 - 4);
}

TEST(Dem, TheDiagonalIsTheSmallerStep) {
  // A diagonal ridge: its ends, 5 and 5, are connected.
  const AsciiGrid ridge{.rows = {{5, 0}, {1, 5}}};
  const libmap::TriangleMesh mesh = libmap::read_dem_mesh(write_dem("ridge.tif", ridge));
  ASSERT_EQ(mesh.triangles.size(), 2U);
  for (const libmap::Triangle& triangle : mesh.triangles) {
    EXPECT_EQ(std::count(triangle.begin(), triangle.end(), 0U), 1);
    EXPECT_EQ(std::count(triangle.begin(), triangle.end(), 3U), 1);
  }
}

TEST(Dem, PiecesShareTheFrameOfTheFirst) {
  fs::create_directory(scratch_folder() / "pieces");
  AsciiGrid grid = small_grid();
  const fs::path first = write_dem("pieces/a.tif", grid, utm);
  grid.west += 5000.0;  // its own offset would differ
  const fs::path second = write_dem("pieces/b.tif", grid, utm);
  const auto pieces = libmap::cloud_tiles(scratch_folder() / "pieces");
  ASSERT_EQ(pieces.size(), 2U);
  const PointCloud cloud = libmap::read_tiles(pieces).cloud;
  ASSERT_EQ(cloud.size(), 22U);
  EXPECT_EQ(cloud.positions[11] - cloud.positions[0], Eigen::Vector3d(5000, 0, 0));
  EXPECT_EQ(libmap::read_cloud(scratch_folder() / "pieces").cloud.positions, cloud.positions);
  const auto given = libmap::read_georeference(second);
  EXPECT_EQ(libmap::read_cloud(scratch_folder() / "pieces", given).cloud.positions[11],
            libmap::read_cloud(second).cloud.positions[0]);
  PointCloud indexed;
  libmap::TileIndex index(pieces,
                          [&](const PointCloud& tile) { libmap::append_cloud(tile, indexed); });
  EXPECT_EQ(indexed.positions, cloud.positions);
  EXPECT_EQ(index.points_in({-1e6, -1e6}, {1e6, 1e6}).positions, cloud.positions);
  EXPECT_EQ(libmap::read_georeference(scratch_folder() / "pieces"),
            libmap::read_georeference(first));
  const auto box = libmap::read_tile_info(second, libmap::read_georeference(first)).box;
  EXPECT_EQ(box.min.x(), cloud.positions[11].x());
  libmap::write_cloud(scratch_folder() / "pieces/c.pcd", cloud);
  EXPECT_EQ(error_of([] { libmap::read_tiles(libmap::cloud_tiles(scratch_folder() / "pieces")); })
                .context()
                .file,
            (scratch_folder() / "pieces/c.pcd").string());
  EXPECT_EQ(error_of([] { libmap::read_cloud(scratch_folder() / "pieces"); }).context().file,
            (scratch_folder() / "pieces/c.pcd").string());
  fs::remove(scratch_folder() / "pieces/c.pcd");
  write_dem("pieces/c.tif", grid, {"-a_srs", "EPSG:32632"});
  EXPECT_EQ(error_of([] { libmap::read_tiles(libmap::cloud_tiles(scratch_folder() / "pieces")); })
                .context()
                .field,
            "CRS");
}

struct BadDem {
  std::string name;
  std::vector<std::string> words;
  std::string field;   // field of the error
  std::string remedy;  // part of its text
};
void PrintTo(const BadDem& bad, std::ostream* out) { *out << bad.name; }
class BadDems : public testing::TestWithParam<BadDem> {};

TEST_P(BadDems, NameFileFieldAndRemedy) {
  const fs::path file = write_dem("bad.tif", small_grid(), GetParam().words);
  const libmap::Error error = error_of([&] { libmap::read_cloud(file); });
  EXPECT_EQ(error.context().file, file.string());
  EXPECT_EQ(error.context().field, GetParam().field) << error.what();
  EXPECT_NE(std::string(error.what()).find(GetParam().remedy), std::string::npos) << error.what();
}

INSTANTIATE_TEST_SUITE_P(
    All, BadDems,
    testing::Values(
        BadDem{"degrees",
               {"-a_srs", "EPSG:4326", "-a_ullr", "13.5", "48", "13.6", "47"},
               "CRS",
               "gdalwarp -t_srs EPSG:32633"},
        BadDem{"south",
               {"-a_srs", "EPSG:4326", "-a_ullr", "-70.1", "-33", "-70", "-34"},
               "CRS",
               "EPSG:32719"},
        BadDem{"byte", {"-ot", "Byte"}, "type of band 1", "-ot Float32"},
        BadDem{"complex", {"-ot", "CFloat32"}, "type of band 1", "floating point"},
        BadDem{"bands", {"-b", "1", "-b", "1", "-b", "1"}, "bands", "gdal_translate -b"},
        BadDem{"nodata not declared",
               {"-a_nodata", "none", "-scale", "0", "1", "0", "-1e37"},
               "height",
               "-a_nodata"},
        BadDem{"points of no area",
               {"-a_ullr", "5", "7", "5.0000000000001", "6"},
               "affine transform",
               "no area"},
        BadDem{"far", {"-a_ullr", "5e12", "7", "5.1e12", "6"}, "affine transform", "1e8 m"}),
    [](const auto& of) {
      std::string name = of.param.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST(Dem, WithoutATransformThePlaceIsNotKnown) {
  write_dem("dem.tif", small_grid());
  gdal({"gdal_translate", "-q", "-co", "PROFILE=BASELINE", "dem.tif", "plain.tif"});
  const libmap::Error error = error_of([] { libmap::read_cloud(scratch_folder() / "plain.tif"); });
  EXPECT_TRUE(is_error(error, {.field = "affine transform"}));
  EXPECT_TRUE(is_error(error, {.field = "affine transform"}));
}

TEST(Dem, ABlockThatWasNeverWrittenHasNoHeights) {
  write_dem("dem.tif", small_grid());
  gdal({"gdal_translate", "-q", "-a_nodata", "none", "-scale", "0", "1", "0", "0", "-co",
        "SPARSE_OK=TRUE", "dem.tif", "sparse.tif"});
  EXPECT_TRUE(libmap::read_dem_cloud(scratch_folder() / "sparse.tif").empty());
}

TEST(Dem, TruncatedAndForeignFilesAreErrors) {
  const std::string whole = graspmap_test::read_text(write_dem("dem.tif", small_grid(), utm));
  const fs::path file = scratch_folder() / "cut.tif";
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 29) {
    graspmap_test::write_text(file, whole.substr(0, bytes));
    const libmap::Error error = error_of([&] { libmap::read_mesh(file); });
    EXPECT_EQ(error.context().file, file.string()) << bytes;
    EXPECT_EQ(error.kind(), libmap::ErrorKind::bad_input);
  }
  graspmap_test::write_text(file, "ncols 1\nnrows 1\n");  // format of another driver of GDAL
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_cloud(file); }), {.file = file}));
}

TEST(Dem, AnEndlessRasterIsRefusedBeforeItIsRead) {
  gdal({"gdal_create", "-q",
        "-of",         "GTiff",
        "-ot",         "Float32",
        "-outsize",    "100000",
        "100000",      "-a_ullr",
        "0",           "100000",
        "100000",      "0",
        "-co",         "SPARSE_OK=TRUE",
        "-co",         "BIGTIFF=YES",
        "-co",         "TILED=YES",
        "-co",         "BLOCKXSIZE=16384",
        "-co",         "BLOCKYSIZE=16384",
        "huge.tif"});
  EXPECT_EQ(error_of([] { libmap::read_cloud(scratch_folder() / "huge.tif"); }).context().field,
            "pixels");
}

}  // namespace dem_test
