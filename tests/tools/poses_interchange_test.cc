// Reads and writes files of poses of other programs.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/camera/image_codec.h"
#include "libmap/core/text.h"
#include "libmap/poses/colmap_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_writer.h"
#include "tests/libmap/scan/colmap_reader.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/tools/tool_test_support.h"

namespace poses_interchange_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::ExampleScan;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_text;
using ::testing::ElementsAre;
using Words = std::vector<std::string>;

std::string scan_file(const std::string& name) { return data_folder() / "scans" / name; }

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// Frames of a plane 1 m before the camera; node 5 has two cameras.
ExampleScan write_example() {
  ExampleScan scan = graspmap_test::example_scan();
  for (auto& [id, frame] : scan.frames)
    for (float& depth : frame.depth.pixels) depth = 1.0F;
  libmap::RgbdFrame& rig = scan.frames.at(5);
  rig.cameras.push_back(graspmap_test::example_camera(40, 30));
  rig.color = graspmap_test::random_color(80, 30);
  rig.depth = libmap::DepthImage(40, 15, 1.0F);
  libmap::RtabmapWriter writer(scratch("scan.db"), {});
  for (const libmap::GraphNode& node : scan.graph.nodes)
    writer.add_node(node, scan.frames.at(node.id));
  writer.finish();
  return scan;
}

TEST(ExtractColmap, CamerasImagesAndPoints) {
  const ExampleScan scan = write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--colmap", "out", "--transform",
                                  "1,2,3,0,0,90", "--point-spacing", "5"})));
  const libmap::ColmapModel model = graspmap_test::read_colmap_model(scratch("out"));
  const libmap::RtabmapDatabase database(scratch("scan.db"));
  std::vector<std::string> names;
  for (const auto& [id, image] : model.images) names.push_back(image.name);
  EXPECT_THAT(names,
              ElementsAre("000001.jpg", "000002.jpg", "000005.png", "000005_1.png", "000009.jpg"));
  EXPECT_EQ(content("out/images/000009.jpg"), database.read_blobs(9).image);
  EXPECT_EQ(libmap::decode_color(content("out/images/000005_1.png")),
            libmap::crop_columns(database.read_frame(5).color, 40, 40));
  const libmap::Pose site_from_map = libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 90});
  const libmap::ColmapImage& second = model.images.at(4);
  const libmap::Pose world_from_camera = site_from_map *
                                         *scan.graph.find_node(5)->odometry_from_base *
                                         scan.frames.at(5).cameras[1].base_from_camera;
  EXPECT_TRUE(second.camera_from_world.inverse().isApprox(world_from_camera, 1e-6));
  const libmap::Camera& lens = scan.frames.at(5).cameras[1];
  EXPECT_EQ(model.cameras.at(second.camera).parameters[0], lens.fx);
  // 8 x 6 squares, of which the right and lower ones are on the last pixels of the smaller depth.
  EXPECT_EQ(second.observations.size(), 7U * 5U);
  for (const libmap::ColmapObservation& feature : second.observations) {
    const Eigen::Vector3d point =
        second.camera_from_world * model.points.at(feature.point).position;
    EXPECT_NEAR(point.z(), 1.0, 1e-6);
    EXPECT_LT(
        (*libmap::project_point(lens, point) + Eigen::Vector2d(0.5, 0.5) - feature.pixel).norm(),
        1e-9);
  }
  const auto manifest = json_of("out.json");
  EXPECT_EQ(manifest["results"]["images"], 5);
  EXPECT_EQ(manifest["results"]["points"], model.points.size());
  EXPECT_EQ(manifest["parameters"]["poses"], "odometry");
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--colmap", "again", "--transform",
                                  "1,2,3,0,0,90", "--point-spacing", "5", "--threads", "1"})));
  EXPECT_EQ(content("again/sparse/images.txt"), content("out/sparse/images.txt"));
  EXPECT_EQ(content("again/sparse/points3D.txt"), content("out/sparse/points3D.txt"));
}

