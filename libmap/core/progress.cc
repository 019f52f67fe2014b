#include "libmap/core/progress.h"

namespace libmap {

namespace {

class Silent : public Progress {
  void begin(std::string_view, std::size_t) override {}
  void advance(std::size_t) override {}
  void end() override {}
};

}  // namespace

Progress& no_progress() {
  static Silent silent;
  return silent;
}

}  // namespace libmap
