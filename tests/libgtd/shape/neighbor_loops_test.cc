#include "libgtd/shape/neighbor_loops.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/libgtd/instruction_sets.h"
#include "tests/support/test_support.h"

namespace neighbor_loops_test {

using graspmap_test::uniform;
using libgtd::NeighborLoops;
using libmap::InstructionSet;

constexpr std::size_t lanes = NeighborLoops::lanes;

template <typename Number>
struct Columns {
  std::array<std::vector<Number>, 3> axes;

  Columns(std::size_t count, std::size_t beyond, Number value) {
    for (auto& axis : axes) axis.assign(count + beyond, value);
  }
  void fill(std::size_t count, double reach) {
    for (auto& axis : axes)
      for (std::size_t n = 0; n < count; ++n) axis[n] = static_cast<Number>(uniform(-reach, reach));
  }
};

NeighborLoops::Coordinates places_of(Columns<double>& columns) {
  return {columns.axes[0].data(), columns.axes[1].data(), columns.axes[2].data()};
}

constexpr double far = std::numeric_limits<double>::infinity();

TEST(NeighborLoops, SelectKeepsThePlacesWithinTheRadiusInOrder) {
  for (const auto instructions : graspmap_test::instruction_sets())
    for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 100u, 411u}) {
      Columns<double> candidates(count, lanes, far), neighbors(count, lanes, 99.0);
      candidates.fill(count, 1.0);
      const std::array<double, 3> center = {0.1, -0.2, 0.05};
      if (count > 7) {  // exactly at the radius (included), and just outside
        for (std::size_t a = 0; a < 3; ++a)
          candidates.axes[a][2] = candidates.axes[a][5] = center[a];
        candidates.axes[0][2] += 0.5;
        candidates.axes[0][5] += 0.5 + 1e-12;
      }
      const std::size_t selected =
          libgtd::neighbor_loops_of(instructions)
              .select(places_of(candidates), count, center.data(), 0.5, places_of(neighbors));
      std::size_t expected = 0;
      for (std::size_t n = 0; n < count; ++n) {
        std::array<double, 3> d{};
        for (std::size_t a = 0; a < 3; ++a) d[a] = candidates.axes[a][n] - center[a];
        if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 0.25) continue;
        for (std::size_t a = 0; a < 3; ++a) ASSERT_EQ(neighbors.axes[a][expected], d[a] * 2.0);
        ++expected;
      }
      ASSERT_EQ(selected, expected);
      for (std::size_t n = selected; n < std::min(selected + lanes, count + lanes); ++n)
        for (const auto& axis : neighbors.axes) EXPECT_EQ(axis[n], 0.0);
    }
}

// Lane by lane, as defined in the header.
double joined(const std::vector<double>& terms) {
  std::array<double, lanes> s{};
  for (std::size_t n = 0; n < terms.size(); ++n) s[n % lanes] += terms[n];
  return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

TEST(NeighborLoops, SumsAreTheSameBitsOnEveryPath) {
  for (const std::size_t count : {1u, 5u, 8u, 13u, 64u, 203u}) {
    Columns<double> neighbors(count, lanes, 0.0);
    neighbors.fill(count, 1.0);
    const auto sum_of = [&](const auto& term) {
      std::vector<double> terms;
      for (std::size_t n = 0; n < count; ++n)
        terms.push_back(term(neighbors.axes[0][n], neighbors.axes[1][n], neighbors.axes[2][n]));
      return joined(terms);
    };
    const std::array<double, 9> frame = {0.6, 0.8, 0.1, -0.8, 0.6, 0.2, 0.05, -0.2, 0.97};
    const auto along = [&](std::size_t c, double x, double y, double z) {
      return x * frame[3 * c] + y * frame[3 * c + 1] + z * frame[3 * c + 2];
    };
    for (const auto instructions : graspmap_test::instruction_sets()) {
      std::array<double, NeighborLoops::moments> m{};
      libgtd::neighbor_loops_of(instructions).sum_moments(places_of(neighbors), count, m.data());
      EXPECT_EQ(m[0], sum_of([](double x, double, double) { return x; }));
      EXPECT_EQ(m[4], sum_of([](double x, double y, double) { return x * y; }));
      EXPECT_EQ(m[7], sum_of([](double, double y, double z) { return y * z; }));
      EXPECT_EQ(m[8], sum_of([](double, double, double z) { return z * z; }));
      std::array<double, NeighborLoops::quadric_sums> q{};
      libgtd::neighbor_loops_of(instructions)
          .sum_quadric(places_of(neighbors), count, frame.data(), q.data());
      // Exponents of u, v, w of each sum.
      constexpr std::array<std::array<int, 3>, NeighborLoops::quadric_sums> powers = {
          {{1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {1, 1, 0}, {0, 2, 0}, {3, 0, 0}, {2, 1, 0},
           {1, 2, 0}, {0, 3, 0}, {4, 0, 0}, {3, 1, 0}, {2, 2, 0}, {1, 3, 0}, {0, 4, 0},
           {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {2, 0, 1}, {1, 1, 1}, {0, 2, 1}}};
      for (std::size_t s = 0; s < q.size(); ++s)
        EXPECT_NEAR(q[s], sum_of([&](double x, double y, double z) {
                      return std::pow(along(0, x, y, z), powers[s][0]) *
                             std::pow(along(1, x, y, z), powers[s][1]) *
                             std::pow(along(2, x, y, z), powers[s][2]);
                    }),
                    1e-12 * static_cast<double>(count))
            << s;
      std::array<double, NeighborLoops::quadric_sums> portable{};
      libgtd::neighbor_loops_of(libmap::InstructionSet::portable)
          .sum_quadric(places_of(neighbors), count, frame.data(), portable.data());
      EXPECT_EQ(q, portable);
    }
  }
}

TEST(NeighborLoops, RanksOrderByDistanceThenByNumber) {
  constexpr std::size_t beyond = NeighborLoops::rank_lanes;
  for (const std::size_t count : {0u, 1u, 15u, 16u, 17u, 300u}) {
    Columns<float> candidates(count, beyond, std::numeric_limits<float>::infinity());
    candidates.fill(count, 1.0);
    if (count > 9)
      for (auto& axis : candidates.axes) axis[9] = axis[4];  // coincident
    const std::array<float, 3> center = {0.125F, -0.25F, 0.0F};
    if (count > 9)  // exactly at the limit (excluded)
      for (std::size_t a = 0; a < 3; ++a) candidates.axes[a][7] = center[a] + (a < 2 ? 0.5F : 0.0F);
    std::vector<std::uint64_t> expected;
    for (std::size_t n = 0; n < count; ++n) {
      const float x = center[0] - candidates.axes[0][n], y = center[1] - candidates.axes[1][n],
                  z = center[2] - candidates.axes[2][n];
      const float square = x * x + y * y + z * z;
      if (square < 0.5F)
        expected.push_back(std::uint64_t{std::bit_cast<std::uint32_t>(square)} << 32 | n);
    }
    for (const auto instructions : graspmap_test::instruction_sets()) {
      std::vector<std::uint64_t> keys(count + beyond);
      keys.resize(libgtd::neighbor_loops_of(instructions)
                      .rank(candidates.axes[0].data(), candidates.axes[1].data(),
                            candidates.axes[2].data(), count, center.data(), 0.5F, keys.data()));
      EXPECT_EQ(keys, expected);
    }
  }
}

}  // namespace neighbor_loops_test
