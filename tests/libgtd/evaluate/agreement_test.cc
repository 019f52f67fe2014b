#include "libgtd/evaluate/roc.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/support/test_support.h"

namespace agreement_test {

using graspmap_test::random_engine;
using graspmap_test::uniform;
using libgtd::cohens_kappa;
using libgtd::Confusion;
using libgtd::Kappa;

// Counts: both yes, only evaluated yes, only reference yes, both no.
Confusion table_of(std::size_t both, std::size_t evaluated, std::size_t reference,
                   std::size_t none) {
  return {.true_positives = both,
          .false_positives = evaluated,
          .true_negatives = none,
          .false_negatives = reference};
}

TEST(CohensKappa, OfPublishedTables) {
  // Feinstein and Cicchetti 1990: same agreement, different shares of yes.
  EXPECT_NEAR(cohens_kappa(table_of(40, 9, 6, 45))->value, 0.70, 0.005);
  EXPECT_NEAR(cohens_kappa(table_of(80, 10, 5, 5))->value, 0.32, 0.005);
  // Stata's kapci on 1932 patients, Statalist, December 2009.
  const Kappa stata = *cohens_kappa(table_of(1395, 118, 261, 158));
  EXPECT_NEAR(stata.value, 0.3411969207847029, 1e-15);
  EXPECT_NEAR(stata.standard_error, 0.0262913719660408, 1e-15);
  EXPECT_NEAR(stata.normal_95.low, 0.2896667786271169, 1e-15);
  EXPECT_NEAR(stata.normal_95.high, 0.3927270629422889, 1e-15);
}

TEST(CohensKappa, ByHand) {
  // po = 35/50, pe = (25 * 30 + 25 * 20) / 2500 = 1/2.
  EXPECT_NEAR(cohens_kappa(table_of(20, 5, 10, 15))->value, 0.4, 1e-15);
  EXPECT_NEAR(cohens_kappa(table_of(0, 7, 7, 0))->value, -1.0, 1e-15);
  // Independent: pe is po.
  EXPECT_NEAR(cohens_kappa(table_of(6, 2, 9, 3))->value, 0.0, 1e-15);
  const Kappa all = *cohens_kappa(table_of(3, 0, 0, 9));
  EXPECT_EQ(all.value, 1.0);
  EXPECT_EQ(all.standard_error, 0.0);
  EXPECT_EQ(all.normal_95.low, 1.0);
}

TEST(CohensKappa, NothingWhereChanceAgreesEverywhere) {
  EXPECT_FALSE(cohens_kappa({}));
  EXPECT_FALSE(cohens_kappa(table_of(12, 0, 0, 0)));
  EXPECT_FALSE(cohens_kappa(table_of(0, 0, 0, 12)));
  // One rater always says yes, the other never or sometimes: no better than chance.
  EXPECT_EQ(cohens_kappa(table_of(0, 12, 0, 0))->value, 0.0);
  EXPECT_EQ(cohens_kappa(table_of(5, 7, 0, 0))->value, 0.0);
  EXPECT_EQ(cohens_kappa(table_of(5, 7, 0, 0))->standard_error, 0.0);
}

double kappa_of(const std::array<double, 4>& p) {
  const double po = p[0] + p[3];
  const double pe = (p[0] + p[1]) * (p[0] + p[2]) + (p[2] + p[3]) * (p[1] + p[3]);
  return (po - pe) / (1.0 - pe);
}

// The delta method on multinomial shares, its gradient by central differences: var = (sum p g^2 -
// (sum p g)^2) / n.
double slow_standard_error(const Confusion& counts) {
  const double n = static_cast<double>(counts.size());
  const std::array<double, 4> p = {static_cast<double>(counts.true_positives) / n,
                                   static_cast<double>(counts.false_positives) / n,
                                   static_cast<double>(counts.false_negatives) / n,
                                   static_cast<double>(counts.true_negatives) / n};
  double squares = 0.0;
  double mean = 0.0;
  for (std::size_t c = 0; c < 4; ++c) {
    std::array<double, 4> above = p;
    std::array<double, 4> below = p;
    above[c] += 1e-5;
    below[c] -= 1e-5;
    const double slope = (kappa_of(above) - kappa_of(below)) / 2e-5;
    squares += p[c] * slope * slope;
    mean += p[c] * slope;
  }
  return std::sqrt(std::max(0.0, squares - mean * mean) / n);
}

TEST(CohensKappa, ErrorIsThatOfTheDeltaMethod) {
  for (int trial = 0; trial < 300; ++trial) {
    const auto count = [] { return static_cast<std::size_t>(uniform(1.0, 200.0)); };
    const Confusion counts = table_of(count(), count(), count(), count());
    EXPECT_NEAR(cohens_kappa(counts)->standard_error, slow_standard_error(counts), 1e-7);
  }
}

// Spread of kappa among samples of one population.
TEST(CohensKappa, ErrorIsTheScatterOfSamples) {
  const Confusion population = table_of(300, 60, 90, 550);
  std::discrete_distribution<int> draw({300, 60, 90, 550});
  double sum = 0.0;
  double squares = 0.0;
  constexpr int samples = 2000;
  for (int s = 0; s < samples; ++s) {
    std::array<std::size_t, 4> counts{};
    for (int n = 0; n < 1000; ++n) ++counts[static_cast<std::size_t>(draw(random_engine()))];
    const double value = cohens_kappa(table_of(counts[0], counts[1], counts[2], counts[3]))->value;
    sum += value;
    squares += value * value;
  }
  const double scatter = std::sqrt(squares / samples - (sum / samples) * (sum / samples));
  EXPECT_NEAR(scatter / cohens_kappa(population)->standard_error, 1.0, 0.06);
}

TEST(Agreement, CountsAndTheirTransposition) {
  Confusion counts;
  Confusion other;
  std::size_t both = 0;
  std::size_t predicted_alone = 0;
  for (int n = 0; n < 300000; ++n) {
    const bool predicted = uniform(0.0, 1.0) < 0.3;
    const bool positive = uniform(0.0, 1.0) < 0.6;
    counts.add(positive, predicted);
    other.add(predicted, positive);
    both += predicted && positive;
    predicted_alone += predicted && !positive;
  }
  EXPECT_EQ(counts.size(), 300000U);
  EXPECT_EQ(counts.true_positives, both);
  EXPECT_EQ(counts.false_positives, predicted_alone);
  EXPECT_EQ(other.false_positives, counts.false_negatives);
  EXPECT_EQ(other.false_negatives, counts.false_positives);
  EXPECT_EQ(other.positives(), counts.predicted_positives());
  EXPECT_NEAR(cohens_kappa(other)->value, cohens_kappa(counts)->value, 1e-15);
  EXPECT_NEAR(cohens_kappa(other)->standard_error, cohens_kappa(counts)->standard_error, 1e-15);
}

}  // namespace agreement_test
