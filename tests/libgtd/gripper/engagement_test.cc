// Tests priors and ensembles of the engagement parameters, and the sections of gripper files.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libgtd/gripper/gripper_io.h"
#include "tests/support/test_support.h"

namespace engagement_test {

using graspmap_test::error_of;
using libgtd::Gripper;
using libgtd::ParameterValues;

std::string scar_e() {
  return graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
}

TEST(Engagement, PriorsAreMonotonicAboutTheirMiddle) {
  const Gripper gripper = libgtd::find_gripper("scar-e");
  const ParameterValues middle = parameters_of(gripper);
  const auto at = [&](double fraction) {
    ParameterValues shares;
    shares.fill(fraction);
    return prior_values(gripper.ranges, middle, shares);
  };
  for (std::size_t n = 0; n < middle.size(); ++n) {
    const auto [low, high] = *gripper.ranges[n];
    EXPECT_DOUBLE_EQ(at(0.0)[n], low);
    EXPECT_DOUBLE_EQ(at(1.0)[n], high);
    for (double fraction = 0.1; fraction < 1.0; fraction += 0.1)
      EXPECT_LT(at(fraction - 0.1)[n], at(fraction)[n]) << n;
    if (middle[n] > low && middle[n] < high) {
      EXPECT_DOUBLE_EQ(at(0.5)[n], middle[n]);
    }
  }
  // Log-uniform above the middle: 2 N to 12 N.
  EXPECT_NEAR(at(0.75)[0], std::sqrt(2.0 * 12.0), 1e-9);
}

TEST(Engagement, QuantilesFillTheCube) {
  const auto points = libgtd::low_discrepancy_quantiles(64, 1);
  for (std::size_t k = 0; k < libgtd::uncertain_parameters; ++k) {
    std::vector<double> sorted;
    for (const ParameterValues& point : points) sorted.push_back(point[k]);
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t n = 0; n < sorted.size(); ++n)
      EXPECT_NEAR(sorted[n], (static_cast<double>(n) + 0.5) / 64, 0.06) << k;
  }
  EXPECT_NE(libgtd::low_discrepancy_quantiles(4, 2)[0], points[0]);
}

TEST(Engagement, SetsAreDrawnByTheirWeights) {
  const std::vector<libgtd::ParameterSet> sets = {{0.1, {}}, {0.0, {}}, {0.6, {}}, {0.3, {}}};
  std::array<int, 4> counts{};
  for (int n = 0; n < 1000; ++n) ++counts[parameter_set_at(sets, (n + 0.5) / 1000)];
  EXPECT_EQ(counts, (std::array<int, 4>{100, 0, 600, 300}));
}

TEST(GripperFile, AFittedEnsembleIsReadAsItWasWritten) {
  Gripper gripper = libgtd::find_gripper("scar-e");
  EXPECT_EQ(parameter_sets(gripper).size(), 64U);
  gripper.ensemble = {{0.25, {2, 10, 0.39, 0, 90, 0.6}}, {0.75, {4.5, 12, 0.5, 10, 80.25, 0.3}}};
  const Gripper read = libgtd::parse_gripper(to_yaml(gripper), "fitted.yaml");
  ASSERT_EQ(read.ensemble.size(), 2U);
  for (std::size_t n = 0; n < 2; ++n) {
    EXPECT_EQ(read.ensemble[n].weight, gripper.ensemble[n].weight);
    EXPECT_EQ(read.ensemble[n].values, gripper.ensemble[n].values);
  }
  EXPECT_EQ(to_yaml(read), to_yaml(gripper));
  // A file without ranges has one set.
  const std::string text = scar_e();
  EXPECT_EQ(parameter_sets(libgtd::parse_gripper(text.substr(0, text.find("ranges:")), "old.yaml"))
                .size(),
            1U);
}

TEST(GripperFile, BadRangesAndSetsAreNamed) {
  const auto field_of = [](const std::string& added) {
    const std::string text = scar_e();
    return error_of([&] {
             libgtd::parse_gripper(text.substr(0, text.find("ranges:")) + added, "bad.yaml");
           })
        .context()
        .field;
  };
  EXPECT_EQ(field_of("ranges:\n  friction: 0.6, 0.25\n"), "ranges.friction");
  EXPECT_EQ(field_of("ranges:\n  friction: 0.6\n  closing_force_n: 0, 3\n"),
            "ranges.closing_force_n");
  EXPECT_EQ(field_of("ranges:\n  asperity_max_deg: 70, 91\n"), "ranges.asperity_max_deg");
  EXPECT_EQ(field_of("ensemble:\n  sets: 1 2 3\n"), "ensemble.sets");
  EXPECT_EQ(field_of("ensemble:\n  sets: 0 2 10 0.39 0 90 0.6\n"), "ensemble.sets");
  EXPECT_EQ(field_of("ensemble:\n  sets: 1 2 10 -0.39 0 90 0.6\n"), "engagement.friction");
  EXPECT_EQ(field_of("engagement:\n  friction: -1\n"), "engagement.friction");
  EXPECT_EQ(field_of("hold_model:\n  load_n: 10\n"), "hold_model");
}

}  // namespace engagement_test
