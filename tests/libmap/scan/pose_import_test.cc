// Import of pose files for the frames of a scan.
#include "libmap/scan/pose_import.h"

#include <gmock/gmock.h>

#include <fstream>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libmap/poses/colmap_io.h"
#include "libmap/scan/rtabmap_reader.h"
#include "tests/support/test_support.h"

namespace pose_import_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::is_error_text;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using graspmap_test::write_text;
using libmap::Pose;
using libmap::TrajectoryFormat;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Pose random_pose() {
  return libmap::make_pose_from_rpy({uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)},
                                    {uniform(-180, 180), uniform(-80, 80), uniform(-180, 180)});
}

// Nodes 3, 4, 12 and 130 of a rig of two cameras that look to different sides; node 130's
// calibration is broken.
class RigScan : public libmap::ScanSource {
 public:
  RigScan() {
    for (const int id : {3, 4, 12, 130}) {
      libmap::GraphNode node{.id = id, .stamp_s = 1700000000.0 + 0.5 * id};
      node.odometry_from_base = random_pose();
      graph_.nodes.push_back(node);
    }
    for (libmap::Pose& pose : base_from_cameras_) pose = random_pose();
  }
  const fs::path& path() const override { return path_; }
  const libmap::PoseGraph& graph() const override { return graph_; }
  libmap::PoseGraph& graph() { return graph_; }
  std::string image_name(int node) const override {
    const auto name = names_.find(node);
    return name == names_.end() ? std::string() : name->second;
  }
  std::map<int, std::string>& names() { return names_; }
  libmap::RgbdFrame read_frame(int node, libmap::FrameParts) const override {
    if (node == 130) throw libmap::Error("is torn", {.file = "scan", .field = "node 130"});
    libmap::RgbdFrame frame;
    frame.node = node;
    for (const Pose& pose : base_from_cameras_) {
      frame.cameras.emplace_back();
      frame.cameras.back().base_from_camera = pose;
    }
    return frame;
  }
  Pose camera(std::size_t index) const { return base_from_cameras_[index]; }

 private:
  fs::path path_ = "scan";
  libmap::PoseGraph graph_;
  std::map<int, std::string> names_;
  std::vector<Pose> base_from_cameras_ = std::vector<Pose>(2);
};

struct Image {
  std::string name;
  Pose world_from_camera;
};

fs::path write_model(const std::vector<Image>& images, double unit_m = 1.0) {
  libmap::ColmapModel model;
  model.cameras[1] = {"FOV", 640, 480, {1, 2, 3, 4, 5}};  // not used
  int id = 0;
  for (const Image& image : images) {
    Pose in_units = image.world_from_camera;
    in_units.translation() /= unit_m;
    model.images[++id] = {1, image.name, in_units.inverse()};
  }
  const fs::path folder = scratch_folder() / "model";
  fs::create_directories(folder);
  libmap::write_colmap_model(folder, model);
  return folder;
}

std::vector<int> nodes_of(const libmap::ImportedPoses& imported) {
  std::vector<int> nodes;
  for (const libmap::TrajectoryPose& pose : imported.trajectory.poses) nodes.push_back(pose.node);
  return nodes;
}

TEST(PoseImport, ImagesOfColmapByTheirNumbers) {
  const RigScan scan;
  std::map<int, Pose> truth;
  for (const int id : {3, 4, 12}) truth[id] = random_pose();
  const fs::path folder = write_model({{"images/left/000012.jpg", truth[12] * scan.camera(0)},
                                       {"3.png", truth[3] * scan.camera(0)},
                                       {"000004_1.png", truth[4] * scan.camera(1)},
                                       {"000077.jpg", random_pose()},
                                       {"rock.jpg", random_pose()}});
  for (const fs::path& path : {folder, folder / "images.txt"}) {
    const libmap::ImportedPoses imported = libmap::import_poses(path, scan);
    EXPECT_THAT(nodes_of(imported), ElementsAre(3, 4, 12));
    EXPECT_EQ(imported.poses_in_file, 5U);
    EXPECT_EQ(imported.trajectory.unmatched, 2U);
    for (const libmap::TrajectoryPose& pose : imported.trajectory.poses) {
      EXPECT_TRUE(pose.world_from_base.isApprox(truth[pose.node], 1e-12)) << pose.node;
      EXPECT_EQ(pose.stamp_s, 1700000000.0 + 0.5 * pose.node);
    }
  }
}

