#include "libmap/core/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#if defined(__SANITIZE_THREAD__)
#define GRASPMAP_THREAD_SANITIZER
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define GRASPMAP_THREAD_SANITIZER
#endif
#endif

namespace libmap {

#ifdef GRASPMAP_THREAD_SANITIZER

// Debian's oneTBB is compiled without the sanitizer, which therefore does not see its
// synchronization. Plain threads replace it, so that data races between chunks are detected.
void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  const std::size_t chunks = (count - 1) / grain + 1;
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t c = next++; c < chunks; c = next++)
        body(c * grain, c * grain + std::min(grain, count - c * grain));
    } catch (...) {
      next = chunks;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  const std::size_t threads = std::min(
      chunks, tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  std::vector<std::thread> others;
  for (std::size_t t = 1; t < threads; ++t) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

#else

void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  // Chunks are formed here and not by oneTBB, whose ranges depend on the number of threads.
  const std::size_t chunks = (count - 1) / grain + 1;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, chunks, 1),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t c = range.begin(); c != range.end(); ++c)
                        body(c * grain, c * grain + std::min(grain, count - c * grain));
                    });
}

#endif

struct ThreadLimit::Control {
  explicit Control(std::size_t threads)
      : control(tbb::global_control::max_allowed_parallelism, threads) {}
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(unsigned threads)
    : control_(std::make_unique<Control>(
          threads == 0 ? std::max(1U, std::thread::hardware_concurrency()) : threads)) {}

ThreadLimit::~ThreadLimit() = default;

}  // namespace libmap
