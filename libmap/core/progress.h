// How long work says how far it is. Library functions take a Progress; the caller decides whether
// that is a bar, JSON lines or nothing.
#pragma once

#include <cstddef>
#include <string_view>

namespace libmap {

class Progress {
 public:
  virtual ~Progress() = default;
  // A stage of `total` steps begins; it ends the one before. 0: the number is not known.
  virtual void begin(std::string_view stage, std::size_t total) = 0;
  // `steps` more are done. May be called from any thread.
  virtual void advance(std::size_t steps) = 0;
  virtual void end() = 0;
};

// Says nothing.
Progress& no_progress();

}  // namespace libmap
