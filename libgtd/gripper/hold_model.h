// The section `hold_model` of a gripper file: from what a closing gripper would meet on a voxel map
// to the probability that it holds. Method `calibrated` needs it.
#pragma once

#include "libmap/core/parameters.h"

namespace libgtd {

// What the open and closing fingers meet around a voxel; see libgtd/score/closing_terms.h.
struct ClosingTerms {
  double contact = 0.0;  // share of the azimuths, on the weakest side, where spines meet the ground
  double bearing = 0.0;  // ln(1 + F / P) of the pull F that they bear there, on the weakest side
  double rise = 0.0;     // of the palm above the voxel, in lengths of a finger
  double depth = 0.0;    // of the contacts below the palm, mean, in lengths of a finger
};

// Logistic regression: ln(p / (1 - p)) = intercept + contact * C + bearing * B - rise * R -
// depth * D, fitted to verdicts of the virtual field test for one load. More contact and more
// bearing never lower the probability, more rise and depth never raise it.
struct HoldModel {
  double load_n = 0.0;
  double intercept = 0.0;
  double contact = 0.0;
  double bearing = 0.0;
  double rise = 0.0;
  double depth = 0.0;

  // In 0 .. 1, that the load is held.
  double probability(const ClosingTerms& terms) const;
};

// The keys "hold_model.KEY" of a gripper file, bound to `model`.
void bind(libmap::ParameterTable& table, HoldModel& model);

}  // namespace libgtd
