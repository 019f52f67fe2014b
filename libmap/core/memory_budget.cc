#include "libmap/core/memory_budget.h"

#include <unistd.h>

#include <algorithm>

namespace libmap {

std::uint64_t machine_memory() {
  return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

MemoryBudget::MemoryBudget() : MemoryBudget(machine_memory() / 8) {}

MemoryBudget::Reservation MemoryBudget::take(std::uint64_t bytes) {
  const std::uint64_t reservation = std::min(bytes, bytes_);
  std::unique_lock lock(mutex_);
  returned_.wait(lock, [&] { return reservation <= free_; });
  free_ -= reservation;
  return {*this, reservation};
}

MemoryBudget::Reservation::~Reservation() {
  {
    const std::lock_guard lock(budget_.mutex_);
    budget_.free_ += bytes_;
  }
  budget_.returned_.notify_all();
}

}  // namespace libmap
