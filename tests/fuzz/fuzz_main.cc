// The entry of libFuzzer for the target that the build names.
#include <cstddef>
#include <cstdint>

#include "tests/fuzz/fuzz_targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const graspmap_fuzz::FuzzTarget& target = graspmap_fuzz::fuzz_target(GRASPMAP_FUZZ_TARGET);
  target.run({reinterpret_cast<const char*>(data), size});
  return 0;
}
