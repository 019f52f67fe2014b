// Detects standard output that could not be written, e.g. because of a full disk.
#pragma once

#include <string>

namespace graspmap_tools {

// Flushes standard output. Throws Error (failed) if not all output was written.
void require_printed();

// Flushes standard output. Returns 0, or 1 with an error line on stderr if it was not all written.
int exit_code_of_printing(const std::string& program);

}  // namespace graspmap_tools
