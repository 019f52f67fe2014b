// Reads scenario files: flat YAML maps, see data/README.md.
#pragma once

#include <string>

#include "libgtd/detect.h"

namespace libgtd {

// Returns the parameters and the gripper of a scenario. `name` is a scenario in data/scenarios or a
// file. Throws Error naming file and field for an unknown key or gripper or a value out of range.
DetectionOptions read_scenario(const std::string& name);

}  // namespace libgtd
