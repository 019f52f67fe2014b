#include "libgtd/grasp/grasp_trials.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <set>

#include "libgtd/grasp/grasp_table.h"
#include "libmap/core/parallel.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace grasp_trials_test {

using grasp_test::gripper;
using grasp_test::height_mesh;
using grasp_test::with_lean;
using graspmap_test::error_of;
using libgtd::GraspOptions;
using libgtd::LocationResult;
using libgtd::TrialOutcome;

constexpr double degree = libmap::radians_per_degree;
const double phi = std::atan(0.39);

// The palm rests on the location.
GraspOptions certain() {
  GraspOptions options;
  options.poses = 2;
  options.draws = 2;
  options.offset_m = 0;
  options.tilt_deg = 0;
  options.closing.max_unseen = 1;  // a shape without ground around it
  return options;
}

std::vector<LocationResult> test_on(const libmap::TriangleMesh& mesh,
                                    const std::vector<Eigen::Vector3d>& locations,
                                    const GraspOptions& options,
                                    const libgtd::Gripper& of = gripper()) {
  const libgtd::Ground ground(mesh);
  return libgtd::test_grasps(ground, of, locations, options, libmap::no_progress());
}

// Pull away from the ground of a gripper whose drives do not resist opening.
double pull_away(const libmap::TriangleMesh& mesh, const Eigen::Vector3d& location,
                 const libgtd::Gripper& of, double psi_deg) {
  const libgtd::Ground ground(mesh);
  const libgtd::Trial trial =
      libgtd::repeat_trial(ground, with_lean(of, psi_deg), location, certain(), 0, 0);
  return libgtd::holding_force(trial.bearing, Eigen::Vector3d::UnitZ(),
                               {.load_point = trial.gripper.patch_from_gripper.translation(),
                                .closing_force_n = of.fingers->closing_force_n,
                                .holds_when_closed = false});
}

// m P tan(g + psi + phi - 90 deg), from mesh to force, within 2 %.
TEST(GraspTrials, ClosedFormsFromMeshToForce) {
  const libgtd::Gripper of = gripper({{"fingers.spine_force_limit_n", "1000"}});
  const auto expected = [](double slope_deg, double psi_deg) {
    const double angle = (slope_deg + psi_deg - 90) * degree + phi;
    return angle > 0 ? 8 * 10 * std::tan(angle) : 0;
  };
  for (const double psi : {30.0, 65.0, 72.0, 80.0, 88.0}) {
    const double force = expected(0, psi);
    EXPECT_NEAR(
        pull_away(height_mesh(0.3, 30, [](double, double) { return 0.0; }), {0, 0, 0}, of, psi),
        force, 0.02 * force + 1e-6)
        << psi;
  }
  // Cones that fall outward at g.
  for (const double slope : {20.0, 35.0})
    for (const double psi : {20.0, 45.0, 60.0}) {
      const double fall = std::tan(slope * degree);
      const auto cone = grasp_test::revolved({{0.001, -0.001 * fall}, {0.3, -0.3 * fall}}, 720);
      const double force = expected(slope, psi);
      EXPECT_NEAR(pull_away(cone, {0, 0, -0.002}, of, psi), force, 0.02 * force + 1e-6)
          << slope << " " << psi;
    }
  // A sphere with contacts on its upper part; g is the polar angle of the contacts.
  std::vector<Eigen::Vector2d> sphere;
  for (int n = 1; n < 400; ++n)
    sphere.emplace_back(0.1 * std::sin(n * std::numbers::pi / 400),
                        0.1 * (std::cos(n * std::numbers::pi / 400) - 1));
  const auto ball = grasp_test::revolved(sphere, 720);
  for (const double psi : {20.0, 45.0}) {
    const libgtd::Trial trial = libgtd::repeat_trial(libgtd::Ground(ball), with_lean(of, psi),
                                                     {0, 0, -0.0002}, certain(), 0, 0);
    ASSERT_EQ(trial.gripper.contacts.size(), 8u);
    ASSERT_TRUE(trial.gripper.contacts[0].by_spines);
    const double polar = std::acos(trial.gripper.contacts[0].normal.z()) / degree;
    EXPECT_GT(polar, 30.0);
    const double force = expected(polar, psi);
    EXPECT_NEAR(pull_away(ball, {0, 0, -0.0002}, of, psi), force, 0.02 * force) << psi;
  }
  // A post: m mu P.
  const libgtd::Gripper narrow =
      gripper({{"fingers.spine_force_limit_n", "1000"}, {"closing_angle_deg", "1"}});
  std::vector<Eigen::Vector2d> post = {{0.0005, 0}, {0.04, 0}};
  for (int n = 1; n <= 60; ++n) post.emplace_back(0.04, -0.005 * n);
  post.emplace_back(0.3, -0.3);
  EXPECT_NEAR(pull_away(grasp_test::revolved(post, 720), {0, 0, 0}, narrow, 0), 8 * 10 * 0.39,
              0.02 * 8 * 10 * 0.39);
}