TEST(ExtractColmap, IsReadAsPosesAgain) {
  write_example();
  // Both cameras of node 5 contribute.
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--colmap", "one"})));
  const auto result = graspmap({"convert", "scan.db", "--colmap", "two", "--poses", "one"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("two.json").at("results").at("poses_in_file"), 5);
  const auto poses = [](const std::string& folder) {
    return libmap::read_trajectory(scratch(folder)).images;
  };
  ASSERT_EQ(poses("one").size(), poses("two").size());
  for (std::size_t i = 0; i < poses("one").size(); ++i)
    EXPECT_TRUE(
        poses("two")[i].world_from_camera.isApprox(poses("one")[i].world_from_camera, 1e-12));
  EXPECT_EQ(json_of("two.json")["inputs"].size(), 2U);
}

// Cameras' poses of Open3D and of nerfstudio are the same as COLMAP's.
TEST(Poses, OfOpen3dAndNerfstudio) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--colmap", "one"})));
  const auto first_cameras = [&](const std::string& folder) {
    std::vector<libmap::ImagePose> images = libmap::read_trajectory(scratch(folder)).images;
    std::erase_if(images,
                  [](const auto& image) { return image.image.find('_') != std::string::npos; });
    std::sort(images.begin(), images.end(),
              [](const auto& a, const auto& b) { return a.image < b.image; });
    return images;
  };
  const auto images = first_cameras("one");
  std::string log;
  nlohmann::json frames = nlohmann::json::array();
  for (const libmap::ImagePose& image : images) {
    log += "0 0 0\n";
    nlohmann::json matrix = nlohmann::json::array();
    for (int row = 0; row < 4; ++row) {
      std::vector<double> open_gl;
      for (int column = 0; column < 4; ++column) {
        const double value = image.world_from_camera.matrix()(row, column);
        log += libmap::to_text(value) + (column == 3 ? "\n" : " ");
        open_gl.push_back(column == 1 || column == 2 ? -value : value);
      }
      matrix.push_back(open_gl);
    }
    frames.push_back({{"file_path", "./images/" + image.image}, {"transform_matrix", matrix}});
  }
  write_text(scratch("poses.log"), log);
  write_text(scratch("transforms.json"), nlohmann::json{{"frames", frames}}.dump());
  for (const std::string file : {"poses.log", "transforms.json"}) {
    ASSERT_TRUE(
        succeeded(graspmap({"convert", "scan.db", "--colmap", file + ".out", "--poses", file})));
    const auto back = first_cameras(file + ".out");
    ASSERT_EQ(back.size(), images.size()) << file;
    for (std::size_t n = 0; n < images.size(); ++n)
      EXPECT_TRUE(back[n].world_from_camera.isApprox(images[n].world_from_camera, 1e-9)) << file;
  }
}

TEST(ExtractColmap, BesideOthersAndInADryRun) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--colmap", "out", "--dry-run"})));
  EXPECT_THAT(graspmap_test::names_in_scratch(), ElementsAre("scan.db"));
  ASSERT_TRUE(succeeded(
      graspmap({"convert", "scan.db", "-o", "all", "--bundler", "mesh", "--colmap", "model"})));
  EXPECT_TRUE(json_of("mesh.json")["results"].contains("kept_images"));
  EXPECT_FALSE(json_of("model.json")["results"].contains("kept_images"));
  EXPECT_FALSE(json_of("mesh.json")["results"].contains("points"));
  write_text(scratch("model/notes.txt"), "mine");
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "--colmap", "model"}), {.file = "model"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "--colmap", "x", "--point-spacing", "0"}),
                        {.field = "--point-spacing", .value = "0", .bound = ">= 1 and <= 10000"}));
}

// One unit of the model is 40 cm.
TEST(PosesOfFiles, ColmapsScaleIsGivenOrFound) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  ASSERT_TRUE(succeeded(graspmap({"convert", scan, "--colmap", "model", "--poses", "odometry"})));
  libmap::ColmapModel model = graspmap_test::read_colmap_model(scratch("model"));
  for (auto& [id, image] : model.images) image.camera_from_world.translation() *= 2.5;
  libmap::write_colmap_model(scratch("model/sparse"), model);
  const Words words = {"fuse", scan, "--poses", "model", "-o", "cloud.ply", "--voxel-size", "0.03"};
  const auto unscaled = graspmap(words);
  EXPECT_TRUE(succeeded(unscaled));
  EXPECT_TRUE(warned(unscaled, {"model", "poses_scale"}));
  for (const std::string scale : {"0.4", "0"}) {
    const auto result = graspmap(with(words, {"--poses-scale", scale}));
    ASSERT_TRUE(succeeded(result));
    EXPECT_FALSE(warned(result, {}));
    EXPECT_NEAR(json_of("cloud.ply.json")["results"]["poses_scale_taken"], 0.4, 1e-6);
  }
}

