#include "libgtd/score/voxel_matching.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <sstream>

#include "tests/libgtd/instruction_sets.h"
#include "tests/libgtd/plain_matching.h"
#include "tests/libgtd/score/score_test_support.h"
#include "tests/support/reference_data.h"

namespace voxel_matching_test {

using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using graspmap_test::uniform;
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
  const char* points;  // name of the voxelized cloud
  const char* gripper;
  double opening_angle_deg;
  Method method;
  double voxel_size_m;
  int extra_void_layers;
};

void PrintTo(const ReferenceCase& given, std::ostream* out) { *out << given.name; }

// Loops for the vector registers of this processor.
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
  const auto counts = libgtd::match_voxels(voxelized, mask, pivots);
  for (const auto instructions : graspmap_test::instruction_sets())
    EXPECT_TRUE(libgtd::match_voxels(voxelized, mask, pivots, instructions) == counts);
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
    // The file contains nine digits.
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

// ClimbLab's voxels are upside down (0 is the highest layer), and its list of graspable points has
// x and y from 1.
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
  const auto counts = libgtd::match_voxels(grid, mask, pivots);
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

void expect_as_plainly(const VoxelGrid& grid, const GripperMask& mask,
                       const std::vector<std::size_t>& pivots, const std::string& what) {
  const auto expected = graspmap_test::match_voxels_plainly(grid, mask, pivots);
  for (const auto instructions : graspmap_test::instruction_sets())
    EXPECT_TRUE(libgtd::match_voxels(grid, mask, pivots, instructions) == expected)
        << what << ", instructions " << static_cast<int>(instructions);
}

void expect_as_plainly(const VoxelGrid& grid, const GripperMask& mask, const std::string& what) {
  expect_as_plainly(grid, mask, libgtd::pivots_in(grid, mask, whole_box(grid)), what);
}

TEST(VoxelMatching, AgreesWithTheTripleLoop) {
  for (const auto& [name, method] : libgtd::method_names())
    for (const double voxel_size_m : {0.01, 0.004})
      expect_as_plainly(
          grid_of(graspmap_test::random_ground(voxel_size_m < 0.01 ? 70 : 95, -40, 9)),
          libgtd::make_gripper_mask(gripper_named("scar-e"), {method, voxel_size_m, 2}),
          name + " " + std::to_string(voxel_size_m));
}

// Mask of random bits with the fraction `fraction` set; V = 1 everywhere if `counts_all`.
GripperMask random_mask(int side, int layers, double fraction, bool counts_all) {
  GripperMask mask;
  mask.method = Method::corrected;
  mask.side = side;
  mask.layers = mask.solid_layers = layers;
  mask.pivot_xy = static_cast<int>(uniform(0, side));
  mask.pivot_z = static_cast<int>(uniform(0, layers));
  const int size = side * side * layers;
  for (int n = 0; n < size; ++n) {
    mask.solid.push_back(uniform(0, 1) < fraction ? 1 : 0);
    mask.counted.push_back(counts_all || uniform(0, 1) < fraction ? 1 : 0);
  }
  return mask;
}

// Ground with many voxels per column.
std::vector<Voxel> porous_ground(int side, int layers) {
  std::vector<Voxel> voxels;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < layers; ++k)
        if (uniform(0, 1) < 0.3) voxels.push_back({i - 5, j + 77, k - 3});
  return voxels;
}

TEST(VoxelMatching, MasksOfAnySizeAndAnyNumberOfLayers) {
  for (const int side : {1, 2, 7, 31, 32, 33, 64, 65, 97})
    for (const int layers : {1, 3, 15, 16, 17, 31, 32, 33, 70}) {
      if (side * side * layers > 80000) continue;
      for (const bool counts_all : {true, false})
        for (const double fraction : {0.02, 0.6})
          expect_as_plainly(grid_of(porous_ground(6, 18)),
                            random_mask(side, layers, fraction, counts_all),
                            std::to_string(side) + " x " + std::to_string(layers));
    }
}

TEST(VoxelMatching, MasksWithoutASolidVoxelOrOfNothingElse) {
  const VoxelGrid grid = grid_of(porous_ground(12, 40));
  for (const double fraction : {0.0, 1.0})
    for (const bool counts_all : {true, false})
      expect_as_plainly(grid, random_mask(13, 37, fraction, counts_all), std::to_string(fraction));
}

