// Site files: given values are kept, missing ones are drawn, and errors name the field.
#include "libmap/simulate/rock_site.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/libmap/scenes/scene_test_support.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace rock_site_io_test {

using graspmap_test::error_of;
using graspmap_test::is_error;

RockSite parse(const std::string& text, std::optional<std::uint64_t> seed = std::nullopt) {
  return parse_site(text, "site.yaml", seed);
}

TEST(RockSiteIo, KeepsWhatIsGivenAndDrawsTheRest) {
  const std::string text =
      "seed: 5\nground: {size_x_m: 5}\nrocks:\n"
      "  - {name: a, height_m: 0.4, width_m: 0.33, x_m: 1.2, y_m: -1}\n"
      "  - {height_m: 0.3}\n";
  const RockSite site = parse(text);
  EXPECT_EQ(site.seed, 5U);
  EXPECT_EQ(site.ground.size_x_m, 5.0);
  EXPECT_EQ(site.ground.size_y_m, SiteGround().size_y_m);
  EXPECT_EQ(site.rocks[0].name, "a");
  EXPECT_EQ(site.rocks[0].width_m, 0.33);
  EXPECT_EQ(site.rocks[0].x_m, 1.2);
  EXPECT_EQ(site.rocks[0].y_m, -1.0);
  // Placed clear of the free square.
  EXPECT_GT(std::max(std::abs(site.rocks[1].x_m), std::abs(site.rocks[1].y_m)), 0.75);
  // Another seed draws other rocks but keeps given values.
  const RockSite other = parse(text, 6);
  EXPECT_EQ(other.rocks[0].width_m, 0.33);
  EXPECT_NE(other.rocks[0].seed, site.rocks[0].seed);
  EXPECT_NE(other.rocks[1].x_m, site.rocks[1].x_m);
}

TEST(RockSiteIo, WrittenAndReadIsTheSameSite) {
  for (const char* name : {"rocks.yaml", "slopes_and_bumps.yaml", "bouldering_wall.yaml"}) {
    const RockSite site = graspmap_test::shipped_site(name, 3);
    const std::string text = to_yaml(site);
    const RockSite again = parse(text);
    EXPECT_EQ(to_yaml(again), text) << name;
    EXPECT_EQ(again.bumps, site.bumps) << name;
    ASSERT_EQ(again.rocks.size(), site.rocks.size());
    for (std::size_t n = 0; n < site.rocks.size(); ++n) {
      EXPECT_EQ(again.rocks[n].x_m, site.rocks[n].x_m);
      EXPECT_EQ(again.rocks[n].seed, site.rocks[n].seed);
      EXPECT_EQ(again.rocks[n].yaw_deg, site.rocks[n].yaw_deg);
    }
  }
}

// Placed rocks keep apart: corners of one rectangle are never inside another.
TEST(RockSiteIo, PlacedRocksKeepApart) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RockSite site = graspmap_test::shipped_site("rocks.yaml", seed);
    for (const SiteRock& a : site.rocks) {
      for (const SiteRock& b : site.rocks) {
        if (&a == &b) continue;
        const Eigen::Rotation2Dd turn_a(a.yaw_deg * M_PI / 180.0);
        const Eigen::Rotation2Dd turn_b(b.yaw_deg * M_PI / 180.0);
        for (int n = 0; n < 400; ++n) {
          const Eigen::Vector2d local(a.width_m * ((n % 20) / 19.0 - 0.5),
                                      a.depth_m * ((n / 20) / 19.0 - 0.5));
          const Eigen::Vector2d point = Eigen::Vector2d(a.x_m, a.y_m) + turn_a * local;
          const Eigen::Vector2d in_b = turn_b.inverse() * (point - Eigen::Vector2d(b.x_m, b.y_m));
          EXPECT_TRUE(std::abs(in_b.x()) > 0.5 * b.width_m || std::abs(in_b.y()) > 0.5 * b.depth_m)
              << seed;
          EXPECT_GE(point.cwiseAbs().maxCoeff(), 0.75 - 1e-9) << seed;
          EXPECT_LE(point.cwiseAbs().maxCoeff(), 1.5 + 1e-9) << seed;
        }
      }
    }
  }
}

struct BadCase {
  const char* text;
  graspmap_test::ExpectedError expected;
};