TEST(PoseImport, ImagesOfColmapByTheScansOwnNamesAndByStamps) {
  RigScan scan;
  // The scan's own file name has priority over a name that equals another node's number.
  scan.names() = {{3, "4.jpg"}, {4, "DSC 01, b.jpg"}};
  const fs::path folder = write_model({{"4.jpg", scan.camera(0)},
                                       {"x/DSC 01, b.jpg", scan.camera(0)},
                                       {"1700000006.0190.png", scan.camera(0)}});
  EXPECT_THAT(nodes_of(libmap::import_poses(folder, scan)), ElementsAre(3, 4, 12));
  const fs::path late = write_model({{"1700000006.021.png", random_pose()}});
  EXPECT_TRUE(is_error(error_of([&] { libmap::import_poses(late, scan); }),
                       {.field = "first image", .value = "1700000006.021.png"}));
}

TEST(PoseImport, CamerasThatTheRigHasNotAreLeftOut) {
  const RigScan scan;
  const fs::path folder = write_model({{"3.jpg", random_pose()}, {"4_2.jpg", random_pose()}});
  const libmap::ImportedPoses imported = libmap::import_poses(folder, scan);
  EXPECT_THAT(nodes_of(imported), ElementsAre(3));
  ASSERT_EQ(imported.warnings.size(), 1U);
  EXPECT_TRUE(is_error_text(imported.warnings[0],
                            {.file = "scan", .field = "camera of node 4", .value = "2"}));
}

TEST(PoseImport, CamerasOfOneNodeGiveTheMean) {
  const RigScan scan;
  const Pose truth = random_pose();
  Pose off = truth;
  off.translation().x() += 0.01;
  const fs::path folder =
      write_model({{"3.jpg", truth * scan.camera(0)}, {"3_1.jpg", off * scan.camera(1)}});
  const libmap::ImportedPoses imported = libmap::import_poses(folder, scan);
  ASSERT_THAT(nodes_of(imported), ElementsAre(3));
  EXPECT_NEAR(imported.trajectory.poses[0].world_from_base.translation().x(),
              truth.translation().x() + 0.005, 1e-12);
  EXPECT_TRUE(
      imported.trajectory.poses[0].world_from_base.linear().isApprox(truth.linear(), 1e-12));
  EXPECT_NEAR(imported.max_rig_deviation_m, 0.005, 1e-12);
  EXPECT_EQ(imported.trajectory.unmatched, 0U);
}

// The scale applies to the positions of the cameras, not to the offset from a camera to the base.
TEST(PoseImport, ScalesTheUnitsOfTheFile) {
  RigScan scan;
  const Pose elsewhere = random_pose();
  std::vector<Image> images;
  for (const int id : {3, 4, 12})
    images.push_back(
        {std::to_string(id) + ".jpg",
         elsewhere * *scan.graph().find_node(id)->odometry_from_base * scan.camera(0)});
  const fs::path folder = write_model(images, 2.5);
  for (const double scale : {2.5, 0.0}) {
    const libmap::ImportedPoses imported = libmap::import_poses(folder, scan, {.scale = scale});
    EXPECT_NEAR(imported.scale, 2.5, 1e-12);
    for (const libmap::TrajectoryPose& pose : imported.trajectory.poses)
      EXPECT_TRUE(pose.world_from_base.isApprox(
          elsewhere * *scan.graph().find_node(pose.node)->odometry_from_base, 1e-11));
  }
  // Without odometry, the stored poses are used; without both, the scale is undetermined.
  for (libmap::GraphNode& node : scan.graph().nodes) {
    scan.graph().optimized_map_from_base[node.id] = *node.odometry_from_base;
    node.odometry_from_base.reset();
  }
  EXPECT_NEAR(libmap::import_poses(folder, scan, {.scale = 0.0}).scale, 2.5, 1e-12);
  scan.graph().optimized_map_from_base.clear();
  const libmap::Error error = error_of([&] { libmap::import_poses(folder, scan, {.scale = 0.0}); });
  EXPECT_EQ(error.context().file, folder.string());
  EXPECT_EQ(error.context().bound, ">= 3");
}

