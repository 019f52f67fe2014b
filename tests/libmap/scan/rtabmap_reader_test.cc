#include "libmap/scan/rtabmap_reader.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/parallel.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/scan_verification.h"
#include "tests/libmap/scan/sample_checks.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace rtabmap_reader_test {

namespace fs = std::filesystem;
using libmap::LinkType;
using libmap::PoseLink;
using libmap::RgbdFrame;
using libmap::RtabmapDatabase;
using namespace graspmap_test;

// ------------------------------------------------------------------------------------------ graph

TEST(RtabmapReader, ALinkOfWhichOneDirectionIsStoredKeepsIt) {
  const fs::path file = sample_file();
  execute(file, "DELETE FROM Link WHERE from_id = 1 AND to_id = 2");
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.graph().links.size(), 5U);
  const PoseLink* link = find_link(scan.graph(), 2, 1, LinkType::neighbor);
  ASSERT_NE(link, nullptr);
  expect_same_pose(link->from_from_to, sample_pose(2).inverse() * sample_pose(1));
}

TEST(RtabmapReader, LinksOfOtherTypesBetweenTheSameNodesAreKept) {
  const fs::path file = sample_file();
  execute(file,
          "INSERT INTO Link SELECT from_id, to_id, 4, information_matrix, transform, NULL "
          "FROM Link WHERE type = 0");
  EXPECT_EQ(RtabmapDatabase(file).graph().links.size(), 7U);
}

TEST(RtabmapReader, LinksThatCannotBeUsedAreNamed) {
  const fs::path file = sample_file();
  execute(file, "DELETE FROM Link");
  const std::string identity = pose_bytes(libmap::Pose::Identity());
  const std::string good = bytes_of(std::vector<double>(36, 1.0));
  std::vector<float> nan_pose(12, NAN);
  const auto insert = [&](const std::string& ends, const std::string& pose,
                          const std::string& information) {
    execute(file,
            "INSERT INTO Link (from_id, to_id, type, transform, information_matrix) VALUES (" +
                ends + ", ?, ?)",
            {pose, information});
  };
  insert("1, 2, 0", identity, good);
  insert("1, 77, 0", identity, good);
  insert("88, 2, 0", identity, good);
  insert("2, 2, 0", identity, good);
  insert("2, 3, 1", bytes_of(nan_pose), good);
  insert("2, 3, 2", identity.substr(1), good);
  insert("2, 3, 3", identity, good.substr(8));
  insert("2, 3, 4", identity, bytes_of(std::vector<double>(36, INFINITY)));
  insert("2, 3, 5", std::string(48, '\0'), good);  // null: lost odometry
  insert("2, 3, 12", identity, good);              // a future type
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.graph().links.size(), 2U);
  ASSERT_EQ(scan.warnings().size(), 7U);
  EXPECT_TRUE(is_error_text(scan.warnings()[0], {.field = "link 1 -> 77", .about = "node 77"}));
  EXPECT_TRUE(is_error_text(scan.warnings()[2], {.field = "link 2 -> 3"}));
}

// Before 0.13, a link has variances instead of a matrix.
TEST(RtabmapReader, LinksWithoutAVarianceAreNamed) {
  const fs::path file = sample_file({12, 0});
  const std::size_t links = RtabmapDatabase(file).graph().links.size();
  execute(file, "UPDATE Link SET rot_variance = 0 WHERE from_id = 1 AND to_id = 2");
  execute(file, "UPDATE Link SET trans_variance = 9e999 WHERE from_id = 2 AND to_id = 1");
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.graph().links.size(), links - 1);
  ASSERT_EQ(scan.warnings().size(), 2U);
  EXPECT_TRUE(is_error_text(scan.warnings()[0], {.field = "link 1 -> 2"}));
  EXPECT_TRUE(is_error_text(scan.warnings()[1], {.field = "link 2 -> 1"}));
  execute(file, "UPDATE Link SET rot_variance = 1e-310 WHERE from_id = 1 AND to_id = 2");
  EXPECT_TRUE(is_error_text(RtabmapDatabase(file).warnings().front(),
                            {.field = "link 1 -> 2", .about = "1e300"}));
}

