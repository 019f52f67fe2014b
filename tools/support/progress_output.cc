#include "tools/support/progress_output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <optional>

#include "libmap/core/error.h"

namespace graspmap_tools {

namespace {

class Silent : public libmap::Progress {
  void begin(std::string_view, std::size_t) override {}
  void advance(std::size_t) override {}
  void end() override {}
};

// After so long, what was done says how long the rest takes.
constexpr double min_elapsed_s = 2.0;

// Counts steps and shows each whole percent once, with the time left.
class Counting : public libmap::Progress {
 public:
  void begin(std::string_view stage, std::size_t total) override {
    end();
    const std::lock_guard lock(mutex_);
    stage_ = stage;
    total_ = total;
    done_ = 0;
    begin_ = Clock::now();
    shown_percent_ = -1;
    show_if_new();
  }
  void advance(std::size_t steps) override {
    const std::lock_guard lock(mutex_);
    done_ += steps;
    show_if_new();
  }
  void end() override {
    const std::lock_guard lock(mutex_);
    if (!stage_.empty()) finish();
    stage_.clear();
  }

 protected:
  using SecondsLeft = std::optional<long>;
  virtual void show(const std::string& stage, std::size_t done, std::size_t total,
                    SecondsLeft left) = 0;
  virtual void finish() {}

 private:
  using Clock = std::chrono::steady_clock;

  SecondsLeft left() const {
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin_).count();
    if (done_ == 0 || total_ < done_ || elapsed < min_elapsed_s) return std::nullopt;
    return std::lround(elapsed * static_cast<double>(total_ - done_) / static_cast<double>(done_));
  }
  void show_if_new() {
    const int percent = total_ == 0 ? 0 : static_cast<int>(done_ * 100 / total_);
    if (percent == shown_percent_) return;
    shown_percent_ = percent;
    show(stage_, done_, total_, left());
  }

  std::mutex mutex_;
  std::string stage_;
  std::size_t total_ = 0;
  std::size_t done_ = 0;
  Clock::time_point begin_;
  int shown_percent_ = -1;
};

class Bar : public Counting {
 public:
  ~Bar() override { end(); }

 private:
  void show(const std::string& stage, std::size_t done, std::size_t total,
            SecondsLeft left) override {
    constexpr std::size_t width = 30;
    if (total == 0) return fmt::print(stderr, "\r{:<24} ...\033[K", stage);
    const std::size_t filled = total == 0 ? 0 : done * width / total;
    fmt::print(stderr, "\r{:<24} [{:#<{}}{:.<{}}] {}/{}{}\033[K ", stage, "", filled, "",
               width - filled, done, total,
               left ? fmt::format(", {}:{:02} left", *left / 60, *left % 60) : "");
  }
  void finish() override { fmt::print(stderr, "\r\033[K"); }
};

class JsonLines : public Counting {
  void show(const std::string& stage, std::size_t done, std::size_t total,
            SecondsLeft left) override {
    fmt::print(stderr, "{{\"stage\":\"{}\",\"done\":{},\"total\":{}{}}}\n", stage, done, total,
               left ? fmt::format(",\"left_s\":{}", *left) : "");
  }
};

}  // namespace

std::unique_ptr<libmap::Progress> make_progress(const std::string& style) {
  if (style == "json") return std::make_unique<JsonLines>();
  if (style == "auto" && isatty(STDERR_FILENO) == 1) return std::make_unique<Bar>();
  if (style == "auto" || style == "none") return std::make_unique<Silent>();
  throw libmap::Error("unknown style",
                      {.field = "--progress", .value = style, .bound = "one of auto, json, none"});
}

}  // namespace graspmap_tools
