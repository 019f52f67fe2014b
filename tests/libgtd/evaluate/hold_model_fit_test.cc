#include "libgtd/evaluate/hold_model_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/file_output.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "tests/support/test_support.h"

namespace hold_model_fit_test {

using graspmap_test::error_of;
using libgtd::HoldModel;

// Places drawn by a model whose weights may have any sign.
libmap::Table places_of(const HoldModel& model, int count) {
  libmap::Table table;
  table.columns = {"closing_contact", "closing_bearing", "closing_rise", "closing_depth", "holds"};
  libmap::RandomStream random(3, 1);
  for (int n = 0; n < count; ++n) {
    const libgtd::ClosingTerms terms{random.uniform(), random.uniform(0, 0.3), random.uniform(0, 2),
                                     random.uniform()};
    const bool holds = random.uniform() < model.probability(terms);
    table.rows.push_back({libmap::to_text(terms.contact), libmap::to_text(terms.bearing),
                          libmap::to_text(terms.rise), libmap::to_text(terms.depth),
                          holds ? "1" : "0"});
  }
  return table;
}

TEST(HoldModelFit, FindsTheWeightsThatMadeThePlaces) {
  const HoldModel truth{
      .load_n = 7, .intercept = 0.5, .contact = 3, .bearing = 8, .rise = 1.5, .depth = 2};
  const auto fit = libgtd::fit_hold_model(places_of(truth, 100000), "holds", 7);
  EXPECT_EQ(fit.places, 100000U);
  EXPECT_EQ(fit.left_out, 0U);
  EXPECT_EQ(fit.model.load_n, 7);
  EXPECT_NEAR(fit.model.intercept, 0.5, 0.1);
  EXPECT_NEAR(fit.model.contact, 3, 0.15);
  EXPECT_NEAR(fit.model.bearing, 8, 0.4);
  EXPECT_NEAR(fit.model.rise, 1.5, 0.1);
  EXPECT_NEAR(fit.model.depth, 2, 0.15);
}

TEST(HoldModelFit, ATermOfTheWrongSignGetsNoWeight) {
  const HoldModel wrong{
      .load_n = 7, .intercept = 0, .contact = 3, .bearing = -8, .rise = 1.5, .depth = 2};
  const auto fit = libgtd::fit_hold_model(places_of(wrong, 20000), "holds", 7);
  EXPECT_EQ(fit.model.bearing, 0);
  EXPECT_NEAR(fit.model.contact, 3, 0.4);
  EXPECT_NEAR(fit.model.rise, 1.5, 0.2);
}

TEST(HoldModelFit, EmptyCellsAreLeftOutAndSeparableClassesStayFinite) {
  auto table = places_of({.load_n = 1}, 40);
  for (std::size_t n = 0; n < table.rows.size(); ++n) {
    table.rows[n][0] = n < 20 ? "0" : "1";
    table.rows[n][4] = n < 20 ? "no" : "yes";
  }
  table.rows[3][1].clear();
  table.rows[5][4].clear();
  const auto fit = libgtd::fit_hold_model(table, "holds", 1);
  EXPECT_EQ(fit.left_out, 2U);
  EXPECT_TRUE(std::isfinite(fit.model.contact));
  EXPECT_GT(fit.model.contact, 5);
}

TEST(HoldModelFit, TheSectionIsReadBack) {
  const HoldModel model{
      .load_n = 10, .intercept = -0.25, .contact = 3, .bearing = 8.5, .rise = 0, .depth = 2};
  std::string text =
      graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
  text = text.substr(0, text.find("hold_model:")) + to_yaml_section(model);
  const auto read = libgtd::parse_gripper(text, "g.yaml").hold_model;
  ASSERT_TRUE(read);
  EXPECT_EQ(to_yaml_section(*read), to_yaml_section(model));
  EXPECT_EQ(error_of([&] {
              libgtd::parse_gripper(text, "g.yaml", {{"hold_model.rise", "-1"}});
            })
                .context()
                .field,
            "hold_model.rise");
}

TEST(HoldModelFit, BadTablesAreNamed) {
  auto table = places_of({.load_n = 1}, 9);
  table.file = "t.csv";
  EXPECT_EQ(error_of([&] { libgtd::fit_hold_model(table, "holds", 1); }).context().value, "9");
  table.rows[2][4] = "perhaps";
  EXPECT_EQ(error_of([&] { libgtd::fit_hold_model(table, "holds", 1); }).context().value,
            "perhaps");
  EXPECT_EQ(error_of([&] { libgtd::fit_hold_model(table, "held", 1); }).context().file, "t.csv");
}

}  // namespace hold_model_fit_test
