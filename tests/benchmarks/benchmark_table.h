// Shared code of the scoring benchmarks: timing with repetitions, and a table of the whole run.
#pragma once

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace graspmap_bench {

// Wall times of the repetitions, and the minimum processor time of all threads and finished child
// processes, which is less sensitive to other work on the machine.
struct Times {
  std::vector<double> seconds;
  double processor_s = std::numeric_limits<double>::infinity();

  double min() const { return *std::min_element(seconds.begin(), seconds.end()); }
};

inline double processor_seconds() {
  timespec own{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &own);
  rusage children{};
  getrusage(RUSAGE_CHILDREN, &children);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return static_cast<double>(own.tv_sec) + 1e-9 * static_cast<double>(own.tv_nsec) +
         seconds(children.ru_utime) + seconds(children.ru_stime);
}

template <typename Work>
void time_once(const Work& work, Times& times) {
  const double processor_start = processor_seconds();
  const auto start = std::chrono::steady_clock::now();
  work();
  times.seconds.push_back(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  times.processor_s = std::min(times.processor_s, processor_seconds() - processor_start);
}

// Runs the benchmark's iterations and sets the counters min_ms (wall time) and processor_ms.
template <typename Work>
Times time_iterations(benchmark::State& state, const Work& work) {
  Times times;
  for (auto _ : state) time_once(work, times);
  state.counters["min_ms"] = 1e3 * times.min();
  state.counters["processor_ms"] = 1e3 * times.processor_s;
  return times;
}

// Sets the counter author_ms: processor time of the thesis author's program; 0: not measured.
inline void set_author_ms(benchmark::State& state, double author_ms) {
  if (author_ms > 0.0) state.counters["author_ms"] = author_ms;
}

inline std::string threads_text(unsigned threads) {
  return std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

// Returns the folder in this environment variable; nullopt if the variable is empty or not set.
inline std::optional<std::filesystem::path> folder_of(const char* variable) {
  const char* const value = std::getenv(variable);
  if (value == nullptr || *value == '\0') return std::nullopt;
  return value;
}

}  // namespace graspmap_bench
