#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sdf/sdf.hh>

#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/simulate/robot_cameras.h"
#include "libmap/world/world.h"
#include "tests/libmap/world/world_samples.h"
#include "tests/support/test_support.h"

namespace world_files_test {

namespace fs = std::filesystem;
using namespace graspmap_test;

libmap::WorldRig sample_rig() {
  return {libmap::read_rig(source_folder() / "data/rigs/scar-e.yaml"),
          libmap::make_pose_from_rpy({-0.2, 0.1, 0.28}, {3.0, 12.0, 40.0})};
}

libmap::WorldReport write_sample(const fs::path& folder, libmap::WorldScene& scene,
                                 const libmap::TriangleMesh& mesh) {
  libmap::WorldReport report;
  libmap::WorldModelInput input;
  input.name = "site";
  input.visual.mesh = mesh;
  input.surface = mesh;
  scene.models = {libmap::write_world_model(folder, input, {}, scene.options, report)};
  libmap::write_world(folder, scene);
  return report;
}

libmap::WorldScene full_scene() {
  libmap::WorldScene scene;
  scene.name = "rocks <&> \"1\"";
  scene.notes = {"a note -- with hyphens --", "second"};
  scene.options.gravity = "moon";
  scene.options.restitution = 0.3;
  scene.options.sensor_noise_m = 0.002;
  scene.rig = sample_rig();
  scene.footholds = {{{0.1, 0.2, 0.3}, Eigen::Vector3d(0, -0.6, 0.8), {34, 170, 34}},
                     {{0.0, 0.0, 0.1}, Eigen::Vector3d::UnitZ(), {255, 235, 0}}};
  return scene;
}

TEST(WorldFiles, SdfParsesWithoutAWarning) {
  const fs::path folder = scratch_folder();
  libmap::WorldScene scene = full_scene();
  write_sample(folder, scene, ground_with_boulder());
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  sdf::Root root;
  const sdf::Errors errors = root.Load((folder / "world.sdf").string());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  for (const sdf::Error& error : errors) ADD_FAILURE() << error.Message();
  ASSERT_EQ(root.WorldCount(), 1U);
  const sdf::World& world = *root.WorldByIndex(0);
  EXPECT_EQ(world.Name(), scene.name);
  EXPECT_EQ(world.Gravity().Z(), -1.62);
  ASSERT_EQ(world.ModelCount(), 3U);
  const sdf::Link& ground = *world.ModelByName("site")->LinkByIndex(0);
  const sdf::Collision& collision = *ground.CollisionByIndex(0);
  EXPECT_TRUE(fs::exists(folder / collision.Geom()->MeshShape()->Uri()));
  EXPECT_EQ(collision.Element()
                ->GetElement("surface")
                ->GetElement("friction")
                ->GetElement("ode")
                ->Get<double>("mu"),
            0.8);
  EXPECT_TRUE(fs::exists(folder / ground.VisualByIndex(0)->Geom()->MeshShape()->Uri()));
  EXPECT_EQ(world.ModelByName("footholds")->LinkByIndex(0)->VisualCount(), 2U);
  const sdf::Model& rig = *world.ModelByName("rig");
  ASSERT_EQ(rig.LinkByIndex(0)->SensorCount(), 6U);
  for (std::uint64_t n = 0; n < 6; ++n) {
    const sdf::Sensor& sensor = *rig.LinkByIndex(0)->SensorByIndex(n);
    const libmap::RigCamera& camera = scene.rig->rig.cameras[n];
    EXPECT_EQ(sensor.Name(), camera.name);
    const sdf::Camera& lens = *sensor.CameraSensor();
    EXPECT_EQ(lens.ImageWidth(), 640U);
    EXPECT_NEAR(lens.HorizontalFov().Degree(), 87.0, 1e-3);
    EXPECT_EQ(lens.NearClip(), 0.28);
    EXPECT_EQ(lens.FarClip(), 1.5);
    EXPECT_EQ(lens.ImageNoise().StdDev(), 0.002);
    // The camera looks along x.
    const auto pose = rig.RawPose() * sensor.RawPose();
    const auto forward = pose.Rot().RotateVector({1, 0, 0});
    const Eigen::Vector3d expected =
        (scene.rig->world_from_robot * camera.camera.base_from_camera).linear().col(2);
    EXPECT_LT((Eigen::Vector3d(forward.X(), forward.Y(), forward.Z()) - expected).norm(), 1e-6);
  }
}

TEST(WorldFiles, MujocoHasTheCamerasAndGravity) {
  const fs::path folder = scratch_folder();
  libmap::WorldScene scene = full_scene();
  write_sample(folder, scene, ground_with_boulder());
  char text[1000] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(
      mj_loadXML((folder / "world.xml").c_str(), nullptr, text, sizeof(text)), mj_deleteModel);
  ASSERT_NE(model, nullptr) << text;
  EXPECT_STREQ(text, "");
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  mj_forward(model.get(), data.get());
  EXPECT_EQ(model->opt.gravity[2], -1.62);
  EXPECT_EQ(model->nsite, 2);
  ASSERT_EQ(model->ncam, 6);
  for (int n = 0; n < 6; ++n) {
    const libmap::Pose expected =
        scene.rig->world_from_robot *
        scene.rig->rig.cameras[static_cast<std::size_t>(n)].camera.base_from_camera;
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> turn(data->cam_xmat +
                                                                              9 * n);
    const Eigen::Map<const Eigen::Vector3d> place(data->cam_xpos + 3 * n);
    EXPECT_LT((place - expected.translation()).norm(), 1e-9);
    EXPECT_LT((turn.col(0) - expected.linear().col(0)).norm(), 1e-9);
    EXPECT_LT((turn.col(1) + expected.linear().col(1)).norm(), 1e-9);
    EXPECT_NEAR(model->cam_fovy[n], 58.0, 1e-3);
  }
}

// Depth images of the exported collision mesh against those of the visual mesh.
void expect_same_depth(const libmap::TriangleMesh& visual, const fs::path& folder,
                       const libmap::WorldRig& rig) {
  const libmap::TriangleMesh collision =
      libmap::read_mesh(folder / "meshes/site_collision.obj").mesh;
  const auto expected = libmap::simulate_robot_cameras(visual, rig.rig, rig.world_from_robot, {});
  const auto found = libmap::simulate_robot_cameras(collision, rig.rig, rig.world_from_robot, {});
  std::size_t pixels = 0;
  std::size_t near = 0;
  for (std::size_t n = 0; n < expected.size(); ++n)
    for (std::size_t i = 0; i < expected[n].depth.pixels.size(); ++i) {
      const int here = expected[n].depth.pixels[i];
      const int there = found[n].depth.pixels[i];
      if (here == 0 && there == 0) continue;
      ++pixels;
      near += std::abs(here - there) <= 3;  // mm
    }
  EXPECT_GT(pixels, 20000U);
  EXPECT_GE(static_cast<double>(near), 0.99 * static_cast<double>(pixels))
      << static_cast<double>(near) / static_cast<double>(pixels);
}

TEST(WorldFiles, TheRigSeesTheCollisionMeshAsTheVisualOne) {
  const fs::path folder = scratch_folder();
  libmap::WorldScene scene = full_scene();
  const libmap::TriangleMesh mesh = ground_with_boulder();
  write_sample(folder, scene, mesh);
  expect_same_depth(mesh, folder, *scene.rig);
}

// Points of both surfaces against distances by Embree.
TEST(WorldFiles, TheCollisionMeshIsWithinItsBound) {
  const libmap::TriangleMesh mesh = ground_with_boulder();
  for (const double error_m : {0.0005, 0.003}) {
    const fs::path folder = scratch_folder() / libmap::to_text(error_m);
    libmap::WorldScene scene;
    scene.name = "bound";
    scene.options.collision_error_m = error_m;
    const libmap::WorldReport report = write_sample(folder, scene, mesh);
    EXPECT_LE(report.collision_deviation_m, error_m);
    EXPECT_LT(report.collision_triangles, report.visual_triangles / 2);
    const libmap::TriangleMesh collision =
        libmap::read_mesh(folder / "meshes/site_collision.obj").mesh;
    EXPECT_EQ(collision.triangles.size(), report.collision_triangles);
    for (const auto& [from, to] : {std::pair(&mesh, &collision), {&collision, &mesh}}) {
      std::vector<Eigen::Vector3d> points = from->vertices;
      for (const libmap::SurfacePoint& point : libmap::sample_surface(*from, 1e5, 1))
        points.push_back(point.position);
      const std::vector<double> distances = libmap::distances_to_surface(points, *to);
      EXPECT_LE(*std::max_element(distances.begin(), distances.end()),
                report.collision_deviation_m + 1e-6);
    }
  }
}

TEST(WorldFiles, ForbiddenNames) {
  for (const char* name : {"", "world", "a::b", "__model__", "a\nb"}) {
    const libmap::Error error = error_of([&] { libmap::require_world_name(name, "name"); });
    EXPECT_EQ(error.context().field, "name");
    EXPECT_EQ(error.context().value, name);
  }
  for (const char* name : {"site", "a:b", "_x_", "W\xc3\xb6rld", "a b"})
    EXPECT_NO_THROW(libmap::require_world_name(name, "name"));
  libmap::WorldScene scene;
  scene.name = "a::b";
  EXPECT_EQ(error_of([&] { libmap::write_world({}, scene); }).context().value, "a::b");
  EXPECT_EQ(libmap::gravity_of("mars"), 3.71);
  EXPECT_EQ(libmap::gravity_of("6e-5"), 6e-5);
  for (const char* gravity : {"-1", "", "venus", "nan", "inf"})
    EXPECT_EQ(error_of([&] { libmap::gravity_of(gravity); }).context().value, gravity);
}

}  // namespace world_files_test
