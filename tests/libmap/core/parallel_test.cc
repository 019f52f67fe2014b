#include "libmap/core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>

#include "tests/support/test_support.h"

namespace parallel_test {

using libmap::parallel_for;
using libmap::parallel_reduce;
using libmap::ThreadLimit;

std::set<std::pair<std::size_t, std::size_t>> chunks_of(std::size_t count, std::size_t grain) {
  std::mutex mutex;
  std::set<std::pair<std::size_t, std::size_t>> chunks;
  parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
    const std::lock_guard lock(mutex);
    EXPECT_TRUE(chunks.emplace(begin, end).second) << "the same chunk twice";
  });
  return chunks;
}

TEST(ParallelTest, ChunksCoverEveryItemOnce) {
  for (const std::size_t count : {0U, 1U, 2U, 7U, 64U, 1000U})
    for (const std::size_t grain : {0U, 1U, 3U, 64U, 999U, 1000U, 5000U}) {
      std::size_t next = 0;
      for (const auto& [begin, end] : chunks_of(count, grain)) {
        EXPECT_EQ(begin, next);
        EXPECT_LT(begin, end);
        EXPECT_LE(end - begin, std::max<std::size_t>(grain, 1));
        next = end;
      }
      EXPECT_EQ(next, count) << count << " by " << grain;
    }
}

TEST(ParallelTest, ChunksDoNotDependOnTheThreads) {
  const auto chunks = [](unsigned threads) {
    const ThreadLimit limit(threads);
    return chunks_of(1003, 10);
  };
  const auto alone = chunks(1);
  EXPECT_EQ(chunks(2), alone);
  EXPECT_EQ(chunks(8), alone);
}

// A sum whose last bits depend on the order of its additions.
double sum_in_chunks(const std::vector<double>& values, unsigned threads, std::size_t grain) {
  const ThreadLimit limit(threads);
  return parallel_reduce(
      values.size(), grain, 0.0,
      [&](std::size_t begin, std::size_t end) {
        return std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(begin),
                               values.begin() + static_cast<std::ptrdiff_t>(end), 0.0);
      },
      [](double a, double b) { return a + b; });
}

TEST(ParallelTest, ReductionHasTheSameBitsForAnyThreads) {
  std::vector<double> values(100003);
  for (double& value : values) value = graspmap_test::uniform(-1, 1) * 1e10;
  const double alone = sum_in_chunks(values, 1, 1000);
  for (const unsigned threads : {2U, 8U, 0U})
    for (int round = 0; round < 10; ++round)
      ASSERT_EQ(std::bit_cast<std::uint64_t>(sum_in_chunks(values, threads, 1000)),
                std::bit_cast<std::uint64_t>(alone));
}

TEST(ParallelTest, ReductionJoinsFromLeftToRight) {
  for (const std::size_t grain : {0U, 1U, 3U, 100U}) {
    const std::string joined = parallel_reduce(
        std::size_t{26}, grain, std::string(">"),
        [](std::size_t begin, std::size_t end) {
          std::string part;
          for (std::size_t n = begin; n < end; ++n) part += static_cast<char>('a' + n);
          return part;
        },
        [](std::string a, const std::string& b) { return a + b; });
    EXPECT_EQ(joined, ">abcdefghijklmnopqrstuvwxyz");
  }
}

TEST(ParallelTest, ReductionOfNothingIsTheIdentity) { EXPECT_EQ(sum_in_chunks({}, 0, 10), 0.0); }

TEST(ParallelTest, HugeGrainIsOneChunk) {
  const std::vector<double> values = {1, 2, 3};
  constexpr std::size_t huge = std::numeric_limits<std::size_t>::max();
  EXPECT_EQ(sum_in_chunks(values, 0, huge), 6.0);
  EXPECT_EQ(chunks_of(3, huge).size(), 1U);
}

TEST(ParallelTest, ExceptionsPass) {
  for (const unsigned threads : {1U, 2U, 8U}) {
    const ThreadLimit limit(threads);
    try {
      parallel_for(1000, 1, [](std::size_t begin, std::size_t) {
        if (begin == 500) throw std::out_of_range("item 500");
      });
      ADD_FAILURE() << "nothing was thrown";
    } catch (const std::out_of_range& error) {
      EXPECT_STREQ(error.what(), "item 500");
    }
  }
}

TEST(ParallelTest, LoopsMayBeNested) {
  std::atomic<int> items = 0;
  parallel_for(20, 1, [&](std::size_t, std::size_t) {
    parallel_for(
        30, 7, [&](std::size_t begin, std::size_t end) { items += static_cast<int>(end - begin); });
  });
  EXPECT_EQ(items, 600);
}

TEST(ParallelTest, OneThreadMeansOneAtATime) {
  const ThreadLimit limit(1);
  std::atomic<int> inside = 0;
  parallel_for(100, 1, [&](std::size_t, std::size_t) {
    EXPECT_EQ(inside.fetch_add(1), 0);
    inside.fetch_sub(1);
  });
}

}  // namespace parallel_test