TEST(RtabmapReader, NodesThatCannotBeUsedAreNamed) {
  const fs::path file = sample_file();
  execute(file, "INSERT INTO Node (id, map_id) VALUES (-4, 0)");
  execute(file, "INSERT INTO Node (id, map_id) VALUES (99999999999, 0)");
  execute(file, "UPDATE Node SET pose = ? WHERE id = 1", {bytes_of(std::vector<float>(12, NAN))});
  execute(file, "UPDATE Node SET pose = ? WHERE id = 2", {std::string(48, '\0')});
  execute(file, "UPDATE Node SET pose = ? WHERE id = 3", {bytes_of(std::vector<float>(12, 3.0F))});
  execute(file, "UPDATE Node SET stamp = NULL, weight = NULL WHERE id = 3");
  const RtabmapDatabase scan(file);
  ASSERT_EQ(scan.graph().nodes.size(), 3U);
  for (const libmap::GraphNode& node : scan.graph().nodes)
    EXPECT_FALSE(node.odometry_from_base) << node.id;
  EXPECT_EQ(scan.warnings().size(), 4U);  // a null pose counts as missing
}

fs::path database_of(const std::vector<std::string>& statements) {
  const fs::path file = scratch_folder() / "a.db";
  for (const std::string& statement : statements) execute(file, statement);
  return file;
}

TEST(RtabmapReader, NodesThatAreThereTwice) {
  const RtabmapDatabase scan(
      database_of({"CREATE TABLE Node (id INTEGER, map_id INTEGER, weight INTEGER, stamp FLOAT)",
                   "INSERT INTO Node VALUES (3, 0, 5, 1), (3, 0, 6, 2), (1, 0, 7, 3)"}));
  ASSERT_EQ(scan.graph().nodes.size(), 2U);
  EXPECT_EQ(scan.graph().nodes[0].id, 1);
  EXPECT_EQ(scan.graph().nodes[1].weight, 5);
  EXPECT_TRUE(is_error_text(scan.warnings()[0], {.field = "node 3"}));
}

// SQLite sorts texts alphabetically: 1, 10, 2.
TEST(RtabmapReader, NodesWhoseNumbersAreTexts) {
  const RtabmapDatabase scan(database_of(
      {"CREATE TABLE Node (id TEXT, label TEXT)",
       "INSERT INTO Node VALUES ('10', 'ten'), ('2', 'two' || char(0) || 'x'), ('1', '')"}));
  ASSERT_EQ(scan.graph().nodes.size(), 3U);
  for (const int id : {1, 2, 10}) EXPECT_NE(scan.graph().find_node(id), nullptr) << id;
  EXPECT_EQ(scan.graph().find_node(10)->label, "ten");
  EXPECT_EQ(scan.graph().find_node(2)->label, "two");  // cut at the zero character
}

TEST(RtabmapReader, ValuesThatASchemaMakesUpAreNotRead) {
  const std::string made_up = " BLOB AS (zeroblob(900000000)))";
  const RtabmapDatabase scan(database_of(
      {"CREATE TABLE Node (id INTEGER, label" + made_up, "INSERT INTO Node (id) VALUES (1)",
       "CREATE TABLE Image (id INTEGER, data" + made_up, "INSERT INTO Image (id) VALUES (1)"}));
  EXPECT_TRUE(scan.read_frame(1).color.pixels.empty());
}

// Values that no file of poses or links could represent.
TEST(RtabmapReader, PosesAndInformationBeyondAllBounds) {
  std::vector<float> pose = {1, 0, 0, 3e38F, 0, 1, 0, 0, 0, 0, 1, 0};
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] { libmap::decode_pose(bytes_of(pose)); }),
                                      {.about = "1e8"}));
  pose[3] = 9e7F;
  EXPECT_TRUE(libmap::decode_pose(bytes_of(pose)));
  for (const double entry : {1e308, -1e308, static_cast<double>(NAN)}) {
    std::vector<double> information(36, 0.0);
    information[20] = entry;
    EXPECT_TRUE(graspmap_test::is_error(
        error_of([&] { libmap::decode_information(bytes_of(information)); }),
        {.field = "information matrix"}));
  }
}

