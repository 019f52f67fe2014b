// A bound on the memory of work that several threads do side by side.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace libmap {

// Bytes of memory of the machine: to read a larger file whole would end the program.
std::uint64_t machine_memory();

// Threads take a share before they begin what needs much memory, and wait while the shares of
// others leave too little. Order and number of results stay as they are; only time is lost.
//
// A thread that has a share must not run a parallel loop: a thread that waits for its end may take
// up other work, which waits for the share.
class MemoryBudget {
 public:
  // An eighth of the machine's memory.
  MemoryBudget();
  explicit MemoryBudget(std::uint64_t bytes) : free_(bytes), bytes_(bytes) {}
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  class Share {
   public:
    ~Share();
    Share(const Share&) = delete;
    Share& operator=(const Share&) = delete;

   private:
    friend class MemoryBudget;
    Share(MemoryBudget& budget, std::uint64_t bytes) : budget_(budget), bytes_(bytes) {}

    MemoryBudget& budget_;
    std::uint64_t bytes_;
  };

  // Returns when the bytes are free. More than there are is given out alone.
  [[nodiscard]] Share take(std::uint64_t bytes);

 private:
  std::mutex mutex_;
  std::condition_variable returned_;
  std::uint64_t free_;
  std::uint64_t bytes_;
};

}  // namespace libmap