libmap::TriangleMesh bumps() {
  return height_mesh(0.6, 120, [](double x, double y) {
    return 0.05 * std::cos(31 * x) * std::cos(27 * y) + 0.01 * std::sin(90 * x + 40 * y);
  });
}

std::vector<Eigen::Vector3d> places_on(const libmap::TriangleMesh& mesh, int count) {
  std::vector<Eigen::Vector3d> places;
  libmap::RandomStream random(4, 4);
  while (static_cast<int>(places.size()) < count) {
    const Eigen::Vector3d& place = mesh.vertices[random.below(mesh.vertices.size())];
    if (place.head<2>().cwiseAbs().maxCoeff() < 0.4) places.push_back(place);
  }
  return places;
}

GraspOptions few_trials() {
  GraspOptions options;
  options.poses = 6;
  options.draws = 4;
  return options;
}

std::string text_of(const std::vector<LocationResult>& results) {
  std::string text;
  for (const LocationResult& result : results)
    for (const std::string& cell : libgtd::grasp_cells(result)) text += cell + ",";
  return text;
}

TEST(GraspTrials, SameBytesForAnyThreadsAndOrder) {
  const auto mesh = bumps();
  auto places = places_on(mesh, 12);
  const auto results = test_on(mesh, places, few_trials());
  for (const unsigned threads : {1U, 2U, 8U}) {
    const libmap::ThreadLimit limit(threads);
    EXPECT_EQ(text_of(test_on(mesh, places, few_trials())), text_of(results));
  }
  std::reverse(places.begin(), places.end());
  auto reversed = test_on(mesh, places, few_trials());
  std::reverse(reversed.begin(), reversed.end());
  EXPECT_EQ(text_of(reversed), text_of(results));
  GraspOptions other = few_trials();
  other.seed = 2;
  std::reverse(places.begin(), places.end());
  EXPECT_NE(text_of(test_on(mesh, places, other)), text_of(results));
}

// Parameters of the mask have no effect.
TEST(GraspTrials, DoNotDependOnTheMask) {
  const auto mesh = bumps();
  const auto places = places_on(mesh, 4);
  const std::string usual = text_of(test_on(mesh, places, few_trials()));
  for (const auto& [key, value] : {std::pair{"top_solid_margin_mm", "30"},
                                   {"bottom_void_margin_mm", "9"},
                                   {"closing_height_mm", "20"},
                                   {"opening_spine_radius_mm", "80"},
                                   {"opening_spine_depth_mm", "50"},
                                   {"spine_depth_mm", "20"}})
    EXPECT_EQ(text_of(test_on(mesh, places, few_trials(), gripper({{key, value}}))), usual) << key;
  EXPECT_NE(text_of(test_on(mesh, places, few_trials(), gripper({{"spine_length_mm", "45"}}))),
            usual);
}