TEST(PoseImport, PosesOfTheCameraBecomeThoseOfTheBase) {
  const RigScan scan;
  libmap::TrajectoryFile file;
  for (const int id : {3, 4, 12, 130}) file.poses.push_back({id, 0.0, random_pose()});
  libmap::write_trajectory(scratch_folder() / "camera.tum", file, true);
  const libmap::ImportedPoses imported = libmap::import_poses(
      scratch_folder() / "camera.tum", scan, {.frame = libmap::PoseFrame::camera, .scale = 2.0});
  EXPECT_THAT(nodes_of(imported), ElementsAre(3, 4, 12));
  Pose scaled = file.poses[1].world_from_base;
  scaled.translation() *= 2.0;
  EXPECT_TRUE(imported.trajectory.poses[1].world_from_base.isApprox(
      scaled * scan.camera(0).inverse(), 1e-12));
  // Node 130, whose calibration cannot be read.
  EXPECT_EQ(imported.trajectory.unmatched, 1U);
  ASSERT_EQ(imported.warnings.size(), 1U);
  EXPECT_TRUE(is_error_text(imported.warnings[0], {.field = "node 130"}));
  EXPECT_EQ(libmap::import_poses(scratch_folder() / "camera.tum", scan).trajectory.poses.size(),
            4U);
}

TEST(PoseImport, QuaternionsWithTheirRealPartFirst) {
  const RigScan scan;
  const Eigen::Quaterniond rotation(random_pose().linear());
  std::ofstream(scratch_folder() / "wxyz.tum")
      << "0 1 2 3 " << rotation.w() << ' ' << rotation.x() << ' ' << rotation.y() << ' '
      << rotation.z() << " 4\n";
  const libmap::ImportedPoses imported = libmap::import_poses(
      scratch_folder() / "wxyz.tum", scan, {.quaternion = libmap::QuaternionOrder::wxyz});
  ASSERT_THAT(nodes_of(imported), ElementsAre(4));
  const Pose& pose = imported.trajectory.poses[0].world_from_base;
  EXPECT_TRUE(pose.linear().isApprox(rotation.toRotationMatrix(), 1e-4));
  EXPECT_EQ(pose.translation(), Eigen::Vector3d(1, 2, 3));
}

TEST(PoseImport, EveryFormatGivesTheSamePoses) {
  const RigScan scan;
  libmap::TrajectoryFile file;
  for (const libmap::GraphNode& node : scan.graph().nodes)
    file.poses.push_back({node.id, node.stamp_s, random_pose()});
  for (const auto& [name, format] : libmap::trajectory_format_names()) {
    if (format == TrajectoryFormat::automatic || format == TrajectoryFormat::colmap ||
        format >= TrajectoryFormat::open3d)
      continue;
    SCOPED_TRACE(name);
    const fs::path path = scratch_folder() / (name + ".txt");
    libmap::write_trajectory_as(format, path, file);
    const bool turned =
        format == TrajectoryFormat::kitti_optical || format == TrajectoryFormat::tum_motion_capture;
    for (const auto as : {format, TrajectoryFormat::automatic}) {
      const libmap::ImportedPoses imported = libmap::import_poses(path, scan, {.format = as});
      ASSERT_EQ(imported.trajectory.poses.size(), 4U);
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(imported.trajectory.poses[i].node, file.poses[i].node);
        EXPECT_EQ(imported.trajectory.poses[i].world_from_base.isApprox(
                      file.poses[i].world_from_base, 1e-12),
                  as == format || !turned);
      }
    }
  }
}

// Steps of 10 cm and 10 degrees to the left.
libmap::TrajectoryFile circle(const RigScan& scan, double step_m) {
  libmap::TrajectoryFile file;
  Pose pose = Pose::Identity();
  for (const libmap::GraphNode& node : scan.graph().nodes) {
    file.poses.push_back({node.id, node.stamp_s, pose});
    pose = pose * libmap::make_pose_from_rpy({step_m, 0, 0}, {0, 0, 10});
  }
  return file;
}

