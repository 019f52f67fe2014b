// What this program is made of.
#pragma once

#include <string>

namespace graspmap_tools {

// "graspmap VERSION", then a line each for the commit, the compiler and every library with the
// version it was built against.
std::string version_text();

}  // namespace graspmap_tools
