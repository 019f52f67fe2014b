#include "libmap/core/plan_tiles.h"

#include <gtest/gtest.h>

namespace libmap {
namespace plan_tiles_test {

TEST(PlanTiles, NamesAreThoseOfTheirPlaces) {
  EXPECT_EQ(piece_file_name({3, -2}, ".pcd"), "piece_3_-2.pcd");
  EXPECT_TRUE(is_piece_file_name("piece_3_-2.pcd"));
  EXPECT_TRUE(is_piece_file_name("piece_3_0.ply"));
  for (const char* name : {"piece_3.pcd", "piece_03_0.pcd", "piece_3_0", "piece_a_0.pcd",
                           "piece_3_0.pcd.json", "piece_", "", "piece_3_0_1.pcd"})
    EXPECT_FALSE(is_piece_file_name(name)) << name;
}

}  // namespace plan_tiles_test
}  // namespace libmap
