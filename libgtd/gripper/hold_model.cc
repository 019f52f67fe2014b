#include "libgtd/gripper/hold_model.h"

#include <cmath>

namespace libgtd {

double HoldModel::probability(const ClosingTerms& terms) const {
  return 1.0 / (1.0 + std::exp(-(intercept + contact * terms.contact + bearing * terms.bearing -
                                 rise * terms.rise - depth * terms.depth)));
}

void bind(libmap::ParameterTable& table, HoldModel& model) {
  using libmap::not_negative;
  table.add("hold_model.load_n", model.load_n, libmap::positive, "pull that the model is for, N");
  table.add("hold_model.intercept", model.intercept, {-100.0, 100.0}, "logit without any term");
  table.add("hold_model.contact", model.contact, not_negative,
            "weight of the share of fingers whose spines meet the ground");
  table.add("hold_model.bearing", model.bearing, not_negative, "weight of what these bear");
  table.add("hold_model.rise", model.rise, not_negative,
            "weight of the palm's height above the voxel");
  table.add("hold_model.depth", model.depth, not_negative,
            "weight of the depth of the contacts below the palm");
}

}  // namespace libgtd