TEST(RockSiteIo, SaysWhatIsWrong) {
  const BadCase cases[] = {
      {"rocks: 3", {.file = "site.yaml", .field = "rocks"}},
      {"rock: []", {.file = "site.yaml", .field = "rock", .about = "'rocks'"}},
      {"rocks:\n  - {width_m: 0.3}", {.file = "site.yaml", .field = "rocks[0].height_m (line 2)"}},
      {"rocks:\n  - {height_m: 0.3, x_m: 1}",
       {.file = "site.yaml", .field = "rocks[0].y_m (line 2)"}},
      {"rocks:\n  - {heigth_m: 0.3}",
       {.file = "site.yaml", .field = "rocks[0].heigth_m (line 2)", .about = "'height_m'"}},
      {"rocks:\n  - {height_m: -1}",
       {.file = "site.yaml",
        .field = "rocks[0].height_m (line 2)",
        .value = "-1",
        .bound = ">= 0.01 and <= 10"}},
      {"rocks:\n  - {height_m: nan}",
       {.file = "site.yaml",
        .field = "rocks[0].height_m (line 2)",
        .value = "nan",
        .bound = ">= 0.01 and <= 10"}},
      {"rocks:\n  - {height_m: 0.3, shape: bloc}",
       {.file = "site.yaml",
        .field = "rocks[0].shape (line 2)",
        .value = "bloc",
        .about = "'block'"}},
      {"rocks:\n  - {height_m: 0.3, sides: 2}",
       {.file = "site.yaml",
        .field = "rocks[0].sides (line 2)",
        .value = "2",
        .bound = ">= 4 and <= 12"}},
      {"rocks:\n  - 7", {.file = "site.yaml", .field = "rocks[0] (line 2)"}},
      {"rocks:\n  - {height_m: 0.3, x_m: 9, y_m: 0}",
       {.file = "site.yaml", .field = "rocks[0].x_m, y_m", .value = "9, 0"}},
      {"rocks:\n  - {height_m: 5, width_m: 4}",
       {.file = "site.yaml", .field = "rocks[0]", .value = "4 x 3.115 m"}},
      {"ground: {size_x_m: 1e9}",
       {.file = "site.yaml",
        .field = "ground.size_x_m (line 1)",
        .value = "1e9",
        .bound = ">= 0.1 and <= 100"}},
      {"ground: {tilt: 3}",
       {.file = "site.yaml", .field = "ground.tilt (line 1)", .about = "'tilt_deg'"}},
      {"bumps:\n  - {height_m: 1}", {.file = "site.yaml", .field = "bumps[0].radius_m (line 2)"}},
      {"seed: -1", {.file = "site.yaml", .field = "seed", .value = "-1", .bound = ">= 0"}},
      {"seed: 1\nseed: 2", {.file = "site.yaml", .field = "seed"}},
      {"rocks: [", {.file = "site.yaml", .field = "line 1"}},
      {"7", {.file = "site.yaml"}},
  };
  for (const BadCase& one : cases) {
    const Error error = error_of([&] { parse(one.text); });
    EXPECT_TRUE(is_error(error, one.expected)) << one.text;
  }
}

TEST(RockSiteIo, EntriesAreBounded) {
  std::string text = "bumps: [";
  for (int n = 0; n <= 10'000; ++n) text += "0,";
  EXPECT_TRUE(is_error(error_of([&] { parse(text + "]"); }),
                       {.file = "site.yaml", .field = "bumps", .value = "10001"}));
}

// Errors of sites that are not read from a file.
TEST(RockSiteIo, CheckNamesTheEntry) {
  RockSite site = parse("rocks:\n  - {name: a, height_m: 0.3, x_m: 1, y_m: 1}\n");
  EXPECT_NO_THROW(site.check());
  site.rocks[0].sides = 99;
  EXPECT_TRUE(is_error(error_of([&] { site.check(); }),
                       {.field = "rocks[0] (a).sides", .value = "99", .bound = ">= 4 and <= 12"}));
}

TEST(RockSiteIo, EmptyIsGroundAlone) {
  EXPECT_TRUE(parse("{}").rocks.empty());
  EXPECT_TRUE(parse("rocks:\nbumps:\n").rocks.empty());
}

}  // namespace rock_site_io_test
}  // namespace libmap
