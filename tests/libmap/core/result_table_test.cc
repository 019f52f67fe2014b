#include "libmap/core/result_table.h"

#include <gtest/gtest.h>

#include <Eigen/Core>

#include "libmap/core/manifest.h"

namespace libmap {
namespace result_table_test {

struct Counts {
  std::size_t points = 0;
  std::size_t max_views = 0;
  double scale = 1.0;
  double area_m2 = 0.0;
};

void describe(ResultTable& table, const Counts& counts) {
  table.add("points", counts.points, Merge::sum, "points of all tiles");
  table.add("scale", counts.scale, Merge::min, "smallest scale");
  table.add("area_m2", counts.area_m2, Merge::sum, "area of all tiles");
  table.add("density", counts.area_m2 > 0.0 ? std::optional(2.0) : std::nullopt, "not of tiles");
  table.add_hidden("max_views", counts.max_views, Merge::max);
}

std::vector<std::string> keys_of(const ResultTable& table) {
  std::vector<std::string> keys;
  for (const NamedResult& result : table.results()) keys.push_back(result.key);
  return keys;
}

TEST(ResultTable, HoldsEachTypeOfValue) {
  const ResultTable table = {{"flag", true},
                             {"count", 3U},
                             {"half", 0.5F},
                             {"name", "scar-e"},
                             {"origin_m", Eigen::Vector3d(1, 2, 3)},
                             {"none", std::optional<double>()},
                             {"some", std::optional<std::string>("x")}};
  const std::vector<NamedResult>& results = table.results();
  ASSERT_EQ(results.size(), 7U);
  EXPECT_EQ(*results[0].value, ManifestValue(true));
  EXPECT_EQ(*results[1].value, ManifestValue(std::int64_t{3}));
  EXPECT_EQ(*results[2].value, ManifestValue(0.5));
  EXPECT_EQ(*results[3].value, ManifestValue(std::string("scar-e")));
  EXPECT_EQ(*results[4].value, ManifestValue(std::vector<double>{1, 2, 3}));
  EXPECT_FALSE(results[5].value);
  EXPECT_EQ(*results[6].value, ManifestValue(std::string("x")));
  // The type is known without a value.
  EXPECT_TRUE(std::holds_alternative<double>(results[5].type));
  EXPECT_TRUE(results[5].may_be_absent);
  EXPECT_FALSE(results[4].may_be_absent);
}

TEST(ResultTable, MergesTilesByTheKindOfEachField) {
  Counts whole{.points = 3, .max_views = 5, .scale = 0.8, .area_m2 = 1.5};
  merge_into(whole, Counts{.points = 4, .max_views = 2, .scale = 0.9, .area_m2 = 0.25});
  EXPECT_EQ(whole.points, 7U);
  EXPECT_EQ(whole.max_views, 5U);
  EXPECT_EQ(whole.scale, 0.8);
  EXPECT_EQ(whole.area_m2, 1.75);
  merge_into(whole, Counts{.points = 0, .max_views = 9, .scale = 0.5, .area_m2 = 0.0});
  EXPECT_EQ(whole.max_views, 9U);
  EXPECT_EQ(whole.scale, 0.5);
}

TEST(ResultTable, FieldsOfTilesAreReadBack) {
  const Counts counts{.points = 3, .max_views = 5, .scale = 0.8, .area_m2 = 1.5};
  Counts read;
  const ResultTable from = described(counts);
  const ResultTable to = described(read);
  ASSERT_EQ(from.tile_fields().size(), 4U);
  for (std::size_t n = 0; n < 4; ++n) to.tile_fields()[n].set(from.tile_fields()[n].value());
  EXPECT_EQ(read.points, 3U);
  EXPECT_EQ(read.max_views, 5U);
  EXPECT_EQ(read.scale, 0.8);
  EXPECT_EQ(read.area_m2, 1.5);
}

TEST(ResultTable, HiddenFieldsAreNoResults) {
  EXPECT_EQ(keys_of(described(Counts{})),
            (std::vector<std::string>{"points", "scale", "area_m2", "density"}));
}

TEST(ResultTable, AppendsWithAPrefix) {
  ResultTable table = {{"points", 1}};
  table.append("icp_", {{"rmse_m", 0.5}, {"points", 2}});
  EXPECT_EQ(keys_of(table), (std::vector<std::string>{"points", "icp_rmse_m", "icp_points"}));
}

TEST(ResultTable, ManifestHasThoseWithAValue) {
  Manifest manifest;
  manifest.add_results(described(Counts{}));
  ASSERT_EQ(manifest.results.size(), 3U);
  EXPECT_EQ(manifest.results[0],
            (std::pair<std::string, ManifestValue>("points", std::int64_t{0})));
  EXPECT_EQ(manifest.find_result("density"), nullptr);
}

}  // namespace result_table_test
}  // namespace libmap
