// Measures the wall times of the steps of a stage, for its result struct and the manifest.
#pragma once

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace libmap {

using StageTimings = std::vector<std::pair<std::string, double>>;  // step, seconds

// Adds the time from its construction to its destruction to `timings_s`; sums times of equal names.
class StageTimer {
 public:
  StageTimer(StageTimings& timings_s, std::string name)
      : timings_s_(timings_s), name_(std::move(name)) {}
  ~StageTimer() {
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start_;
    const auto same = std::find_if(timings_s_.begin(), timings_s_.end(),
                                   [this](const auto& timing) { return timing.first == name_; });
    if (same != timings_s_.end())
      same->second += taken.count();
    else
      timings_s_.emplace_back(std::move(name_), taken.count());
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  StageTimings& timings_s_;
  std::string name_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Returns step() and adds its time to `timings_s` under `name`.
template <typename Step>
auto timed(StageTimings& timings_s, const char* name, const Step& step) {
  const StageTimer timer(timings_s, name);
  return step();
}

}  // namespace libmap