TEST(RtabmapReader, WarningsAreBounded) {
  const fs::path file = sample_file();
  execute(file,
          "WITH RECURSIVE n(i) AS (SELECT 10 UNION ALL SELECT i + 1 FROM n WHERE i < 500) INSERT "
          "INTO Link SELECT i, 1, 0, zeroblob(288), zeroblob(48), NULL FROM n");
  const RtabmapDatabase scan(file);
  ASSERT_EQ(scan.warnings().size(), 101U);
  EXPECT_NE(scan.warnings().back().find("391"), std::string::npos);
}

TEST(RtabmapReader, RotationsAreMadeProper) {
  const fs::path file = sample_file();
  std::vector<float> numbers{1.001F, 0, 0, 5, 0, 0.999F, 0.001F, 6, 0, 0, 1, 7};
  execute(file, "UPDATE Node SET pose = ? WHERE id = 1", {bytes_of(numbers)});
  const RtabmapDatabase scan(file);
  const libmap::Pose pose = *scan.graph().nodes[0].odometry_from_base;
  EXPECT_LT((pose.linear() * pose.linear().transpose() - Eigen::Matrix3d::Identity()).norm(),
            1e-14);
  EXPECT_EQ(pose.translation(), Eigen::Vector3d(5, 6, 7));
}

TEST(RtabmapReader, BrokenOptimizedPosesAreLeftOut) {
  const fs::path file = sample_file();
  execute(file, "UPDATE Admin SET opt_poses = substr(opt_poses, 1, 20)");
  const RtabmapDatabase scan(file);
  EXPECT_TRUE(scan.graph().optimized_map_from_base.empty());
  ASSERT_EQ(scan.warnings().size(), 1U);
  EXPECT_TRUE(is_error_text(scan.warnings()[0], {.field = "Admin.opt_poses"}));
  execute(file, "UPDATE Admin SET opt_poses = NULL");
  EXPECT_TRUE(RtabmapDatabase(file).warnings().empty());
}

TEST(RtabmapReader, OptimizedPosesThatDoNotFitTheirIdsAreLeftOut) {
  const fs::path file = sample_file();
  const auto warning_with = [&](libmap::MatrixElement element, int count) {
    const std::string ids = bytes_of(std::vector<std::int32_t>(static_cast<std::size_t>(count), 1));
    execute(file, "UPDATE Admin SET opt_ids = ?",
            {encode_matrix(libmap::StoredMatrix{1, count, 1, element, ids})});
    const RtabmapDatabase scan(file);
    EXPECT_TRUE(scan.graph().optimized_map_from_base.empty());
    EXPECT_EQ(scan.warnings().size(), 1U);
    return scan.warnings().front();
  };
  EXPECT_TRUE(is_error_text(warning_with(libmap::MatrixElement::float32, 3),
                            {.field = "Admin.opt_poses", .about = "int32 and float32"}));
  EXPECT_TRUE(is_error_text(warning_with(libmap::MatrixElement::int32, 2),
                            {.field = "Admin.opt_poses", .about = "2 and 3"}));
}

// ----------------------------------------------------------------------------------------- frames

TEST(RtabmapReader, PartsThatAreNotAskedForAreLeftOut) {
  const RtabmapDatabase scan(sample_file());
  const RgbdFrame depth = scan.read_frame(1, {.color = false});
  EXPECT_TRUE(depth.color.empty());
  EXPECT_EQ(depth.depth, libmap::to_meters(sample_depth(1)));
  const RgbdFrame none = scan.read_frame(1, {.color = false, .depth = false});
  EXPECT_TRUE(none.depth.empty());
  EXPECT_EQ(none.cameras.at(0).width, 32);
}

// A camera without a stored size has that of the image's header, which can be long.
TEST(RtabmapReader, SizesFromAnImageWithALongHeader) {
  const fs::path file = sample_file({10, 7});
  std::string jpeg = libmap::encode_jpeg(sample_color(1));
  std::string comment("\xff\xfe\x27\x12", 4);
  comment += std::string(0x2712 - 2, 'x');
  jpeg.insert(2, comment);
  execute(file, "UPDATE Data SET image = ?, depth = NULL WHERE id = 1", {jpeg});
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.read_frame(1, {.color = false, .depth = false}).cameras.at(0).width, 32);
}

