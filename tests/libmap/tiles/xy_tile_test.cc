#include "libmap/tiles/xy_tile.h"

#include <gtest/gtest.h>

namespace libmap {
namespace xy_tile_test {

TEST(XyTile, NamesAreThoseOfTheirPlaces) {
  EXPECT_EQ(tile_file_name({3, -2}, ".pcd"), "piece_3_-2.pcd");
  EXPECT_TRUE(is_tile_file_name("piece_3_-2.pcd"));
  EXPECT_TRUE(is_tile_file_name("piece_3_0.ply"));
  for (const char* name : {"piece_3.pcd", "piece_03_0.pcd", "piece_3_0", "piece_a_0.pcd",
                           "piece_3_0.pcd.json", "piece_", "", "piece_3_0_1.pcd"})
    EXPECT_FALSE(is_tile_file_name(name)) << name;
}

}  // namespace xy_tile_test
}  // namespace libmap