TEST(GraspTrials, CountsAddUp) {
  const auto mesh = bumps();
  bool any_holds = false;
  for (const LocationResult& result : test_on(mesh, places_on(mesh, 30), few_trials())) {
    std::size_t trials = 0;
    for (const std::size_t count : result.outcomes) trials += count;
    EXPECT_EQ(trials, 24u);
    EXPECT_EQ(result.trials, 24u);
    EXPECT_NEAR(result.spine_fingers + result.link_fingers + result.free_fingers,
                8 * (1 - static_cast<double>(result.outcomes[1]) / 24), 1e-9);
    EXPECT_LE(result.hold_low, result.hold_probability);
    EXPECT_GE(result.hold_high, result.hold_probability);
    EXPECT_LE(result.force_n[0], result.force_n[1]);
    EXPECT_LE(result.force_n[1], result.force_n[2]);
    any_holds |= result.holds();
  }
  EXPECT_TRUE(any_holds);
}

TEST(GraspTrials, ALargerLoadHoldsLess) {
  const auto mesh = bumps();
  const auto places = places_on(mesh, 10);
  double last = 1.0;
  for (const double load : {1.0, 5.0, 20.0, 100.0}) {
    GraspOptions options = few_trials();
    options.load_n = load;
    double mean = 0;
    for (const LocationResult& result : test_on(mesh, places, options))
      mean += result.hold_probability / 10;
    EXPECT_LE(mean, last);
    last = mean;
    GraspOptions twice = options;
    twice.load_n = load / 2;
    twice.safety = 2;
    EXPECT_EQ(text_of(test_on(mesh, places, twice)), text_of(test_on(mesh, places, options)));
  }
  EXPECT_LT(last, 0.1);
}

// Two sets: each trial of the ensemble is a trial of one of the sets.
TEST(GraspTrials, AnEnsembleMixesItsSets) {
  const auto mesh = bumps();
  const auto places = places_on(mesh, 8);
  GraspOptions options;
  options.poses = 32;
  options.draws = 8;
  options.load_n = 8;
  libgtd::Gripper weak = gripper({{"fingers.spine_force_limit_n", "1"}});
  libgtd::Gripper both = weak;
  libgtd::ParameterValues strong = parameters_of(weak);
  strong[0] = 10;
  both.ensemble = {{0.25, parameters_of(weak)}, {0.75, strong}};
  const auto of_weak = test_on(mesh, places, options, weak);
  const auto of_strong = test_on(mesh, places, options, with_parameters(weak, strong));
  const auto of_both = test_on(mesh, places, options, both);
  for (std::size_t n = 0; n < places.size(); ++n) {
    const double expected =
        0.25 * of_weak[n].hold_probability + 0.75 * of_strong[n].hold_probability;
    EXPECT_NEAR(of_both[n].hold_probability, expected, 0.06) << n;
    EXPECT_EQ(of_weak[n].parameter_spread, 0);
    EXPECT_EQ(of_both[n].has_force, of_strong[n].has_force);
  }
  // A single set of any weight, and an additional set of weight 0.
  both.ensemble = {{1.0, strong}};
  EXPECT_EQ(text_of(test_on(mesh, places, options, both)), text_of(of_strong));
  both.ensemble = {{1.0, strong}, {0.0, parameters_of(weak)}};
  EXPECT_EQ(text_of(test_on(mesh, places, options, both)), text_of(of_strong));
  options.ensemble = false;
  EXPECT_EQ(text_of(test_on(mesh, places, options, both)), text_of(of_weak));
}