TEST(RtabmapReader, AbsentPartsAreNoError) {
  const fs::path file = sample_file();
  execute(file, "UPDATE Data SET image = NULL, depth = x'00000000' WHERE id = 1");
  execute(file, "UPDATE Data SET calibration = NULL WHERE id = 2");
  execute(file, "DELETE FROM Data WHERE id = 3");
  const RtabmapDatabase scan(file);
  EXPECT_TRUE(scan.read_frame(1).color.empty());
  EXPECT_TRUE(scan.read_frame(1).depth.empty());
  EXPECT_EQ(scan.read_frame(1).cameras.size(), 1U);
  EXPECT_TRUE(scan.read_frame(2).cameras.empty());
  EXPECT_TRUE(scan.read_frame(3).color.empty());
  EXPECT_EQ(error_of([&] { scan.read_frame(4); }).context().value, "4");
}

TEST(RtabmapReader, DepthOfAnotherSizeThanColor) {
  const fs::path file = sample_file();
  libmap::MillimeterImage half(16, 12, 1500);
  execute(file, "UPDATE Data SET depth = ? WHERE id = 1", {encode_rvl(half)});
  const RtabmapDatabase scan(file);
  const auto views = camera_views(scan.read_frame(1));
  ASSERT_EQ(views.size(), 1U);
  EXPECT_EQ(views[0].depth_camera.width, 16);
  EXPECT_EQ(views[0].depth_camera.fx, 15);
  EXPECT_EQ(views[0].depth_camera.cx, 7.75);  // half of 15.5: every other pixel is taken
  EXPECT_EQ(views[0].color_camera.fx, 30);
}

TEST(RtabmapReader, StereoPairs) {
  const fs::path file = sample_file({11, 2});
  const std::string calibration =
      bytes_of(std::vector<float>{30, 31, 15.5F, 11.5F, 0.25F, 32, 24}) +
      pose_bytes(libmap::optical_to_body_rotation());
  execute(file, "UPDATE Data SET calibration = ?, depth = ? WHERE id = 1",
          {calibration, libmap::encode_jpeg(libmap::GrayImage(32, 24, 80))});
  const RtabmapDatabase scan(file);
  const RgbdFrame frame = scan.read_frame(1);
  ASSERT_EQ(frame.stereo.size(), 1U);
  EXPECT_EQ(frame.stereo[0].baseline_m, 0.25);
  EXPECT_EQ(frame.cameras.size(), 1U);
  EXPECT_TRUE(frame.depth.empty());
  EXPECT_NEAR(frame.right.at(16, 12), 80, 1);
}

TEST(RtabmapReader, BrokenPartsNameTheirNode) {
  const fs::path file = sample_file();
  execute(file, "UPDATE Data SET image = substr(image, 1, 100) WHERE id = 1");
  execute(file, "UPDATE Data SET depth = substr(depth, 1, 100) WHERE id = 2");
  execute(file, "UPDATE Data SET calibration = substr(calibration, 1, 100) WHERE id = 3");
  const RtabmapDatabase scan(file);
  EXPECT_TRUE(is_error(error_of([&] { scan.read_frame(1); }),
                       {.file = file, .field = "node 1: image: PNG data"}));
  EXPECT_TRUE(is_error(error_of([&] { scan.read_frame(2); }),
                       {.file = file, .field = "node 2: depth", .about = "100 bytes"}));
  EXPECT_EQ(error_of([&] { scan.read_frame(3); }).context().field, "node 3: calibration: records");
  EXPECT_NO_THROW(scan.read_frame(1, {.color = false}));
}

