// Limits the memory that several threads use at the same time.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace libmap {

// Returns the physical memory of the machine in bytes.
std::uint64_t machine_memory();

// Memory budget of several threads. A thread reserves memory before work that needs much memory,
// and waits while too little is free. Results do not depend on the budget.
//
// A thread that holds a Reservation must not run a parallel loop: while the thread waits for the
// loop, oneTBB can run a task on it that waits for the reserved memory (deadlock).
class MemoryBudget {
 public:
  MemoryBudget();  // an eighth of the machine's memory
  explicit MemoryBudget(std::uint64_t bytes) : free_(bytes), bytes_(bytes) {}
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  // Reserved memory, which the destructor returns to the budget.
  class Reservation {
   public:
    ~Reservation();
    Reservation(const Reservation&) = delete;
    Reservation& operator=(const Reservation&) = delete;

   private:
    friend class MemoryBudget;
    Reservation(MemoryBudget& budget, std::uint64_t bytes) : budget_(budget), bytes_(bytes) {}

    MemoryBudget& budget_;
    std::uint64_t bytes_;
  };

  // Blocks until the bytes are free. A request above the budget blocks until nothing is reserved.
  [[nodiscard]] Reservation take(std::uint64_t bytes);

 private:
  std::mutex mutex_;
  std::condition_variable returned_;
  std::uint64_t free_;
  std::uint64_t bytes_;
};

}  // namespace libmap
