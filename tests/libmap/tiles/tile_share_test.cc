#include "libmap/tiles/tile_share.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/support/test_support.h"

namespace tile_share_test {

using libmap::parse_share;
using libmap::share_of;
using libmap::TileShare;

TEST(TileShare, TextComesBack) {
  EXPECT_EQ(parse_share("2/5").number, 2);
  EXPECT_EQ(parse_share("2/5").count, 5);
  EXPECT_EQ(to_text(parse_share("1000000/1000000")), "1000000/1000000");
  for (const char* text :
       {"", "1", "/", "0/3", "4/3", "1/0", "-1/3", "1/2/3", "1/1000001", "a/b"}) {
    const libmap::Error error = graspmap_test::error_of([&] { parse_share(text); });
    EXPECT_EQ(error.context().field, "--tile");
    EXPECT_EQ(error.context().value, text);
  }
}

TEST(TileShare, AllSharesAreAllTiles) {
  for (const int tiles : {0, 1, 7, 100})
    for (const int count : {1, 2, 3, 9}) {
      std::vector<int> all(static_cast<std::size_t>(tiles));
      std::iota(all.begin(), all.end(), 0);
      std::vector<int> joined;
      for (int number = 1; number <= count; ++number)
        for (const int tile : share_of(all, {number, count})) joined.push_back(tile);
      EXPECT_EQ(joined, all) << count << " shares";
    }
}

TEST(TileShare, NoSuchShareIsAnError) {
  for (const TileShare share : {TileShare{0, 3}, TileShare{4, 3}, TileShare{1, 0}})
    EXPECT_EQ(graspmap_test::error_of([&] { libmap::share_range(5, share); }).context().field,
              "tile");
}

}  // namespace tile_share_test
