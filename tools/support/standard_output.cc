#include "tools/support/standard_output.h"

#include <cerrno>
#include <cstdio>
#include <iostream>

#include "libmap/core/error.h"
#include "libmap/core/output_lock.h"

namespace graspmap_tools {

void require_printed() {
  errno = 0;
  std::cout.flush();
  std::fflush(stdout);
  // Failed writes are visible in the streams' state only.
  if (std::cout && std::ferror(stdout) == 0) return;
  throw libmap::system_failure("standard output", "cannot be written", errno);
}

int exit_code_of_printing(const std::string& program) {
  try {
    require_printed();
    return 0;
  } catch (const libmap::Error& error) {
    std::cerr << program << ": error: " << error.what() << "\n";
    return 1;
  }
}

}  // namespace graspmap_tools