TEST(PosesOfFiles, RefineWritesEveryFormatAndFuseTakesIt) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  std::string wanted;
  for (const std::string name : {"r.tum", "r.kitti", "r.g2o", "r.toro", "r.colmap"}) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(succeeded(graspmap({"refine", scan, "-o", name})));
    EXPECT_TRUE(fs::exists(scratch(name + ".json")));
    const auto result = graspmap({"fuse", scan, "--poses", name, "-o", "cloud.ply"});
    ASSERT_TRUE(succeeded(result));
    EXPECT_EQ(json_of("cloud.ply.json").at("results").at("poses_in_file"), 6);
    const auto count = json_of("cloud.ply.json")["results"]["points"].get<int>();
    if (wanted.empty()) wanted = std::to_string(count);
    // Poses agree to 1e-14; a point on an edge of the grid may fall to either side.
    EXPECT_NEAR(count, std::stoi(wanted), 2);
  }
  // A second run replaces its own folder.
  EXPECT_TRUE(succeeded(graspmap({"refine", scan, "-o", "r.colmap/"})));
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "r.txt"}),
                        {.file = "r.txt",
                         .field = "extension",
                         .value = ".txt",
                         .bound = "one of .tum .kitti .g2o .toro .colmap"}));
  EXPECT_TRUE(succeeded(graspmap({"convert", scan, "--bundler", "b", "--poses", "r.colmap"})));
  // Before the work: a folder has no database to copy.
  ASSERT_TRUE(succeeded(graspmap({"convert", scan, "-o", "folder"})));
  EXPECT_TRUE(bad_input(graspmap({"refine", "folder", "-o", "f.tum", "--write-database", "f.db"}),
                        {.field = "--write-database", .value = "f.db"}));
  EXPECT_FALSE(fs::exists(scratch("f.tum")));
}

TEST(ConvertPoses, RtabmapsFormatsThereAndBack) {
  libmap::TrajectoryFile file;
  for (int id = 2; id <= 4; ++id)
    file.poses.push_back({id, 1700000000.25 + id, graspmap_test::random_float_pose()});
  file.links.push_back({.from = 2, .to = 4, .type = libmap::LinkType::user_closure});
  libmap::write_trajectory(scratch("a.g2o"), file);
  for (const std::string format :
       {"tum", "tum-motion-capture", "kitti", "kitti-optical", "toro", "g2o"}) {
    SCOPED_TRACE(format);
    const std::string there = format + ".txt";
    ASSERT_TRUE(
        succeeded(graspmap({"convert", "a.g2o", "-o", there, "--output-poses-format", format})));
    ASSERT_TRUE(
        succeeded(graspmap({"convert", there, "-o", format + ".g2o", "--poses-format", format})));
    const libmap::TrajectoryFile back = libmap::read_trajectory(scratch(format + ".g2o"));
    ASSERT_EQ(back.poses.size(), 3U);
    EXPECT_EQ(back.links.size(), format == "toro" || format == "g2o" ? 1U : 0U);
    for (std::size_t i = 0; i < 3; ++i) {
      // KITTI's lines name no nodes.
      EXPECT_EQ(back.poses[i].node, format.starts_with("kitti") ? 0 : file.poses[i].node);
      EXPECT_TRUE(back.poses[i].world_from_base.isApprox(file.poses[i].world_from_base, 1e-7));
    }
    EXPECT_EQ(json_of(there + ".json")["results"]["poses"], 3);
  }
  EXPECT_NE(content("kitti.txt"), content("kitti-optical.txt"));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.g2o", "-o", "b.xyz"}),
                        {.file = "b.xyz",
                         .field = "extension",
                         .value = ".xyz",
                         .bound = "one of .tum .kitti .g2o .toro"}));
  fs::create_directory(scratch("model"));
  libmap::write_colmap_model(scratch("model"), {.cameras = {{1, {"PINHOLE", 6, 4, {1, 1, 1, 1}}}},
                                                .images = {{1, {1, "3.jpg"}}}});
  EXPECT_TRUE(bad_input(graspmap({"convert", "model/images.txt", "-o", "b.tum"}),
                        {.file = "model/images.txt"}));
}