TEST(PoseImport, SaysWhereMotionIsNotTheScansOwn) {
  RigScan scan;
  scan.graph().nodes.clear();
  for (int id = 1; id <= 12; ++id) scan.graph().nodes.push_back({.id = id, .stamp_s = 1.0 * id});
  for (const libmap::TrajectoryPose& pose : circle(scan, 0.1).poses)
    scan.graph().nodes[static_cast<std::size_t>(pose.node - 1)].odometry_from_base =
        pose.world_from_base;
  const auto warnings = [&](TrajectoryFormat format, double step_m) {
    const fs::path path = scratch_folder() / "poses.txt";
    libmap::write_trajectory_as(format, path, circle(scan, step_m));
    return libmap::import_poses(path, scan).warnings;
  };
  EXPECT_THAT(warnings(TrajectoryFormat::kitti, 0.1), ElementsAre());
  EXPECT_THAT(warnings(TrajectoryFormat::kitti, 0.12), ElementsAre());
  EXPECT_THAT(warnings(TrajectoryFormat::kitti, 0.3), ElementsAre(HasSubstr("poses_scale")));
  EXPECT_THAT(warnings(TrajectoryFormat::kitti, 0.03), ElementsAre(HasSubstr("poses_scale")));
  EXPECT_THAT(warnings(TrajectoryFormat::kitti_optical, 0.1),
              ElementsAre(HasSubstr("poses_format")));
  EXPECT_THAT(warnings(TrajectoryFormat::tum_motion_capture, 0.1),
              ElementsAre(HasSubstr("poses_format")));
}

TEST(PoseImport, NamesTheFileThatIsOfNoUse) {
  const RigScan scan;
  const fs::path twice = write_model({{"3.jpg", random_pose()}, {"b/000003.png", random_pose()}});
  const libmap::Error error = error_of([&] { libmap::import_poses(twice, scan); });
  EXPECT_EQ(error.context().file, twice.string());
  EXPECT_EQ(error.context().value, "b/000003.png");
  EXPECT_EQ(error.context().field, "image of node 3");
  write_text(scratch_folder() / "few.kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const libmap::Error few =
      error_of([&] { libmap::import_poses(scratch_folder() / "few.kitti", scan); });
  EXPECT_EQ(few.context().file, (scratch_folder() / "few.kitti").string());
  EXPECT_EQ(few.context().value, "1");
  EXPECT_EQ(few.context().bound, "4");
  write_text(scratch_folder() / "none.txt", "# nothing\n");
  EXPECT_TRUE(is_error(error_of([&] { libmap::import_poses(scratch_folder() / "none.txt", scan); }),
                       {.field = "poses"}));
}

// Round trip of a real scan's stored poses by each format, to the precision of float32.
TEST(PoseImport, RealScanThroughEveryFormat) {
  GRASPMAP_REQUIRE_DATA();
  const libmap::RtabmapDatabase scan(graspmap_test::data_folder() / "scans" / "site_full.db");
  const libmap::Trajectory stored =
      libmap::trajectory_of(scan.graph(), libmap::PoseSource::optimized);
  for (const auto& [name, format] : libmap::trajectory_format_names()) {
    if (format == TrajectoryFormat::automatic || format == TrajectoryFormat::colmap ||
        format >= TrajectoryFormat::open3d)
      continue;
    SCOPED_TRACE(name);
    const fs::path path = scratch_folder() / (name + ".txt");
    libmap::write_trajectory_as(format, path, {stored, scan.graph().links});
    const libmap::ImportedPoses imported = libmap::import_poses(path, scan, {.format = format});
    EXPECT_THAT(imported.warnings, ElementsAre());
    ASSERT_EQ(imported.trajectory.poses.size(), stored.size());
    for (std::size_t i = 0; i < stored.size(); ++i) {
      EXPECT_EQ(imported.trajectory.poses[i].node, stored[i].node);
      EXPECT_LT((imported.trajectory.poses[i].world_from_base.matrix() -
                 stored[i].world_from_base.matrix())
                    .norm(),
                1e-14);
    }
  }
}

}  // namespace pose_import_test
