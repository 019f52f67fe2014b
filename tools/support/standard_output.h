// What is printed is an output as well.
#pragma once

#include <string>

namespace graspmap_tools {

// Throws Error (failed) unless all that was printed to standard output has been written.
void require_printed();

// 0, or 1 and a line of `program` on stderr if some of it was not written.
int exit_code_of_printing(const std::string& program);

}  // namespace graspmap_tools
