// The results of the virtual field test as columns of a table.
#pragma once

#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"

namespace libgtd {

// holds: 1 or 0, as a verdict for `evaluate`; then probability, forces, contacts and failures.
const std::vector<std::string>& grasp_columns();

// One cell for each of them.
std::vector<std::string> grasp_cells(const LocationResult& result);

}  // namespace libgtd
