// Fits the hold model of a gripper to verdicts of the virtual field test.
#pragma once

#include <cstddef>
#include <string>

#include "libgtd/gripper/gripper.h"
#include "libmap/core/table.h"

namespace libgtd {

struct HoldModelFit {
  HoldModel model;
  std::size_t places = 0;
  std::size_t left_out = 0;  // an empty cell: no label, or not on the map
};

// Logistic regression of the labels (as in evaluate_table) on closing_contact, closing_bearing,
// closing_rise and closing_depth by Newton's method. A term whose weight would have the wrong sign
// gets the weight 0 and the others are fitted again (an active set). A ridge of 1e-6 a place keeps
// the weights finite where the classes are separable. Throws Error: a missing column, a cell that
// is no label or number, less than 10 places.
HoldModelFit fit_hold_model(const libmap::Table& table, const std::string& label_column,
                            double load_n);

// The section hold_model as the lines of a gripper file.
std::string to_yaml_section(const HoldModel& model);

}  // namespace libgtd