// Box sums have 16 bits: a row of columns with 260 x 255 voxels does not fit.
TEST(VoxelMatching, FullGroundUnderAMaskTooLargeForSmallSums) {
  std::vector<Voxel> voxels;
  for (int i = 0; i < 260; ++i)
    for (int k = 0; k < 255; ++k) voxels.push_back({i, 3, k});
  const VoxelGrid grid = grid_of(voxels);
  GripperMask mask = random_mask(260, 255, 1.0, true);
  mask.pivot_xy = 130;
  mask.pivot_z = 127;
  const std::vector<std::size_t> pivots = {0, 130 * 255 + 127, voxels.size() - 1};
  expect_as_plainly(grid, mask, pivots, "full ground");
}

// All bits set: counts of bytes must be summed before they overflow.
TEST(VoxelMatching, FullGroundUnderAFullMask) {
  constexpr int side = 68, layers = 32;
  std::vector<Voxel> voxels;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < layers; ++k) voxels.push_back({i, j, k});
  const VoxelGrid grid = grid_of(voxels);
  GripperMask mask = random_mask(64, layers, 1.0, true);
  mask.pivot_xy = 32;
  mask.pivot_z = 16;
  std::vector<std::size_t> pivots;
  for (const std::size_t i : {33u, 34u, 67u})
    for (const std::size_t j : {32u, 33u, 35u}) pivots.push_back((i * side + j) * layers + 16);
  expect_as_plainly(grid, mask, pivots, "V = 1");
  mask.counted.front() = 0;
  expect_as_plainly(grid, mask, pivots, "one voxel not counted");
}

// Distant levels: bits move by less than a plane, by planes, and out of the window.
TEST(VoxelMatching, GapsBetweenLevels) {
  std::vector<Voxel> voxels;
  for (const int level : {0, 1, 3, 15, 31, 32, 64, 113, 114, 500})
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j)
        if (uniform(0, 1) < 0.5) voxels.push_back({i, j, level});
  for (const int layers : {10, 40, 100})
    expect_as_plainly(grid_of(voxels), random_mask(7, layers, 0.5, layers == 40),
                      std::to_string(layers));
}

TEST(VoxelMatching, AnyChoiceOfPivots) {
  const VoxelGrid grid = grid_of(graspmap_test::random_ground(200, -90, 30));
  const GripperMask mask =
      libgtd::make_gripper_mask(gripper_named("scar-e"), {Method::corrected, 0.01, 1});
  const auto all = libgtd::pivots_in(grid, mask, whole_box(grid));
  const auto counts = libgtd::match_voxels(grid, mask, all);
  std::vector<std::size_t> some;
  std::vector<VoxelCounts> expected;
  for (std::size_t n = 0; n < all.size(); ++n)
    if (uniform(0, 1) < 0.01) {
      some.push_back(all[n]);
      expected.push_back(counts[n]);
    }
  EXPECT_EQ(libgtd::match_voxels(grid, mask, some), expected);
  EXPECT_TRUE(libgtd::match_voxels(grid, mask, {}).empty());
}

// Empty space between distant points costs neither time nor memory.
TEST(VoxelMatching, StrayVoxelsFarAway) {
  std::vector<Voxel> voxels = graspmap_test::random_ground(40);
  const GripperMask mask =
      libgtd::make_gripper_mask(gripper_named("scar-e"), {Method::corrected, 0.01, 1});
  VoxelGrid grid = grid_of(voxels);
  const auto counts =
      libgtd::match_voxels(grid, mask, libgtd::pivots_in(grid, mask, whole_box(grid)));
  for (const Voxel far : {Voxel{20, 20, 1 << 28}, Voxel{1 << 28, -(1 << 28), 3}}) {
    voxels.push_back(far);
    grid = grid_of(voxels);
    const auto pivots = libgtd::pivots_in(grid, mask, whole_box(grid));
    const auto with_far = libgtd::match_voxels(grid, mask, pivots);
    std::size_t same = 0;
    for (std::size_t n = 0; n < pivots.size(); ++n)
      if (std::abs(grid.voxels[pivots[n]].i) < 100 && grid.voxels[pivots[n]].k < 100)
        EXPECT_EQ(with_far[n], counts[same++]);
      else
        EXPECT_EQ(with_far[n], (VoxelCounts{1, 1}));
    EXPECT_EQ(same, counts.size());
  }
}

}  // namespace voxel_matching_test
