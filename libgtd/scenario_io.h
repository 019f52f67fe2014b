// Scenario files: a flat YAML map, see data/README.md.
#pragma once

#include <string>

#include "libgtd/detect.h"

namespace libgtd {

// The parameters of a scenario, by its name in data/scenarios or a file, and its gripper. Throws
// Error naming the file and the field: an unknown key, a value outside its bound.
DetectionOptions read_scenario(const std::string& name);

}  // namespace libgtd
