#include "libmap/core/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <thread>

namespace libmap {

void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  // Chunks are cut here and not by oneTBB, whose ranges depend on the number of threads.
  const std::size_t chunks = (count - 1) / grain + 1;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, chunks, 1),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t c = range.begin(); c != range.end(); ++c)
                        body(c * grain, c * grain + std::min(grain, count - c * grain));
                    });
}

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
