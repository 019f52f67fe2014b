#include <gtest/gtest.h>

#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/world/world.h"
#include "tests/libmap/world/falling_balls.h"
#include "tests/libmap/world/world_samples.h"
#include "tests/support/test_support.h"

namespace world_test {

namespace fs = std::filesystem;
using namespace graspmap_test;
using libmap::TriangleMesh;

libmap::WorldModelInput input_of(const TriangleMesh& mesh, const std::string& name = "site") {
  libmap::WorldModelInput input;
  input.name = name;
  input.visual.mesh = mesh;
  input.surface = mesh;
  return input;
}

struct Written {
  libmap::WorldScene scene;
  libmap::WorldReport report;
};

Written write(const fs::path& folder, const TriangleMesh& mesh,
              const libmap::WorldOptions& options = {}) {
  Written written;
  written.scene.name = "test";
  written.scene.options = options;
  written.scene.models = {
      libmap::write_world_model(folder, input_of(mesh), {}, options, written.report)};
  libmap::write_world(folder, written.scene);
  return written;
}

TEST(World, BallsFallOnIt) {
  const fs::path folder = scratch_folder();
  const TriangleMesh mesh = ground_with_boulder();
  const Written written = write(folder, mesh);
  EXPECT_GT(written.report.balls, 20U);
  const auto places = places_above(mesh, 200, 0.1);
  const double field_bound = written.scene.options.field.max_deviation_m;
  EXPECT_LE(written.report.field_deviation_m, field_bound);
  expect_on_surface(drop_in_mujoco(folder, places), mesh, field_bound);
  expect_on_surface(drop_in_bullet(folder, places), mesh, written.report.collision_deviation_m);
}

TEST(World, BallsFallOnAScannedSite) {
  if (graspmap_test::data_folder().empty()) GTEST_SKIP() << "GRASPMAP_DATA is not set";
  TriangleMesh mesh =
      libmap::read_mesh(graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply").mesh;
  std::vector<bool> keep;
  for (const libmap::Triangle& t : mesh.triangles)
    keep.push_back(libmap::center_of(mesh, t).head<2>().cwiseAbs().maxCoeff() < 0.45);
  mesh = libmap::select_triangles(mesh, keep);
  const fs::path folder = scratch_folder();
  const Written written = write(folder, mesh);
  const auto places = places_above(mesh, 40, 0.1);
  const double field_bound = written.scene.options.field.max_deviation_m;
  EXPECT_LE(written.report.field_deviation_m, field_bound);
  expect_on_surface(drop_in_mujoco(folder, places), mesh, field_bound);
  expect_on_surface(drop_in_bullet(folder, places), mesh, written.report.collision_deviation_m);
}

// Ground without overhangs needs no balls.
TEST(World, FlatGroundIsAHeightFieldOnly) {
  const fs::path folder = scratch_folder();
  const TriangleMesh mesh = wavy_ground();
  const Written written = write(folder, mesh);
  EXPECT_EQ(written.report.balls, 0U);
  EXPECT_EQ(written.report.missing_cells, 0U);
  expect_on_surface(drop_in_mujoco(folder, places_above(mesh, 20, 0.1)), mesh,
                    written.report.field_deviation_m);
}

}  // namespace world_test
