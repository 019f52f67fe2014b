// Parallel loops with results that do not depend on the number of threads: the chunks of a loop
// depend on `count` and `grain` only, and reductions join the results of the chunks in order.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace libmap {

// Calls body(begin, end) for consecutive ranges of at most `grain` items that cover 0..count-1, on
// oneTBB's threads. An exception in a body ends the loop and is rethrown to the caller.
void parallel_for(std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

// Calls step(n) for each n of 0..count-1 in parallel, in chunks of `grain` (default 1).
template <typename Step>
void parallel_each(std::size_t count, std::size_t grain, const Step& step) {
  parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) step(n);
  });
}
template <typename Step>
void parallel_each(std::size_t count, const Step& step) {
  parallel_each(count, 1, step);
}

// Returns the results of chunk(begin, end) for ranges as in parallel_for, joined left to right with
// join(a, b), beginning with `identity`.
template <typename T, typename Chunk, typename Join>
T parallel_reduce(std::size_t count, std::size_t grain, T identity, const Chunk& chunk,
                  const Join& join) {
  static_assert(!std::is_same_v<T, bool>, "threads cannot write to one std::vector<bool>");
  if (grain == 0) grain = 1;
  const std::size_t chunks = count == 0 ? 0 : (count - 1) / grain + 1;
  std::vector<T> parts(chunks, identity);
  parallel_for(chunks, 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t c = first; c < last; ++c) {
      const std::size_t begin = c * grain;
      parts[c] = chunk(begin, grain < count - begin ? begin + grain : count);
    }
  });
  T result = std::move(identity);
  for (T& part : parts) result = join(std::move(result), std::move(part));
  return result;
}

// Limits the number of threads of parallel loops while the object exists.
class ThreadLimit {
 public:
  explicit ThreadLimit(unsigned threads);  // 0: all hardware threads
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Control;
  std::unique_ptr<Control> control_;
};

}  // namespace libmap