TEST(RtabmapReader, ContentIsReadFromHeaders) {
  const fs::path file = sample_file();
  execute(file, "UPDATE Data SET depth = ? WHERE id = 3",
          {libmap::encode_png(libmap::GrayImage(20, 10))});
  execute(file, "UPDATE Data SET image = x'0102030405060708' WHERE id = 2");
  std::vector<libmap::NodeContent> list;
  RtabmapDatabase(file).each_content(
      [&](const libmap::NodeContent& content) { list.push_back(content); });
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[0].color->width, 32);
  EXPECT_EQ(list[0].color_bytes, encode_png(sample_color(1)).size());
  EXPECT_EQ(list[0].depth->format, libmap::DepthFormat::rvl);
  EXPECT_EQ(list[0].calibration.cameras.size(), 1U);
  EXPECT_EQ(list[1].faults.size(), 1U);
  EXPECT_GT(list[1].user_data_bytes, 0U);
  EXPECT_GT(list[1].laser_scan_bytes, 0U);
  EXPECT_EQ(list[2].right->width, 20);
}

TEST(RtabmapReader, ManyThreadsReadTheSame) {
  const RtabmapDatabase scan(sample_file());
  std::atomic<int> wrong = 0;
  libmap::parallel_for(200, 1, [&](std::size_t begin, std::size_t) {
    const int node = static_cast<int>(begin % 3) + 1;
    if (scan.read_frame(node).color != sample_color(node)) ++wrong;
  });
  EXPECT_EQ(wrong, 0);
}

TEST(RtabmapReader, StoredMap) {
  const fs::path file = sample_file();
  using libmap::MatrixElement;
  const auto compressed = [](int rows, int columns, int channels, MatrixElement element,
                             const std::string& bytes) {
    return encode_matrix(libmap::StoredMatrix{rows, columns, channels, element, bytes});
  };
  execute(file,
          "UPDATE Admin SET opt_map = ?, opt_cloud = ?, opt_polygons = ?, preview_image = ?, "
          "opt_polygons_size = 3, opt_map_resolution = 0.05",
          {compressed(4, 6, 1, MatrixElement::int8, std::string(24, '\1')),
           compressed(1, 9, 4, MatrixElement::float32, std::string(144, '\0')),
           compressed(1, 11, 1, MatrixElement::int32,
                      bytes_of(std::vector<std::int32_t>{2, 0, 1, 2, 2, 3, 0, 1, 4, 5, 6})),
           libmap::encode_jpeg(sample_color(1))});
  const libmap::StoredMap map = RtabmapDatabase(file).stored_map();
  EXPECT_EQ(map.grid_width, 6);
  EXPECT_EQ(map.grid_height, 4);
  EXPECT_EQ(map.grid_resolution_m, 0.05);
  EXPECT_EQ(map.cloud_points, 9U);
  EXPECT_EQ(map.polygons, 3U);
  EXPECT_EQ(map.preview->width, 32);
}

// Decompressed, they would take gigabytes.
TEST(RtabmapReader, OptimizedPosesAreCountedBeforeTheyAreInflated) {
  const fs::path file = sample_file();
  const auto claims = [](std::int32_t columns, std::int32_t type) {
    return std::string(40, '\x78') + bytes_of(std::vector<std::int32_t>{1, columns, type});
  };
  for (const auto& [ids, poses, reason] :
       {std::tuple{claims(1000, 4), claims(11999, 5), "1000 and 999"},
        {claims(1000, 4), claims(12001, 5), "1000 and 1000"},
        {claims(1000, 5), claims(12000, 5), "int32 and float32"}}) {
    execute(file, "UPDATE Admin SET opt_ids = ?, opt_poses = ?", {ids, poses});
    const RtabmapDatabase scan(file);
    ASSERT_EQ(scan.warnings().size(), 1U);
    EXPECT_TRUE(is_error_text(scan.warnings()[0], {.field = "Admin.opt_poses", .about = reason}));
  }
}