// On level ground all forces are proportional to closing force and spine limit. Two sets that
// differ by a factor of four have a spread of ln 4 / sqrt 2 between them; the spread within sets is
// unchanged.
TEST(GraspTrials, SpreadsOfTrialsAndSets) {
  const auto mesh = height_mesh(0.4, 4, [](double, double) { return 0.0; });
  GraspOptions options;
  options.poses = 32;
  options.draws = 16;
  const libgtd::Gripper one = gripper({{"fingers.spine_force_limit_n", "2"}});
  libgtd::Gripper two = one;
  libgtd::ParameterValues larger = parameters_of(one);
  larger[0] *= 4;
  larger[1] *= 4;
  two.ensemble = {{0.5, parameters_of(one)}, {0.5, larger}};
  const LocationResult of_one = test_on(mesh, {{0, 0, 0}}, options, one)[0];
  const LocationResult of_two = test_on(mesh, {{0, 0, 0}}, options, two)[0];
  EXPECT_NEAR(of_two.parameter_spread, std::log(4.0) / std::sqrt(2.0), 0.1);
  EXPECT_NEAR(of_two.trial_spread, of_one.trial_spread, 0.05);
  EXPECT_LT(of_one.force_range_n[0], of_one.force_n[1]);
  EXPECT_GT(of_two.force_range_n[1], 3 * of_one.force_n[1]);
}

TEST(GraspTrials, ATrialIsRepeated) {
  const auto mesh = bumps();
  const auto places = places_on(mesh, 6);
  GraspOptions options = few_trials();
  const libgtd::Ground ground(mesh);
  for (const LocationResult& result : test_on(mesh, places, options)) {
    const libgtd::Trial trial = libgtd::repeat_trial(ground, gripper(), result.location, options,
                                                     result.median_pose, result.median_draw);
    EXPECT_NEAR(trial.force_n, result.force_n[1], 1e-9);
    EXPECT_EQ(trial.outcome == TrialOutcome::holds, trial.force_n >= options.load_n);
  }
}

TEST(GraspTrials, FailuresAreNamed) {
  const auto outcome_on = [](const libmap::TriangleMesh& mesh, const GraspOptions& options,
                             double psi_deg = 88, double drag_mm = 5) {
    libgtd::Gripper of = with_lean(gripper(), psi_deg);
    of.engagement.drag_mm = drag_mm;
    const LocationResult result = test_on(mesh, {{0, 0, 0}}, options, of)[0];
    const auto most = std::max_element(result.outcomes.begin(), result.outcomes.end());
    EXPECT_EQ(*most, result.trials);
    return static_cast<TrialOutcome>(most - result.outcomes.begin());
  };
  const auto flat = height_mesh(0.3, 60, [](double, double) { return 0.0; });
  EXPECT_EQ(outcome_on(flat, certain(), 30), TrialOutcome::engagement);
  GraspOptions strong = certain();
  strong.load_n = 1000;
  EXPECT_EQ(outcome_on(flat, strong), TrialOutcome::load);
  EXPECT_EQ(outcome_on(flat, certain(), 88, 0), TrialOutcome::contact);
  const auto step = height_mesh(0.3, 60, [](double x, double) { return x > 0.08 ? 0.6 : 0.0; });
  EXPECT_EQ(outcome_on(step, certain()), TrialOutcome::approach);
  auto hole = flat;
  std::erase_if(hole.triangles, [&](const libmap::Triangle& triangle) {
    return hole.vertices[triangle[0]].head<2>().norm() > 0.06;
  });
  GraspOptions usual = certain();
  usual.closing.max_unseen = 0.1;
  EXPECT_EQ(outcome_on(hole, usual), TrialOutcome::unseen);
}

TEST(GraspTrials, AlongTheGroundsNormal) {
  // A wall: its normal is horizontal.
  auto wall = height_mesh(
      0.3, 60, [](double x, double y) { return 0.04 * std::cos(40 * x) * std::cos(40 * y); });
  auto tilted = wall;
  for (Eigen::Vector3d& vertex : tilted.vertices)
    vertex = Eigen::AngleAxisd(80 * degree, Eigen::Vector3d::UnitX()) * vertex;
  GraspOptions options = certain();
  const libgtd::Gripper rough = with_lean(gripper(), 60);
  options.approach = libgtd::ApproachDirection::normal;
  const Eigen::Vector3d top(0, 0, 0.04);
  const Eigen::Vector3d there = Eigen::AngleAxisd(80 * degree, Eigen::Vector3d::UnitX()) * top;
  const LocationResult level = test_on(wall, {top}, options, rough)[0];
  const LocationResult steep = test_on(tilted, {there}, options, rough)[0];
  EXPECT_GT(level.spine_fingers, 4);
  EXPECT_NEAR(steep.spine_fingers, level.spine_fingers, 1.1);
  EXPECT_NEAR(steep.clearance_m, level.clearance_m, 8e-3);  // at another yaw
}

