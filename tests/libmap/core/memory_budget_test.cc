#include "libmap/core/memory_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

namespace memory_budget_test {

using libmap::MemoryBudget;

// True if another thread gets `second` while this one owns `first`; otherwise, it gets it
// afterwards.
bool both_at_once(std::uint64_t first, std::uint64_t second) {
  MemoryBudget budget(10);
  std::atomic<bool> is_given = false;
  bool was_given = false;
  std::thread other;
  {
    const MemoryBudget::Reservation reservation = budget.take(first);
    other = std::thread([&] {
      const MemoryBudget::Reservation share_of_other = budget.take(second);
      is_given = true;
    });
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
    while (!is_given && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    was_given = is_given;
  }
  other.join();
  EXPECT_TRUE(is_given);
  return was_given;
}

TEST(MemoryBudgetTest, SharesWaitForEachOther) {
  EXPECT_FALSE(both_at_once(8, 5));
  EXPECT_FALSE(both_at_once(10, 1));
}

TEST(MemoryBudgetTest, MoreThanThereIsGoesAlone) {
  EXPECT_FALSE(both_at_once(1000, 1));
  EXPECT_FALSE(both_at_once(1, 1000));
}

TEST(MemoryBudgetTest, AllComeToTheirTurn) {
  MemoryBudget budget(10);
  std::atomic<int> turns = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int n = 0; n < 500; ++n) {
        const MemoryBudget::Reservation reservation =
            budget.take(static_cast<std::uint64_t>(1 + (7 * n + 3 * t) % 12));
        ++turns;
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(turns, 2000);
}

}  // namespace memory_budget_test
