// Tests the fit to pull tests: simulated pulls of a gripper with parameters other than the middle
// of the prior.
#include "libgtd/grasp/pull_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace pull_fit_test {

using grasp_test::height_mesh;
using graspmap_test::error_of;
using libgtd::Gripper;
using libgtd::PullTest;

libmap::TriangleMesh bumps() {
  return height_mesh(0.5, 60,
                     [](double x, double y) { return 0.05 * std::cos(31 * x) * std::cos(27 * y); });
}

libgtd::PullFitOptions few() {
  libgtd::PullFitOptions options;
  options.grasp.poses = 12;
  options.grasp.draws = 2;
  options.sets = 96;
  options.rounds = 3;
  return options;
}

// Pulls away from level ground and on bumps, of a gripper with these parameters.
std::vector<PullTest> simulated(const libgtd::Ground& ground, const Gripper& truth, int count) {
  std::vector<PullTest> tests;
  libmap::RandomStream random(3, 3);
  const libmap::TriangleMesh level_mesh = libgtd::level_ground();
  const libgtd::Ground level(level_mesh);
  libgtd::GraspOptions options;
  options.poses = options.draws = 1;
  for (int n = 0; n < count; ++n) {
    PullTest test;
    test.row = static_cast<std::size_t>(n) + 1;
    test.on_level_ground = n % 2 == 0;
    if (!test.on_level_ground)
      test.location = {random.uniform() < 0.5 ? 0.0 : 0.2026834, 0.0, 0.05};
    options.seed = 100 + static_cast<std::uint64_t>(n);
    const libgtd::ClosedPoses poses(test.on_level_ground ? level : ground, truth, test.location,
                                    options);
    test.force_n =
        poses.pull_forces(truth, Eigen::Vector3d::UnitZ(), 1)[0] * std::exp(0.15 * random.normal());
    tests.push_back(test);
  }
  return tests;
}

TEST(PullFit, FindsTheForceOfAnotherGripper) {
  const auto mesh = bumps();
  const libgtd::Ground ground(mesh);
  const Gripper prior = libgtd::find_gripper("scar-e");
  for (const double limit_n : {4.0, 10.0}) {
    Gripper truth = prior;
    truth.ranges = {};
    truth.fingers->spine_force_limit_n = limit_n;
    const auto tests = simulated(ground, truth, 8);
    const auto fit = libgtd::fit_pulls(&ground, prior, tests, few(), libmap::no_progress());
    Gripper fitted = prior;
    fitted.ensemble = fit.ensemble;
    double weight = 0;
    for (const libgtd::ParameterSet& set : fit.ensemble) weight += set.weight;
    EXPECT_NEAR(weight, 1, 1e-9);
    const libmap::TriangleMesh level_mesh = libgtd::level_ground();
    const libgtd::Ground level(level_mesh);
    const auto median = [&](const Gripper& gripper) {
      return libgtd::test_grasps(level, gripper, {{0, 0, 0}}, {}, libmap::no_progress())[0]
          .force_n[1];
    };
    EXPECT_NEAR(std::log(fit.level_after.median_n / median(truth)), 0, 0.35) << limit_n;
    EXPECT_GT(std::abs(std::log(fit.level_before.median_n / median(truth))), 0.35);
    EXPECT_LT(fit.level_after.high_n / std::max(0.05, fit.level_after.low_n),
              fit.level_before.high_n / std::max(0.05, fit.level_before.low_n));
    EXPECT_TRUE(fit.explains_tests()) << fit.mean_squared_score << " " << fit.effective_sets;
    EXPECT_EQ(fit.parameters.size(), 6U);
  }
}

TEST(PullFit, VerdictsMoveTheForceToTheirSide) {
  const Gripper prior = libgtd::find_gripper("scar-e");
  const auto level_after = [&](bool held) {
    std::vector<PullTest> tests(6);
    for (std::size_t n = 0; n < tests.size(); ++n) {
      tests[n].row = n + 1;
      tests[n].on_level_ground = true;
      tests[n].load_n = 4;
      tests[n].held = held;
    }
    return libgtd::fit_pulls(nullptr, prior, tests, few(), libmap::no_progress()).level_after;
  };
  EXPECT_GT(level_after(true).median_n, 4);
  EXPECT_LT(level_after(false).median_n, 2.5);
}

TEST(PullFit, TheSameBytesForAnyThreads) {
  const auto mesh = bumps();
  const libgtd::Ground ground(mesh);
  const Gripper prior = libgtd::find_gripper("scar-e");
  const auto tests = simulated(ground, grasp_test::gripper(), 3);
  const auto text = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    Gripper fitted = prior;
    fitted.ensemble =
        libgtd::fit_pulls(&ground, prior, tests, few(), libmap::no_progress()).ensemble;
    return to_yaml(fitted);
  };
  EXPECT_EQ(text(1), text(3));
}

