// The entry of libFuzzer: runs the target that the environment variable GRASPMAP_FUZZ_TARGET names.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <iostream>

#include "tests/fuzz/fuzz_targets.h"

// Third-party readers that give up on a broken file leave some of their own memory behind.
// NOLINTNEXTLINE(bugprone-reserved-identifier): the name that LeakSanitizer looks for.
extern "C" const char* __lsan_default_suppressions() { return "leak:libvtk"; }

namespace {

const graspmap_fuzz::FuzzTarget& chosen_target() {
  const char* name = std::getenv("GRASPMAP_FUZZ_TARGET");  // NOLINT: nothing sets it meanwhile
  try {
    return graspmap_fuzz::fuzz_target(name == nullptr ? "" : name);
  } catch (const std::exception& error) {
    std::cerr << "GRASPMAP_FUZZ_TARGET: " << error.what() << '\n';
    std::exit(2);  // NOLINT: no other thread is there yet
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const graspmap_fuzz::FuzzTarget& target = chosen_target();
  target.run({reinterpret_cast<const char*>(data), size});
  return 0;
}
