// The terms of method `calibrated` against closed forms and a slow look-up from the definition.
#include "libgtd/score/closing_terms.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "libgtd/detect.h"
#include "tests/libgtd/score/score_test_support.h"

namespace closing_terms_test {

using graspmap_test::error_of;
using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using libgtd::ClosingPath;
using libgtd::ClosingTerms;
using libgtd::Voxel;
using libgtd::VoxelGrid;

// Any weights: they do not change the terms.
libgtd::Gripper with_model(const std::string& name) {
  libgtd::Gripper gripper = gripper_named(name);
  gripper.hold_model =
      libgtd::HoldModel{.load_n = 10, .contact = 2, .bearing = 3, .rise = 1, .depth = 1};
  return gripper;
}

std::vector<ClosingTerms> terms_of(const VoxelGrid& grid, const ClosingPath& path) {
  std::vector<std::size_t> all(grid.voxels.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return libgtd::closing_terms(grid, path, all);
}

ClosingTerms terms_at_origin(const std::vector<Voxel>& ground, const std::string& name = "scar-e") {
  const VoxelGrid grid = grid_of(ground);
  const auto at = std::find_if(grid.voxels.rbegin(), grid.voxels.rend(),
                               [](const Voxel& v) { return v.i == 0 && v.j == 0; });
  const auto place = static_cast<std::size_t>(grid.voxels.rend() - at - 1);
  return libgtd::closing_terms(grid, libgtd::make_closing_path(with_model(name), 0.01), {place})[0];
}

template <typename Height>
std::vector<Voxel> ground(const Height& height, int half = 30) {
  std::vector<Voxel> voxels;
  for (int i = -half; i <= half; ++i)
    for (int j = -half; j <= half; ++j) voxels.push_back({i, j, height(i, j)});
  return voxels;
}

TEST(ClosingTerms, LevelGround) {
  const ClosingPath path = libgtd::make_closing_path(with_model("scar-e"), 0.01);
  const ClosingTerms terms = terms_at_origin(ground([](int, int) { return 4; }));
  // The open finger is the lowest part: its depth is the palm's height and that of the contacts.
  double depth = 0.0;
  for (const ClosingPath::Place& place : path.open) depth = std::max(depth, place.depth_m);
  EXPECT_NEAR(
      depth,
      (40 * std::cos(85 * std::numbers::pi / 180) + 41 * std::cos(65 * std::numbers::pi / 180)) /
          1000,
      1e-12);
  EXPECT_NEAR(terms.contact, 1, 1e-12);
  EXPECT_NEAR(terms.rise, depth / 0.081, 1e-6);
  EXPECT_GE(terms.depth, depth / 0.081 - 1e-6);
  EXPECT_LT(terms.depth, (depth + 0.005) / 0.081);
  EXPECT_NEAR(terms.bearing, path.bearing[90], 1e-12);
  // On level ground: the mean of P tan(psi + phi - 90 deg) over psi, at most 100 N.
  double mean = 0.0;
  for (int psi = 0; psi <= 90; ++psi) {
    const double angle = (psi - 90) * std::numbers::pi / 180 + std::atan(0.39);
    if (angle > 0) mean += std::min(100.0, 10 * std::tan(angle)) / 91;
  }
  EXPECT_NEAR(path.bearing[90], std::log(1 + mean / 10), 1e-12);
  EXPECT_TRUE(std::is_sorted(path.bearing.begin(), path.bearing.end()));
}

TEST(ClosingTerms, DoNotDependOnTheOrigin) {
  const auto bumps = [](int base) {
    return ground([base](int i, int j) { return base + (i * i + 3 * j) % 7; });
  };
  const ClosingTerms low = terms_at_origin(bumps(0));
  const ClosingTerms high = terms_at_origin(bumps(1000000));  // 10 km
  EXPECT_NEAR(high.contact, low.contact, 1e-12);
  EXPECT_NEAR(high.bearing, low.bearing, 1e-9);
  EXPECT_NEAR(high.rise, low.rise, 1e-9);
  EXPECT_NEAR(high.depth, low.depth, 1e-9);
}

TEST(ClosingTerms, ShapesInOrder) {
  const auto flat = terms_at_origin(ground([](int, int) { return 0; }));
  // A cone: the ground falls outward, so that spines bear more.
  const auto cone = terms_at_origin(
      ground([](int i, int j) { return -static_cast<int>(std::lround(0.6 * std::hypot(i, j))); }));
  EXPECT_NEAR(cone.contact, 1, 0.01);
  EXPECT_GT(cone.bearing, flat.bearing + 0.1);
  // A thin post over a deep pit: nothing to close on, but where it is beside the palm's middle.
  const auto post = terms_at_origin(
      ground([](int i, int j) { return std::max(std::abs(i), std::abs(j)) < 1 ? 0 : -40; }));
  EXPECT_LT(post.contact, 0.15);
  EXPECT_LT(post.bearing, 0.2 * flat.bearing);
  // The edge of a cliff: no contact on one side.
  const auto cliff = terms_at_origin(ground([](int i, int) { return i <= 1 ? 0 : -40; }));
  EXPECT_LT(cliff.contact, 0.3);
  // A narrow pit: the open fingers rest on its rim, the palm is far above the voxel.
  const auto pit =
      terms_at_origin(ground([](int i, int j) { return std::hypot(i, j) < 4 ? -12 : 0; }));
  EXPECT_GT(pit.rise, flat.rise + 1.2);
}

double share_at_origin(const std::vector<Voxel>& ground) {
  const VoxelGrid grid = grid_of(ground);
  const auto mask =
      libgtd::make_gripper_mask(gripper_named("scar-e"), {libgtd::Method::corrected, 0.01, 1});
  const auto at = std::find_if(grid.voxels.rbegin(), grid.voxels.rend(),
                               [](const Voxel& v) { return v.i == 0 && v.j == 0; });
  return libgtd::outward_shares(grid, mask,
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
  EXPECT_EQ(share_at_origin(ball(4)), 0);
  EXPECT_EQ(share_at_origin(ball(5)), 0);
  for (const double radius : {7.5, 10.0, 15.0, 25.0}) EXPECT_EQ(share_at_origin(ball(radius)), 1);
  // One voxel may be rounding, two are a fall.
  const auto step = [](int fall) {
    return ground([fall](int i, int j) { return std::hypot(i, j) < 9 ? 0 : -fall; });
  };
  EXPECT_EQ(share_at_origin(step(0)), 0);
  EXPECT_EQ(share_at_origin(step(1)), 0);
  EXPECT_EQ(share_at_origin(step(2)), 1);
  // A bowl and a pit fall inward. Of a slope of 45 degrees, the azimuths at right angles to its
  // fall stay level.
  EXPECT_EQ(share_at_origin(step(-5)), 0);
  EXPECT_EQ(share_at_origin(ground([](int i, int) { return i; })), 7.0 / 16);
  EXPECT_EQ(share_at_origin(ground([](int i, int) { return i + 1000000; })), 7.0 / 16);
}

TEST(OutwardShares, SkipColumnsWithoutGround) {
  auto voxels = ground([](int i, int j) { return std::hypot(i, j) < 9 ? 0 : -3; });
  std::erase_if(voxels, [](const Voxel& v) { return v.i > 8; });
  EXPECT_LT(share_at_origin(voxels), 1);
  EXPECT_GT(share_at_origin(voxels), 0.5);
  std::erase_if(voxels, [](const Voxel& v) { return std::hypot(v.i, v.j) > 1; });
  EXPECT_EQ(share_at_origin(voxels), 0);
}

TEST(ClosingTerms, UpToThreeColumnsOfAGapAreFilled) {
  const auto holes = [](int width) {
    std::vector<Voxel> voxels = ground([](int, int) { return 0; });
    std::erase_if(voxels, [&](const Voxel& v) { return v.i >= 5 && v.i < 5 + width; });
    return terms_at_origin(voxels);
  };
  EXPECT_NEAR(holes(6).contact, 1, 1e-12);
  EXPECT_LT(holes(20).contact, 0.6);
}

// From the definition, column by column from a map, where the gripper rests on the pivot's column.
ClosingTerms slow_terms_there(const std::map<std::pair<int, int>, double>& heights,
                              const Voxel& pivot, const ClosingPath& path) {
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
    for (const ClosingPath::Place& place : path.open) {
      const double angle = a * std::numbers::pi / 8;
      palm = std::max(palm, place.depth_m + at(pivot.i + offset(place.radius_m * std::cos(angle)),
                                               pivot.j + offset(place.radius_m * std::sin(angle))));
    }
  std::vector<double> contacts(16, 0);
  std::vector<double> bearings(16, 0);
  double depth = 0;
  double touching = 0;
  for (int a = 0; a < 16; ++a) {
    const double angle = a * std::numbers::pi / 8;
    for (const ClosingPath::Place& place : path.closing) {
      const int i = pivot.i + offset(place.radius_m * std::cos(angle));
      const int j = pivot.j + offset(place.radius_m * std::sin(angle));
      if (at(i, j) <= palm - place.depth_m + 1e-5) continue;
      if (place.has_spines) {
        const auto slope = [&](double low, double high) {
          return low < -1e8 || high < -1e8 ? 0.0 : (high - low) / 0.02;
        };
        const double fall = -slope(at(i - 1, j), at(i + 1, j)) * std::cos(angle) -
                            slope(at(i, j - 1), at(i, j + 1)) * std::sin(angle);
        contacts[static_cast<std::size_t>(a)] = 1;
        bearings[static_cast<std::size_t>(a)] = path.bearing[static_cast<std::size_t>(
            std::lround(std::atan(fall) * 180 / std::numbers::pi) + 90)];
        depth += place.depth_m;
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
  const double length = path.finger_length_m;
  return {weakest(contacts), weakest(bearings), (palm - 0.01 * (pivot.k + 0.5)) / length,
          touching > 0 ? depth / touching / length : 0};
}

// The mean over the columns around it; `there` keeps their terms above a height of 0.
ClosingTerms slow_terms(const std::map<std::pair<int, int>, double>& heights, const Voxel& pivot,
                        const ClosingPath& path,
                        std::map<std::pair<int, int>, ClosingTerms>& there) {
  const double sigma = path.finger_length_m / 4;
  const double height = 0.01 * (pivot.k + 0.5);
  ClosingTerms sum;
  double weights = 0;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j) {
      const std::pair<int, int> column{pivot.i + i, pivot.j + j};
      const double distance = 0.01 * std::hypot(i, j);
      if (distance > 2 * sigma || !heights.contains(column)) continue;
      if (!there.contains(column))
        there[column] = slow_terms_there(heights, {column.first, column.second, 0}, path);
      const ClosingTerms& terms = there[column];
      const double weight = std::exp(-distance * distance / (2 * sigma * sigma));
      sum.contact += weight * terms.contact;
      sum.bearing += weight * terms.bearing;
      sum.rise += weight * (terms.rise + (0.005 - height) / path.finger_length_m);
      sum.depth += weight * terms.depth;
      weights += weight;
    }
  return {sum.contact / weights, sum.bearing / weights, sum.rise / weights, sum.depth / weights};
}

TEST(ClosingTerms, AgreeWithTheirDefinition) {
  const VoxelGrid grid = grid_of(graspmap_test::random_ground(80, -33, 12));
  const ClosingPath path = libgtd::make_closing_path(with_model("limbero"), 0.01);
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
  const auto terms = terms_of(grid, path);
  std::size_t differences = 0;
  std::map<std::pair<int, int>, ClosingTerms> there;
  for (std::size_t n = 0; n < terms.size(); ++n) {
    const ClosingTerms slow = slow_terms(heights, grid.voxels[n], path, there);
    // A height on the boundary of a voxel's layer or an angle between two degrees may round either
    // way in single precision.
    if (std::abs(terms[n].contact - slow.contact) > 1e-9 ||
        std::abs(terms[n].bearing - slow.bearing) > 1e-2 ||
        std::abs(terms[n].rise - slow.rise) > 1e-4 || std::abs(terms[n].depth - slow.depth) > 1e-4)
      ++differences;
  }
  EXPECT_LE(differences, terms.size() / 200) << terms.size();
}

TEST(HoldModel, RisesAndFallsWithItsTerms) {
  const libgtd::HoldModel model{
      .load_n = 10, .intercept = 0.2, .contact = 2, .bearing = 3, .rise = 1, .depth = 1.5};
  const ClosingTerms terms{0.5, 0.2, 0.4, 0.3};
  const double middle = model.probability(terms);
  EXPECT_NEAR(std::log(middle / (1 - middle)), 0.2 + 1 + 0.6 - 0.4 - 0.45, 1e-12);
  EXPECT_GT(model.probability({0.6, 0.2, 0.4, 0.3}), middle);
  EXPECT_GT(model.probability({0.5, 0.3, 0.4, 0.3}), middle);
  EXPECT_LT(model.probability({0.5, 0.2, 0.5, 0.3}), middle);
  EXPECT_LT(model.probability({0.5, 0.2, 0.4, 0.4}), middle);
}

TEST(Calibrated, TheScoreIsTheModelsProbability) {
  libgtd::DetectionOptions options;
  options.scenario.method = libgtd::Method::calibrated;
  options.scenario.curvature_radius_m = 0.0;
  options.gripper = with_model("scar-e");
  const auto found = libgtd::detect(graspmap_test::bumpy_cloud(0.8, 0.006), options);
  ASSERT_GT(found.map.voxels.size(), 1000U);
  for (const libgtd::MapVoxel& one : found.map.voxels)
    ASSERT_EQ(one.score, options.gripper->hold_model->probability(one.terms));
  const auto cloud = to_cloud(found.map, libgtd::MapFrame::terrain);
  for (const char* field : {"closing_contact", "closing_bearing", "closing_rise", "closing_depth"})
    EXPECT_NE(cloud.find_field(field), nullptr) << field;
  // The same counts as `corrected`.
  options.scenario.method = libgtd::Method::corrected;
  const auto corrected = libgtd::detect(graspmap_test::bumpy_cloud(0.8, 0.006), options);
  ASSERT_EQ(corrected.map.voxels.size(), found.map.voxels.size());
  for (std::size_t n = 0; n < found.map.voxels.size(); ++n)
    ASSERT_TRUE(found.map.voxels[n].counts == corrected.map.voxels[n].counts);
  EXPECT_EQ(to_cloud(corrected.map, libgtd::MapFrame::terrain).find_field("closing_rise"), nullptr);
}

TEST(Calibrated, GrippersWithoutTheSectionsAreNamed) {
  const auto field_of = [](libgtd::Gripper gripper) {
    return error_of([&] {
             libgtd::make_gripper_mask(gripper, {libgtd::Method::calibrated, 0.01, 1});
           })
        .context()
        .field;
  };
  libgtd::Gripper gripper = with_model("scar-e");
  gripper.hold_model.reset();
  EXPECT_EQ(field_of(gripper), "hold_model");
  gripper.fingers.reset();
  EXPECT_EQ(field_of(gripper), "fingers");
  libgtd::DetectionOptions options;
  options.scenario.method = libgtd::Method::calibrated;
  options.scenario.orientation = libgtd::Orientation::surface;
  EXPECT_EQ(error_of([&] { libgtd::detect(graspmap_test::bumpy_cloud(0.4, 0.01), options); })
                .context()
                .field,
            "orientation");
}

}  // namespace closing_terms_test