// Forces that no parameters explain: a position ten times as strong as its equal.
TEST(PullFit, ContradictionsAreReported) {
  const Gripper prior = libgtd::find_gripper("scar-e");
  std::vector<PullTest> tests(8);
  for (std::size_t n = 0; n < tests.size(); ++n) {
    tests[n].row = n + 1;
    tests[n].on_level_ground = true;
    tests[n].force_n = n % 2 == 0 ? 1.0 : 12.0;
  }
  EXPECT_FALSE(
      libgtd::fit_pulls(nullptr, prior, tests, few(), libmap::no_progress()).explains_tests());
}

TEST(PullFit, BadTablesAreNamed) {
  const auto field_of = [](const std::string& text) {
    return error_of([&] { libgtd::pull_tests_of(libmap::parse_csv(text, "pulls.csv")); })
        .context()
        .field;
  };
  EXPECT_EQ(field_of("x,y,z,force_n\n"), "pull tests");
  EXPECT_EQ(field_of("x,y,z,force_n\n0,0,0,-1\n"), "row 1, force_n");
  EXPECT_EQ(field_of("x,y,z,held\n0,0,0,1\n"), "row 1, load_n");
  EXPECT_EQ(field_of("x,y,z,load_n,held\n0,0,0,5,\n"), "row 1, force_n");
  EXPECT_EQ(field_of("x,y,z,force_n,held\n0,0,0,5,1\n"), "row 1, held");
  EXPECT_EQ(field_of("x,y,force_n\n0,0,5\n"), "row 1, z");
  EXPECT_EQ(field_of("ground,force_n\nsand,5\n"), "row 1, ground");
  EXPECT_EQ(field_of("ground,tilt_deg,force_n\nlevel,0,3\nlevel,91,5\n"), "row 2, tilt_deg");
  const auto good = libgtd::pull_tests_of(
      libmap::parse_csv("ground,tilt_deg,azimuth_deg,force_n,load_n,held\nlevel,45,90,3.5,,\n"
                        "level,,,,20,0\n",
                        "pulls.csv"));
  ASSERT_EQ(good.size(), 2U);
  EXPECT_EQ(good[0].force_n, 3.5);
  EXPECT_EQ(good[0].azimuth_deg, 90);
  EXPECT_FALSE(good[1].force_n);
  EXPECT_FALSE(good[1].held);
}

TEST(PullFit, PullsThatCannotBeMadeAreNamed) {
  const auto mesh = bumps();
  const libgtd::Ground ground(mesh);
  const Gripper prior = libgtd::find_gripper("scar-e");
  PullTest test;
  test.row = 7;
  test.force_n = 3;
  const auto field = [&](const libgtd::Ground* on, const Eigen::Vector3d& location,
                         const Gripper& gripper) {
    test.location = location;
    return error_of([&] { libgtd::fit_pulls(on, gripper, {test}, few(), libmap::no_progress()); })
        .context()
        .field;
  };
  EXPECT_EQ(field(&ground, {3, 0, 0}, prior), "row 7");
  EXPECT_EQ(field(nullptr, {0, 0, 0.05}, prior), "row 7");
  EXPECT_EQ(field(&ground, {0, 0, 0.05}, grasp_test::gripper()), "ranges");
  EXPECT_EQ(error_of([&] { libgtd::fit_pulls(&ground, prior, {}, few(), libmap::no_progress()); })
                .context()
                .field,
            "pull tests");
  // A post too thin for the fingers.
  const auto post = grasp_test::revolved({{0.001, 0}, {0.002, 0}, {0.002, -0.5}, {0.4, -0.5}}, 24);
  const libgtd::Ground thin(post);
  EXPECT_EQ(field(&thin, {0, 0, 0}, prior), "row 7");
}

TEST(PlanPulls, PrefersWhatSeparatesTheSets) {
  const auto mesh = bumps();
  const libgtd::Ground ground(mesh);
  const Gripper prior = libgtd::find_gripper("scar-e");
  const std::vector<Eigen::Vector3d> candidates = {
      {0, 0, 0.05}, {0.2026834, 0, 0.05}, {0.1, 0.1, 0}};
  const auto plans = libgtd::plan_pulls(ground, prior, candidates, 2, few(), libmap::no_progress());
  ASSERT_EQ(plans.size(), 2U);
  EXPECT_GE(plans[0].information_bits, plans[1].information_bits);
  EXPECT_NE(plans[0].location, plans[1].location);
  EXPECT_GT(plans[0].information_bits, 0.2);
  EXPECT_LE(plans[0].information_bits, 1.0);
  EXPECT_GT(plans[0].load_n, 0.1);
  // A gripper with known parameters has nothing to fit.
  EXPECT_TRUE(
      libgtd::plan_pulls(ground, grasp_test::gripper(), candidates, 2, few(), libmap::no_progress())
          .empty());
}

}  // namespace pull_fit_test