TEST(GraspTrials, SequentialVerdictsAreTheFullOnes) {
  const auto mesh = bumps();
  const auto places = places_on(mesh, 60);
  GraspOptions options;
  options.draws = 8;
  options.best_draws = 0;
  const auto full = test_on(mesh, places, options);
  options.sequential = true;
  const auto early = test_on(mesh, places, options);
  std::size_t trials = 0;
  int agree = 0;
  for (std::size_t n = 0; n < places.size(); ++n) {
    trials += early[n].trials;
    agree += early[n].holds() == full[n].holds() ? 1 : 0;
    // 4, 8, 16 and 32 poses with 2 draws each, then 32 with more.
    ASSERT_TRUE(std::has_single_bit(early[n].trials) && early[n].trials >= 8 &&
                early[n].trials <= 256);
    const double poses = std::min(32.0, static_cast<double>(early[n].trials) / 2.0);
    EXPECT_EQ(early[n].hold_high, libgtd::wilson_interval(early[n].hold_probability, poses).second);
    EXPECT_LE(early[n].spine_fingers + early[n].link_fingers + early[n].free_fingers, 8.000001);
    if (early[n].trials < 64) {
      const auto [low, high] = libgtd::wilson_interval(early[n].hold_probability, poses, 1.645);
      EXPECT_TRUE(low > 0.5 || high < 0.5);
    }
    EXPECT_LT(early[n].median_pose, 32);
    EXPECT_LT(early[n].median_draw, 8);
  }
  EXPECT_GE(agree, 59);
  EXPECT_LT(trials, 60u * 30u);
  // The neighbors of a location have no effect.
  EXPECT_EQ(text_of(test_on(mesh, {places[7]}, options)), text_of({early[7]}));
}

// If half of the trials hold, all are run. If slightly more hold, the draws of all 32 poses end
// once the remaining ones are not expected to change the verdict.
TEST(GraspTrials, SequentialTestsOfUnclearPlacesGoOn) {
  const auto mesh = bumps();
  GraspOptions options;
  options.draws = 8;
  options.best_draws = 0;
  const auto all = test_on(mesh, places_on(mesh, 60), options);
  const auto best = std::max_element(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.force_n[1] < b.force_n[1];
  });
  options.load_n = best->force_n[1];
  options.sequential = true;
  const LocationResult unclear = test_on(mesh, {best->location}, options)[0];
  EXPECT_EQ(unclear.trials, 256u);
  EXPECT_NEAR(unclear.hold_probability, 0.5, 0.01);
  options.sequential = false;
  EXPECT_EQ(text_of({unclear}), text_of(test_on(mesh, {best->location}, options)));
  options.sequential = true;
  std::set<std::size_t> trials;
  for (double fraction = 0.7; fraction < 1.3; fraction += 0.02) {
    options.load_n = fraction * best->force_n[1];
    const LocationResult one = test_on(mesh, {best->location}, options)[0];
    trials.insert(one.trials);
    if (one.trials >= 64 && one.trials < 256) {
      EXPECT_GT(std::abs(one.hold_probability - 0.5), 0.01);
    }
  }
  EXPECT_TRUE(trials.contains(64) || trials.contains(128));
}

