// Progress reporting. Library functions take a Progress; the caller chooses a bar, JSON lines or
// no output.
#pragma once

#include <cstddef>
#include <string_view>

namespace libmap {

class Progress {
 public:
  virtual ~Progress() = default;
  // Begins a stage of `total` steps (0: unknown) and ends the previous stage.
  virtual void begin(std::string_view stage, std::size_t total) = 0;
  // Reports `steps` more completed steps. Can be called from any thread.
  virtual void advance(std::size_t steps) = 0;
  virtual void end() = 0;
};

// Returns a Progress without output.
Progress& no_progress();

}  // namespace libmap
