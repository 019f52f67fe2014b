// Results of the virtual field test as table columns, for `graspmap grasp` and `footholds`.
#pragma once

#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"

namespace libgtd {

// Returns the names of the columns, e.g. graspable (1 or 0, the result for `evaluate`) and
// hold_probability; for each further load L (N) also graspable_L and hold_probability_L.
std::vector<std::string> grasp_columns(const std::vector<double>& extra_loads_n = {});

// Returns the cells of one location, one per column.
std::vector<std::string> grasp_cells(const LocationResult& result);

}  // namespace libgtd
