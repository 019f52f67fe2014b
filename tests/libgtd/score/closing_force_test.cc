// Compares forces of method `calibrated` with closed forms and a slow implementation of the
// definition.
#include "libgtd/score/closing_force.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "libgtd/detect.h"
#include "tests/libgtd/score/score_test_support.h"

namespace closing_force_test {

using graspmap_test::error_of;
using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using libgtd::ClosingPath;
using libgtd::ForceEstimate;
using libgtd::Gripper;
using libgtd::Voxel;
using libgtd::VoxelGrid;

constexpr double degree = std::numbers::pi / 180;

// Share of beta(4, 2) below this number of standard deviations above its mean, of 1 - x.
double beta_fraction(double deviations) {
  const double t = std::clamp(1.0 / 3 + std::sqrt(8.0 / 252) * deviations, 0.0, 1.0);
  return t * t * (10 - 20 * t + 15 * t * t - 4 * t * t * t);
}

// One parameter set, known.
Gripper known(const std::string& name = "scar-e") {
  Gripper gripper = gripper_named(name);
  gripper.ranges = {};
  return gripper;
}

std::vector<ForceEstimate> forces_on(const VoxelGrid& grid, const ClosingPath& path) {
  std::vector<std::size_t> all(grid.voxels.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return libgtd::closing_forces(grid, path, all);
}

ForceEstimate force_at_origin(const std::vector<Voxel>& ground, const Gripper& gripper = known(),
                              double load_n = 5) {
  const VoxelGrid grid = grid_of(ground);
  const auto at = std::find_if(grid.voxels.rbegin(), grid.voxels.rend(),
                               [](const Voxel& v) { return v.i == 0 && v.j == 0; });
  const auto place = static_cast<std::size_t>(grid.voxels.rend() - at - 1);
  return libgtd::closing_forces(grid, libgtd::make_closing_path(gripper, 0.01, load_n), {place})[0];
}

template <typename Height>
std::vector<Voxel> ground(const Height& height, int half = 30) {
  std::vector<Voxel> voxels;
  for (int i = -half; i <= half; ++i)
    for (int j = -half; j <= half; ++j) voxels.push_back({i, j, height(i, j)});
  return voxels;
}

// One facet angle: min(tan b / (1 - c tan b), n L / P sin b), b = fall + psi + phi - 90 deg.
TEST(FingerPulls, ClosedFormOfOneLean) {
  Gripper gripper = known();
  gripper.engagement.asperity_min_deg = gripper.engagement.asperity_max_deg = 70;
  gripper.engagement.engagement_rate = 100;
  for (const bool holds : {false, true})
    for (const double limit_n : {0.5, 100.0}) {
      gripper.fingers->holds_when_closed = holds;
      gripper.fingers->spine_force_limit_n = limit_n;
      const libgtd::FingerPulls pulls =
          libgtd::finger_pulls(gripper, {{1.0, parameters_of(gripper)}});
      EXPECT_NEAR(pulls.max_spine_forces[0], 10 * limit_n / 10, 1e-5);
      EXPECT_EQ(pulls.total_closing_forces_n[0], 80);
      EXPECT_NEAR(pulls.level_spreads[0], 0, 1e-3);
      for (const int fall : {-90, -30, 0, 15, 45, 60}) {  // on the grid of the table
        const double b = (fall + 70 - 90) * degree + std::atan(0.39);
        const double sine = std::sin(fall * degree);
        const double c =
            holds ? std::max(0.0, sine * std::cos(fall * degree)) / (1 + sine * sine) : 0.0;
        double expected = limit_n * std::sin(std::min(b, 90 * degree));
        if (b < 90 * degree && c * std::tan(b) < 1)
          expected = std::min(expected, std::tan(b) / (1 - c * std::tan(b)));
        if (b <= 0) expected = 0;
        EXPECT_NEAR(pulls.at(fall)[0], expected, 1e-5 * (1 + expected))
            << fall << " " << limit_n << " " << holds;
      }
    }
}

// Spines that meet a facet with a chance of 1/2 and bear their limit: a binomial distribution.
TEST(FingerPulls, SpreadOfSpinesThatEngage) {
  Gripper gripper = known();
  gripper.engagement.asperity_min_deg = gripper.engagement.asperity_max_deg = 80;
  gripper.engagement.engagement_rate = std::log(2.0) / gripper.engagement.drag_mm;
  gripper.fingers->spine_force_limit_n = 0.1;
  const auto pulls = libgtd::finger_pulls(gripper, {{1.0, parameters_of(gripper)}});
  EXPECT_NEAR(pulls.level_spreads[0], std::sqrt(0.5 / (10 * 0.5)), 0.05);
  // Without a facet against which a spine can pull, the spread is at its bound.
  gripper.engagement.asperity_min_deg = gripper.engagement.asperity_max_deg = 10;
  EXPECT_EQ(libgtd::finger_pulls(gripper, {{1.0, parameters_of(gripper)}}).level_spreads[0], 4);
}

TEST(FingerPulls, RiseWithFallFrictionAndLimit) {
  const Gripper gripper = known();
  libgtd::ParameterValues rough = parameters_of(gripper);
  rough[2] = 0.6;
  libgtd::ParameterValues strong = parameters_of(gripper);
  strong[0] = 10;
  const auto pulls =
      libgtd::finger_pulls(gripper, {{0.4, parameters_of(gripper)}, {0.3, rough}, {0.3, strong}});
  for (int fall = -90; fall <= 90; ++fall) {
    EXPECT_LE(pulls.at(fall)[0], pulls.at(fall)[1]);
    EXPECT_LE(pulls.at(fall)[0], pulls.at(fall)[2]);
    if (fall > -90 && fall <= 0) {
      EXPECT_LE(pulls.at(fall - 1)[0], pulls.at(fall)[0]);
    }
  }
}

// Equal contacts: C is the bounded pull of one contact; the palm rests on the open fingers.
TEST(ClosingForce, LevelGround) {
  const Gripper gripper = known();
  const ClosingPath path = libgtd::make_closing_path(gripper, 0.01, 5);
  double depth = 0.0;
  for (const ClosingPath::PathPoint& point : path.open) depth = std::max(depth, point.depth_m);
  EXPECT_NEAR(depth, (40 * std::cos(85 * degree) + 41 * std::cos(65 * degree)) / 1000, 1e-12);
  double c = path.pulls.at(0)[0];
  c /= std::sqrt(1 + c * c / (0.55 * 0.55));
  const double v = path.pulls.level_spreads[0];
  const double probability =
      1 / (1 + std::exp(-(1.234 + 1.623 + 3.988 + 0.679 * std::log(c + 0.003) - 1.203 * v)));
  const double log_force =
      std::log(80.0) + 0.293 + 1.006 * std::log(c) - 0.446 * depth / 0.081 - 0.537 * v;
  const double spread = std::exp(-1.540 + 0.745 * v);
  const auto survival = [&](double force) {
    return probability * beta_fraction((log_force - std::log(force)) / spread);
  };
  const auto level = ground([](int, int) { return 4; });
  for (const double load_n : {1.0, 3.0, 5.0})
    EXPECT_NEAR(force_at_origin(level, gripper, load_n).hold_probability, survival(load_n), 2e-3);
  const ForceEstimate force = force_at_origin(level, gripper);
  EXPECT_NEAR(survival(force.median_n), 0.5, 0.02);
  EXPECT_NEAR(survival(force.low_n), 0.95, 0.02);
  EXPECT_NEAR(survival(force.high_n), 0.05, 0.02);
  EXPECT_NEAR(force.trial_spread, spread, 1e-3);
  EXPECT_NEAR(force.parameter_spread, 0, 1e-3);
}

TEST(ClosingForce, DoesNotDependOnTheOrigin) {
  const auto bumps = [](int base) {
    return ground([base](int i, int j) { return base + (i * i + 3 * j) % 7; });
  };
  const ForceEstimate low = force_at_origin(bumps(0));
  const ForceEstimate high = force_at_origin(bumps(1000000));  // 10 km
  EXPECT_NEAR(high.hold_probability, low.hold_probability, 1e-5);
  EXPECT_NEAR(high.median_n, low.median_n, 1e-4 * low.median_n);
}

TEST(ClosingForce, ShapesInOrder) {
  const auto flat = force_at_origin(ground([](int, int) { return 0; }));
  // A cone: the ground falls outward, so that spines bear more force.
  const auto cone = force_at_origin(
      ground([](int i, int j) { return -static_cast<int>(std::lround(0.6 * std::hypot(i, j))); }));
  EXPECT_GT(cone.median_n, 2 * flat.median_n);
  // A thin post over a deep pit, and the edge of a cliff: no contact on one side.
  const auto post = force_at_origin(
      ground([](int i, int j) { return std::max(std::abs(i), std::abs(j)) < 1 ? 0 : -40; }));
  EXPECT_LT(post.hold_probability, 0.1);
  EXPECT_EQ(post.median_n, 0);
  const auto cliff = force_at_origin(ground([](int i, int) { return i <= 1 ? 0 : -40; }));
  EXPECT_LT(cliff.hold_probability, 0.2);
  // A narrow pit: the open fingers rest on its rim, the palm is far above the voxel.
  const auto pit =
      force_at_origin(ground([](int i, int j) { return std::hypot(i, j) < 4 ? -12 : 0; }));
  EXPECT_LT(pit.median_n, 0.7 * flat.median_n);
}

// The probability over an ensemble is the mean over its sets; quantiles are ordered.
TEST(ClosingForce, AnEnsembleIsAMixture) {
  const auto bumps = ground([](int i, int j) { return (i * i + 3 * j) % 5; });
  Gripper gripper = gripper_named("scar-e");
  const std::vector<libgtd::ParameterSet> sets = parameter_sets(gripper);
  ASSERT_EQ(sets.size(), 64U);
  for (const double load_n : {1.0, 5.0, 20.0}) {
    double mean = 0.0;
    for (const libgtd::ParameterSet& set : sets) {
      gripper.ensemble = {{1.0, set.values}};
      mean += force_at_origin(bumps, gripper, load_n).hold_probability * set.weight;
    }
    gripper.ensemble.clear();
    // All sets use the weakest side of the parameters of the gripper file.
    EXPECT_NEAR(force_at_origin(bumps, gripper, load_n).hold_probability, mean, 1e-4) << load_n;
  }
  const ForceEstimate force = force_at_origin(bumps, gripper);
  EXPECT_LE(force.low_n, force.median_n);
  EXPECT_LT(force.median_n, force.high_n);
  EXPECT_GT(force.parameter_spread, force.trial_spread);
}

double fraction_at_origin(const std::vector<Voxel>& ground) {
  const VoxelGrid grid = grid_of(ground);
  const auto mask =
      libgtd::make_gripper_mask(gripper_named("scar-e"), {libgtd::Method::corrected, 0.01, 1});
  const auto at = std::find_if(grid.voxels.rbegin(), grid.voxels.rend(),
                               [](const Voxel& v) { return v.i == 0 && v.j == 0; });
  return libgtd::outward_fall_fractions(grid, mask,
                                        {static_cast<std::size_t>(grid.voxels.rend() - at - 1)})[0];
}

// The circle of the closed spines has a radius of 49.4 mm, that of the open fingers one of 127 mm.
TEST(OutwardShares, OfShapes) {
  const auto ball = [](double radius) {
    return ground([radius](int i, int j) {
      const double square = radius * radius - i * i - j * j;
      return square > 0 ? static_cast<int>(std::floor(std::sqrt(square))) : 0;
    });
  };
  EXPECT_EQ(fraction_at_origin(ball(4)), 0);
  EXPECT_EQ(fraction_at_origin(ball(5)), 0);
  for (const double radius : {7.5, 10.0, 15.0, 25.0})
    EXPECT_EQ(fraction_at_origin(ball(radius)), 1);
  // A fall of one voxel may be rounding, two voxels are a fall.
  const auto step = [](int fall) {
    return ground([fall](int i, int j) { return std::hypot(i, j) < 9 ? 0 : -fall; });
  };
  EXPECT_EQ(fraction_at_origin(step(0)), 0);
  EXPECT_EQ(fraction_at_origin(step(1)), 0);
  EXPECT_EQ(fraction_at_origin(step(2)), 1);
  // A bowl and a pit fall inward. On a slope of 45 degrees, the azimuths at right angles to its
  // fall are level.
  EXPECT_EQ(fraction_at_origin(step(-5)), 0);
  EXPECT_EQ(fraction_at_origin(ground([](int i, int) { return i; })), 7.0 / 16);
  EXPECT_EQ(fraction_at_origin(ground([](int i, int) { return i + 1000000; })), 7.0 / 16);
}

TEST(OutwardShares, SkipColumnsWithoutGround) {
  auto voxels = ground([](int i, int j) { return std::hypot(i, j) < 9 ? 0 : -3; });
  std::erase_if(voxels, [](const Voxel& v) { return v.i > 8; });
  EXPECT_LT(fraction_at_origin(voxels), 1);
  EXPECT_GT(fraction_at_origin(voxels), 0.5);
  std::erase_if(voxels, [](const Voxel& v) { return std::hypot(v.i, v.j) > 1; });
  EXPECT_EQ(fraction_at_origin(voxels), 0);
}

TEST(ClosingForce, UpToThreeColumnsOfAGapAreFilled) {
  const auto holes = [](int width) {
    std::vector<Voxel> voxels = ground([](int, int) { return 0; });
    std::erase_if(voxels, [&](const Voxel& v) { return v.i >= 5 && v.i < 5 + width; });
    return force_at_origin(voxels);
  };
  const ForceEstimate flat = force_at_origin(ground([](int, int) { return 0; }));
  EXPECT_NEAR(holes(6).hold_probability, flat.hold_probability, 1e-6);
  EXPECT_LT(holes(20).hold_probability, 0.8 * flat.hold_probability + 0.01);
}

// By definition, column by column from a map; the gripper rests on the column of the pivot.
struct SlowColumn {
  double contact = 0.0;
  double capacity = 0.0;
  double rise = 0.0;
  double tilt = 0.0;
};

SlowColumn slow_column(const std::map<std::pair<int, int>, double>& heights, const Voxel& pivot,
                       const ClosingPath& path) {
  const auto at = [&](int i, int j) {
    const auto found = heights.find({i, j});
    return found == heights.end() ? -1e9 : found->second;
  };
  const auto offset = [](double meters) { return static_cast<int>(std::lround(meters / 0.01)); };
  double palm = -1e9;
  for (int i = -10; i <= 10; ++i)
    for (int j = -10; j <= 10; ++j)
      if (0.01 * std::hypot(i, j) <= path.palm_radius_m)
        palm = std::max(palm, at(pivot.i + i, pivot.j + j));
  for (int a = 0; a < 16; ++a)
    for (const ClosingPath::PathPoint& point : path.open) {
      const double angle = a * std::numbers::pi / 8;
      palm = std::max(palm, point.depth_m + at(pivot.i + offset(point.radius_m * std::cos(angle)),
                                               pivot.j + offset(point.radius_m * std::sin(angle))));
    }
  std::vector<double> contacts(16, 0);
  std::vector<double> pulls(16, 0);
  std::vector<double> max_spine_forces(16, 0);
  Eigen::Vector2d moment(0, 0);
  double touching = 0;
  for (int a = 0; a < 16; ++a) {
    const double angle = a * std::numbers::pi / 8;
    for (const ClosingPath::PathPoint& point : path.closing) {
      const int i = pivot.i + offset(point.radius_m * std::cos(angle));
      const int j = pivot.j + offset(point.radius_m * std::sin(angle));
      if (at(i, j) <= palm - point.depth_m + 1e-5) continue;
      if (point.has_spines) {
        const auto slope = [&](double low, double high) {
          return low < -1e8 || high < -1e8 ? 0.0 : (high - low) / 0.02;
        };
        const double fall = -slope(at(i - 1, j), at(i + 1, j)) * std::cos(angle) -
                            slope(at(i, j - 1), at(i, j + 1)) * std::sin(angle);
        contacts[static_cast<std::size_t>(a)] = 1;
        const auto fall_deg = static_cast<int>(std::lround(std::atan(fall) / degree));
        pulls[static_cast<std::size_t>(a)] = path.pulls.at(fall_deg)[0];
        max_spine_forces[static_cast<std::size_t>(a)] =
            path.pulls.max_spine_forces[0] * std::cos(std::atan(fall));
        moment += point.depth_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
        touching += 1;
      }
      break;
    }
  }
  const auto weakest = [](const std::vector<double>& values) {
    double least = 1e9;
    for (int side = 0; side < 16; ++side) {
      double sum = 0;
      double all = 0;
      for (int a = 0; a < 16; ++a) {
        const double weight = std::max(0.0, std::cos((a - side) * std::numbers::pi / 8));
        sum += weight * values[static_cast<std::size_t>(a)];
        all += weight;
      }
      least = std::min(least, sum / all);
    }
    return least;
  };
  double capacity = 1e9;
  for (const double u : {0.0, 0.5, 1.0, 2.0, 4.0})
    for (int side = 0; side < 16; ++side) {
      double sum = 0;
      for (int a = 0; a < 16; ++a) {
        const double weight = 1 - u * std::cos((a - side) * std::numbers::pi / 8);
        const auto n = static_cast<std::size_t>(a);
        sum += (weight > 0 ? weight * pulls[n] : -weight * max_spine_forces[n]) / 16;
      }
      capacity = std::min(capacity, sum);
    }
  const double length = path.finger_length_m;
  return {weakest(contacts), capacity / std::sqrt(1 + std::pow(capacity / 0.55, 2)),
          (palm - 0.01 * (pivot.k + 0.5)) / length,
          touching > 0 ? moment.norm() / touching / length : 0};
}

// Mean and spread of ln(force / 1 N), and the probability of a force.
struct SlowForce {
  double probability = 0.0;
  double log_force = 0.0;
  double spread = 0.0;
};
SlowForce slow_force(const std::map<std::pair<int, int>, double>& heights, const Voxel& pivot,
                     const ClosingPath& path, std::map<std::pair<int, int>, SlowColumn>& there) {
  const double sigma = path.finger_length_m / 4;
  const double height = 0.01 * (pivot.k + 0.5);
  SlowColumn mean;
  double weights = 0;
  double with_force = 0;
  double logs = 0;
  double squares = 0;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j) {
      const std::pair<int, int> column{pivot.i + i, pivot.j + j};
      const double distance = 0.01 * std::hypot(i, j);
      if ((i + j) % 2 != 0 || distance > 2 * sigma || !heights.contains(column)) continue;
      if (!there.contains(column))
        there[column] = slow_column(heights, {column.first, column.second, 0}, path);
      const SlowColumn& one = there[column];
      const double weight = std::exp(-distance * distance / (2 * sigma * sigma));
      weights += weight;
      mean.contact += weight * one.contact;
      mean.capacity += weight * one.capacity;
      mean.rise += weight * (one.rise + (0.005 - height) / path.finger_length_m);
      mean.tilt += weight * one.tilt;
      if (one.capacity <= 0.0005) continue;
      with_force += weight;
      logs += weight * std::log(one.capacity);
      squares += weight * std::pow(std::log(one.capacity), 2);
    }
  if (with_force == 0) return {};
  const double log = logs / with_force;
  const double variance = std::max(0.0, squares / with_force - log * log);
  const double v = path.pulls.level_spreads[0];
  const double logit = 1.234 + 1.623 * with_force / weights + 3.988 * mean.contact / weights +
                       0.679 * std::log(mean.capacity / weights + 0.003) - 1.203 * v;
  return {1 / (1 + std::exp(-logit)),
          std::log(path.pulls.total_closing_forces_n[0]) + 0.293 + 1.006 * log -
              0.446 * mean.rise / weights + 0.663 * mean.tilt / weights - 0.537 * v,
          std::exp(std::clamp(-1.540 + 1.056 * std::sqrt(variance) + 0.745 * v, -3.0, 1.0))};
}

TEST(ClosingForce, AgreesWithItsDefinition) {
  const VoxelGrid grid = grid_of(graspmap_test::random_ground(80, -33, 12));
  const ClosingPath path = libgtd::make_closing_path(known("limbero"), 0.01, 1);
  std::map<std::pair<int, int>, double> heights;
  for (const Voxel& voxel : grid.voxels) heights[{voxel.i, voxel.j}] = 0.01 * (voxel.k + 0.5);
  for (int round = 0; round < 3; ++round) {
    auto filled = heights;
    for (int i = -40; i < 60; ++i)
      for (int j = 0; j < 100; ++j) {
        if (heights.contains({i, j})) continue;
        double sum = 0;
        int count = 0;
        for (int di = -1; di <= 1; ++di)
          for (int dj = -1; dj <= 1; ++dj)
            if (const auto found = heights.find({i + di, j + dj}); found != heights.end()) {
              sum += found->second;
              ++count;
            }
        if (count > 0) filled[{i, j}] = sum / count;
      }
    heights = filled;
  }
  const auto forces = forces_on(grid, path);
  std::size_t differences = 0;
  std::size_t held = 0;
  std::map<std::pair<int, int>, SlowColumn> there;
  for (std::size_t n = 0; n < forces.size(); ++n) {
    const SlowForce slow = slow_force(heights, grid.voxels[n], path, there);
    const double expected =
        slow.probability == 0 ? 0 : slow.probability * beta_fraction(slow.log_force / slow.spread);
    held += expected > 0.3 ? 1 : 0;
    // A height on a layer boundary or an angle between two degrees may round either way in single
    // precision.
    if (std::abs(forces[n].hold_probability - expected) > 3e-3) ++differences;
  }
  EXPECT_GT(held, 10U);
  EXPECT_LE(differences, forces.size() / 100) << forces.size();
}

TEST(Calibrated, TheScoreIsTheHoldProbability) {
  libgtd::DetectionOptions options;
  options.scenario.method = libgtd::Method::calibrated;
  options.scenario.curvature_radius_m = 0.0;
  options.gripper = gripper_named("scar-e");
  const auto found = libgtd::detect(graspmap_test::bumpy_cloud(0.8, 0.006), options);
  ASSERT_GT(found.map.voxels.size(), 1000U);
  for (const libgtd::MapVoxel& one : found.map.voxels) {
    ASSERT_EQ(one.score, one.force.hold_probability);
    ASSERT_EQ(one.graspable, one.score >= 0.5);  // no zero plane
  }
  const auto cloud = to_cloud(found.map, libgtd::MapFrame::terrain);
  for (const char* field : {"hold_probability", "holding_force_n", "holding_force_low_n",
                            "holding_force_high_n", "trial_spread", "parameter_spread"})
    EXPECT_NE(cloud.find_field(field), nullptr) << field;
  // Counts equal those of `corrected`.
  options.scenario.method = libgtd::Method::corrected;
  const auto corrected = libgtd::detect(graspmap_test::bumpy_cloud(0.8, 0.006), options);
  ASSERT_EQ(corrected.map.voxels.size(), found.map.voxels.size());
  for (std::size_t n = 0; n < found.map.voxels.size(); ++n)
    ASSERT_TRUE(found.map.voxels[n].counts == corrected.map.voxels[n].counts);
  EXPECT_EQ(to_cloud(corrected.map, libgtd::MapFrame::terrain).find_field("holding_force_n"),
            nullptr);
}

TEST(Calibrated, AGripperWithoutFingersIsNamed) {
  Gripper gripper = known();
  gripper.fingers.reset();
  EXPECT_EQ(
      error_of([&] { libgtd::make_gripper_mask(gripper, {.method = libgtd::Method::calibrated}); })
          .context()
          .field,
      "fingers");
  libgtd::DetectionOptions options;
  options.scenario.method = libgtd::Method::calibrated;
  options.scenario.orientation = libgtd::Orientation::surface;
  EXPECT_EQ(error_of([&] { libgtd::detect(graspmap_test::bumpy_cloud(0.4, 0.01), options); })
                .context()
                .field,
            "orientation");
}

}  // namespace closing_force_test
