#include "libgtd/score/voxel_matching.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <sstream>

#include "libgtd/score/scoring.h"
#include "tests/libgtd/score/score_test_support.h"
#include "tests/support/reference_data.h"

namespace {

using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using graspmap_test::whole_box;
using libgtd::Gripper;
using libgtd::GripperMask;
using libgtd::Method;
using libgtd::TileBounds;
using libgtd::Voxel;
using libgtd::VoxelCounts;
using libgtd::VoxelGrid;

struct ReferenceCase {
  const char* name;
  const char* points;  // which cloud was voxelized
  const char* gripper;
  double opening_angle_deg;
  Method method;
  double voxel_size_m;
  int extra_void_layers;
};

void PrintTo(const ReferenceCase& given, std::ostream* out) { *out << given.name; }

class AuthorsProgram : public testing::TestWithParam<ReferenceCase> {
 protected:
  std::filesystem::path file(const std::string& kind) const {
    return graspmap_test::reference_folder() / "gtd" / (std::string(GetParam().name) + "." + kind);
  }
  VoxelGrid grid() const {
    return libgtd::voxelize_thesis(
        graspmap_test::read_points_f32_gz(file(std::string(GetParam().points) + ".f32.gz")),
        GetParam().voxel_size_m);
  }
};

TEST_P(AuthorsProgram, SameVoxels) {
  GRASPMAP_REQUIRE_REFERENCE();
  const VoxelGrid voxelized = grid();
  const auto reference = graspmap_test::read_voxels_gz(file("voxels.csv.gz"));
  EXPECT_EQ(reference.dims,
            (std::array<int, 3>{voxelized.max.i + 1, voxelized.max.j + 1, voxelized.max.k + 1}));
  ASSERT_EQ(voxelized.voxels.size(), reference.voxels.size());
  std::size_t differences = 0;
  for (std::size_t n = 0; n < reference.voxels.size(); ++n) {
    const auto& [i, j, k] = reference.voxels[n];
    differences += voxelized.voxels[n] != Voxel{i, j, k} ? 1 : 0;
  }
  EXPECT_EQ(differences, 0U);
}

TEST_P(AuthorsProgram, SameCountsAndScoreOfEveryPivot) {
  GRASPMAP_REQUIRE_REFERENCE();
  const ReferenceCase& given = GetParam();
  const VoxelGrid voxelized = grid();
  Gripper gripper = gripper_named(given.gripper);
  gripper.opening_angle_deg = given.opening_angle_deg;
  const GripperMask mask = libgtd::make_gripper_mask(
      gripper, {given.method, given.voxel_size_m, given.extra_void_layers});
  const auto pivots = libgtd::pivots_in(voxelized, mask, whole_box(voxelized));
  const auto counts = libgtd::match_voxels(voxelized, mask, whole_box(voxelized), pivots);
  const auto reference = graspmap_test::read_scores_gz(file("scores.csv.gz"));
  ASSERT_EQ(pivots.size(), reference.rows.size());
  std::size_t differences = 0;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const auto& [i, j, k, ssv, gsv] = reference.rows[n];
    differences += voxelized.voxels[pivots[n]] != Voxel{i, j, k} ? 1 : 0;
    differences +=
        counts[n] != VoxelCounts{static_cast<std::uint32_t>(ssv), static_cast<std::uint32_t>(gsv)}
            ? 1
            : 0;
    // The file holds nine digits.
    const double expected = reference.score_percent[n];
    const int threshold = given.voxel_size_m < 0.002 ? 100 : 120;
    const double percent = libgtd::score_percent(counts[n], given.method, threshold);
    differences += std::abs(percent - expected) > 1e-8 * std::abs(expected) ? 1 : 0;
  }
  EXPECT_EQ(differences, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    All, AuthorsProgram,
    testing::Values(ReferenceCase{"artificial_rocks.thesis", "transformed", "scar-e", 85,
                                  Method::thesis, 0.01, 1},
                    ReferenceCase{"artificial_rocks.envelope", "transformed", "scar-e", 80,
                                  Method::envelope, 0.01, 1},
                    ReferenceCase{"leaning_holds_scare.thesis", "transformed", "scar-e", 85,
                                  Method::thesis, 0.01, 1},
                    ReferenceCase{"primitive_shapes.thesis", "interpolated", "scar-e", 85,
                                  Method::thesis, 0.005, 5},
                    ReferenceCase{"leaning_holds_hubrobo.thesis", "interpolated", "hubrobo", 75,
                                  Method::thesis, 0.001, 3},
                    ReferenceCase{"leaning_holds_hubrobo.envelope", "interpolated", "hubrobo", 75,
                                  Method::envelope, 0.001, 3}));

// ClimbLab's voxels are upside down (0 is the highest layer), and its list of graspable points
// counts x and y from 1.
TEST(ClimbLab, SameGraspableVoxels) {
  GRASPMAP_REQUIRE_REFERENCE();
  const auto folder = graspmap_test::reference_folder() / "climblab";
  std::istringstream lines(graspmap_test::read_gz(folder / "leaning_holds.voxels.txt.gz"));
  int nx = 0;
  int ny = 0;
  int nz = 0;
  std::size_t occupied = 0;
  lines >> nx >> ny >> nz >> occupied;
  std::vector<Voxel> voxels;
  for (Voxel voxel; lines >> voxel.i >> voxel.j >> voxel.k;)
    voxels.push_back({voxel.i, voxel.j, nz - 1 - voxel.k});
  ASSERT_EQ(voxels.size(), occupied);
  const VoxelGrid grid = grid_of(voxels);
  const GripperMask mask =
      libgtd::make_gripper_mask(gripper_named("hubrobo"), {Method::climblab, 0.001, 0});
  const auto pivots = libgtd::pivots_in(grid, mask, whole_box(grid));
  const auto counts = libgtd::match_voxels(grid, mask, whole_box(grid), pivots);
  std::set<std::array<int, 4>> graspable;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& voxel = grid.voxels[pivots[n]];
    if (libgtd::meets_threshold(counts[n], 0.0, Method::climblab, 120, 0.8))
      graspable.insert({voxel.i + 1, voxel.j + 1, voxel.k, static_cast<int>(counts[n].ssv)});
  }
  std::set<std::array<int, 4>> reference;
  std::istringstream table(graspmap_test::read_text(folder / "leaning_holds.graspable.txt"));
  for (std::string line; std::getline(table, line);) {
    std::istringstream numbers(line);
    std::array<int, 4> row{};
    if (numbers >> row[0] >> row[1] >> row[2] >> row[3]) reference.insert(row);
  }
  ASSERT_EQ(reference.size(), 35U);
  EXPECT_EQ(graspable, reference);
}

TEST(VoxelMatching, AgreesWithTheTripleLoop) {
  for (const auto& [name, method] : libgtd::method_names())
    for (const double voxel_size_m : {0.01, 0.003}) {
      const GripperMask mask =
          libgtd::make_gripper_mask(gripper_named("scar-e"), {method, voxel_size_m, 2});
      const VoxelGrid grid = grid_of(graspmap_test::random_ground(95, -40, 9));
      const auto pivots = libgtd::pivots_in(grid, mask, whole_box(grid));
      EXPECT_EQ(libgtd::match_voxels(grid, mask, whole_box(grid), pivots),
                libgtd::match_voxels_plainly(grid, mask, pivots))
          << name << " " << voxel_size_m;
    }
}

}  // namespace
