// The results of the virtual field test as columns of a table.
#pragma once

#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"

namespace libgtd {

// graspable: 1 or 0, the verdict as `evaluate` takes it; then probability, forces, contacts and
// failures.
// For each further load L: graspable_L and hold_probability_L.
std::vector<std::string> grasp_columns(const std::vector<double>& more_loads_n = {});

// One cell for each of them.
std::vector<std::string> grasp_cells(const LocationResult& result);

}  // namespace libgtd