TEST(GraspTrials, SequentialRounds) {
  GraspOptions options;
  options.poses = 20;
  options.draws = 5;
  ASSERT_EQ(libgtd::sequential_rounds(options).size(), 1u);
  options.sequential = true;
  const auto rounds = libgtd::sequential_rounds(options);
  ASSERT_EQ(rounds.size(), 6u);
  EXPECT_EQ(rounds[0].poses, 4);
  EXPECT_EQ(rounds[2].poses, 16);
  EXPECT_EQ(rounds[2].draws, 2);
  EXPECT_EQ(rounds[3].poses, 20);
  EXPECT_EQ(rounds[3].draws, 2);
  EXPECT_EQ(rounds[4].draws, 4);
  EXPECT_EQ(rounds[5].poses, 20);
  EXPECT_EQ(rounds[5].draws, 5);
  options.poses = 3;
  EXPECT_EQ(libgtd::sequential_rounds(options).size(), 3u);
  options.draws = 1;
  EXPECT_EQ(libgtd::sequential_rounds(options).size(), 1u);
}

// A patch contains the triangles that intersect the cylinder, compared with all triangles; small,
// large and distant ones are found.
TEST(GraspTrials, PatchesHoldAllTriangles) {
  auto mesh = bumps();
  const auto large = height_mesh(1.5, 3, [](double, double) { return -0.2; });
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), large.vertices.begin(), large.vertices.end());
  for (const auto& [a, b, c] : large.triangles)
    mesh.triangles.push_back({a + first, b + first, c + first});
  const libgtd::Ground ground(mesh);
  for (const Eigen::Vector3d& away : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.6, 0.2, 0.7)})
    for (const double radius : {0.01, 0.1}) {
      const auto patch = ground.patch({0.1, -0.05, 0.0}, away, radius, 0.2);
      const Eigen::Isometry3d patch_from_mesh = patch.mesh_from_patch.inverse();
      std::vector<Eigen::Vector3d> centers;
      for (const auto& triangle : mesh.triangles) {
        Eigen::Vector3d center = Eigen::Vector3d::Zero();
        bool is_in = false;
        for (const std::uint32_t vertex : triangle) {
          const Eigen::Vector3d corner = patch_from_mesh * mesh.vertices[vertex];
          center += corner / 3.0;
          is_in |= corner.head<2>().norm() <= radius && corner.z() <= 0.2;
        }
        if (is_in) centers.push_back(center);
      }
      ASSERT_GT(centers.size(), 3u);
      // In the order of the mesh, among others outside.
      std::size_t next = 0;
      for (const Eigen::Vector3d& center : patch.centers)
        if (next < centers.size() && (center - centers[next]).norm() < 1e-9) ++next;
      EXPECT_EQ(next, centers.size());
      EXPECT_LT(patch.triangles.size(), 4 * centers.size() + 80);
    }
}

TEST(GraspTrials, WilsonsInterval) {
  const auto [low, high] = libgtd::wilson_interval(0.5, 10);
  EXPECT_NEAR(low, 0.2366, 1e-4);
  EXPECT_NEAR(high, 0.7634, 1e-4);
  EXPECT_EQ(libgtd::wilson_interval(0, 32).first, 0);
  EXPECT_NEAR(libgtd::wilson_interval(0, 32).second, 0.1072, 1e-4);
}

TEST(GraspTrials, BadInputIsNamed) {
  const auto mesh = bumps();
  const auto field = [&](const GraspOptions& options, const Eigen::Vector3d& place,
                         libgtd::Gripper of = gripper()) {
    return error_of([&] { test_on(mesh, {{0, 0, 0.05}, place}, options, of); }).context().field;
  };
  EXPECT_EQ(field({}, {0, 0, 0.2}), "location 2");
  EXPECT_EQ(field({}, {5, 0, 0}), "location 2");
  GraspOptions options;
  options.poses = 0;
  EXPECT_EQ(field(options, {0, 0, 0.05}), "trials");
  options = {};
  libgtd::Gripper without = gripper();
  without.engagement.friction = -0.1;
  EXPECT_EQ(field(options, {0, 0, 0.05}, without), "engagement.friction");
  without.engagement = {.asperity_min_deg = 60, .asperity_max_deg = 30};
  EXPECT_EQ(field(options, {0, 0, 0.05}, without), "engagement.asperity_min_deg");
  without = gripper();
  without.fingers.reset();
  EXPECT_EQ(field({}, {0, 0, 0.05}, without), "fingers");
}

}  // namespace grasp_trials_test