TEST(RtabmapReader, PolygonsOfSeveralMaterials) {
  const fs::path file = sample_file();
  const auto polygons = [&](const std::vector<std::int32_t>& numbers, int corners) {
    execute(
        file,
        "UPDATE Admin SET opt_polygons_size = " + std::to_string(corners) + ", opt_polygons = ?",
        {encode_matrix(libmap::StoredMatrix{1, static_cast<int>(numbers.size()), 1,
                                            libmap::MatrixElement::int32, bytes_of(numbers)})});
    return RtabmapDatabase(file).stored_map().polygons;
  };
  EXPECT_EQ(polygons({1, 0, 1, 2, 0, 2, 3, 4, 5, 6, 7, 8}, 3), 3U);
  // Larger than one piece of decompression.
  std::vector<std::int32_t> many(1 + 3 * 30000, 7);
  many[0] = 30000;
  EXPECT_EQ(polygons(many, 3), 30000U);
  EXPECT_EQ(polygons({0, 0, 0}, 3), 0U);
  for (const auto& [numbers, corners] :
       {std::pair{std::vector<std::int32_t>{2, 0, 1, 2, 3, 4}, 3}, {{-1}, 3}, {{1, 0, 1, 2}, 0}})
    EXPECT_TRUE(graspmap_test::is_error(
        error_of([&, &numbers = numbers, corners = corners] { polygons(numbers, corners); }),
        {.file = file}));
}

// -------------------------------------------------------------------------------------- real files

struct RealFile {
  const char* name;
  std::size_t nodes;
  std::size_t links;
  std::size_t optimized;
  const char* schema;
};

TEST(RtabmapReader, RealDatabases) {
  GRASPMAP_REQUIRE_DATA();
  // Links: half of the rows, since both directions are stored; site_killed.db has one.
  const std::vector<RealFile> files{
      {"site_full.db", 40, 48, 40, "0.23.0"},    {"site_drift.db", 40, 43, 40, "0.23.0"},
      {"site_killed.db", 29, 33, 0, "0.23.0"},   {"site_v0160.db", 40, 47, 0, "0.16.0"},
      {"site_tiny_v0180.db", 6, 5, 6, "0.18.0"}, {"site_tiny_v0160.db", 6, 5, 0, "0.16.0"}};
  for (const RealFile& file : files) {
    SCOPED_TRACE(file.name);
    const RtabmapDatabase scan(data_folder() / "scans" / file.name);
    EXPECT_EQ(scan.graph().nodes.size(), file.nodes);
    EXPECT_EQ(scan.graph().links.size(), file.links);
    EXPECT_EQ(scan.graph().optimized_map_from_base.size(), file.optimized);
    EXPECT_EQ(scan.recognized_version(), file.schema);
    EXPECT_TRUE(scan.warnings().empty());
    EXPECT_EQ(scan.parameters().size(), 612U);
    const RgbdFrame frame = scan.read_frame(1);
    EXPECT_FALSE(frame.color.empty());
    EXPECT_EQ(frame.cameras.at(0).width, frame.color.width);
    // The camera is 512 x 424, fx 365; images of half or quarter size were scaled.
    EXPECT_NEAR(frame.cameras.at(0).fx, 365.0 * frame.color.width / 512, 1e-6);
    const auto measured = std::count_if(frame.depth.pixels.begin(), frame.depth.pixels.end(),
                                        [](float depth) { return depth > 0.3F && depth < 10; });
    EXPECT_GT(measured, static_cast<std::ptrdiff_t>(frame.depth.pixels.size() / 2));
  }
}

// RTAB-Map's encoder and this project's write equal bytes.
TEST(RtabmapReader, RealRvlAndCalibrationsKeepTheirBytes) {
  GRASPMAP_REQUIRE_DATA();
  for (const char* name : {"site_tiny_q.db", "site_tiny_v0160.db", "site_killed.db"}) {
    const RtabmapDatabase scan(data_folder() / "scans" / name);
    for (const libmap::GraphNode& node : scan.graph().nodes) {
      const libmap::FrameBlobs blobs = scan.read_blobs(node.id);
      if (blobs.depth.empty() || blobs.calibration.empty()) continue;
      EXPECT_EQ(encode_rvl(libmap::decode_rvl(blobs.depth)), blobs.depth) << name << node.id;
      const libmap::Calibration calibration = libmap::decode_calibration(blobs.calibration);
      if (calibration.layout == libmap::CalibrationLayout::records) {
        EXPECT_EQ(encode_calibration(calibration), blobs.calibration);
      }
    }
  }
}

}  // namespace rtabmap_reader_test