// Each is one line on stderr that names the file and, where there is one, the line.
TEST(PosesOfFiles, OddOnesAreNamed) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  const std::string pose = " 0 0 0 0 0 0 1";
  const std::string bom = "\xEF\xBB\xBF";
  struct Case {
    std::string name;
    std::string text;
    graspmap_test::ExpectedError expected;
  };
  const std::vector<Case> cases = {
      {"a.tum",
       bom + "# x\r\n1" + pose + "\r\n2 0 0\r\n",
       {.field = "line 3", .value = "3 columns long"}},
      {"b.tum", "1 0 nan 0 0 0 0 1\n", {.field = "line 1", .value = "nan"}},
      {"c.tum",
       "1 0 1e300 0 0 0 0 1\n",
       {.field = "line 1", .value = "1e+300", .bound = "<= 1e8 m"}},
      {"d.tum", "1 0 0 0 0 0 0.5 0.5\n", {.field = "line 1", .value = "0.7071067811865476"}},
      {"e.tum", "1" + pose + " 7\n2" + pose + " 7\n", {.field = "line 2", .value = "node 7"}},
      {"f.tum", "timestamp,x,y,z,qx,qy,qz,qw\n", {.field = "line 1", .value = "timestamp"}},
      {"g.kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n", {.field = "poses", .value = "1", .bound = "6"}},
      {"h.kitti",
       "1 0 0 0 0 1 0 0 0 0 -1 0\n",
       {.field = "line 1", .value = "a matrix with determinant -1"}},
      {"i.g2o",
       "VERTEX_SE3:QUAT 1" + pose + "\nVERTEX_SE3:QUAT 1" + pose + "\n",
       {.field = "line 2", .value = "vertex 1"}},
      {"j.g2o", "VERTEX_SE2 1 0 0 0\n", {.field = "line 1", .value = "VERTEX_SE2"}},
      {"k.toro",
       "VERTEX3 1 0 0 0 0 0\n",
       {.field = "line 1", .value = "7 columns long", .bound = ">= 8"}},
      {"l.txt", "1 2 3\n", {.field = "line 1", .value = "3 columns long"}},
      {"m.txt", "\n\n", {.field = "poses"}},
      {"n.tum", "12345678901234567890123" + pose + "\n", {.about = "within 20 ms"}},
      {"o.tum", "1" + pose + " 99\n", {.field = "poses"}},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    write_text(scratch(one.name), one.text);
    graspmap_test::ExpectedError expected = one.expected;
    expected.file = one.name;
    EXPECT_TRUE(
        bad_input(graspmap({"fuse", scan, "--poses", one.name, "-o", "cloud.ply"}), expected));
  }
  fs::create_directory(scratch("empty"));
  EXPECT_TRUE(bad_input(graspmap({"fuse", scan, "--poses", "empty", "-o", "cloud.ply"}),
                        {.file = "empty"}));
  fs::create_directory(scratch("model"));
  write_text(scratch("model/images.txt"), "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0\n");
  EXPECT_TRUE(
      bad_input(graspmap({"fuse", scan, "--poses", "model", "-o", "cloud.ply"}),
                {.file = "model/images.txt", .field = "line 3", .value = "7 columns long"}));
}

// Commas, CRLF, a byte order mark, quaternions of six digits, another order.
TEST(PosesOfFiles, OddOnesThatAreSound) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  write_text(scratch("odd.csv"),
             "\xEF\xBB\xBF#timestamp x y z qx qy qz qw id\r\n"
             "1700000002.0,0.5,0,0,0,0,0.382683,0.923880,2\r\n\r\n"
             "1700000001.0,0,0,0,0,0,0,1.000001,1\r\n"
             "1700000009.0,0,0,0,0,0,0,1,77");
  const auto result = graspmap({"fuse", scan, "--poses", "odd.csv", "-o", "cloud.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("cloud.ply.json").at("results").at("poses_in_file"), 3);
  EXPECT_EQ(json_of("cloud.ply.json").at("results").at("frames"), 2);
  EXPECT_TRUE(warned(result, {scan, "4 of 6 nodes"}));
}

}  // namespace poses_interchange_test
