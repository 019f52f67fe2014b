#include "libgtd/gripper/closing_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

constexpr double friction = 0.39;
constexpr double degree = libmap::radians_per_degree;

// Mean over the leans of facets.
double mean_pull_n(double fall_deg, const GripperFingers& fingers) {
  const double most = fingers.spines_per_finger * fingers.spine_force_limit_n;
  const double phi = std::atan(friction);
  constexpr int leans = 91;
  double sum = 0.0;
  for (int psi = 0; psi < leans; ++psi) {
    const double angle = (fall_deg + psi - 90.0) * degree + phi;
    if (angle <= 0.0) continue;
    sum += angle < std::numbers::pi / 2.0
               ? std::min(most, fingers.closing_force_n * std::tan(angle))
               : most;
  }
  return sum / leans;
}

}  // namespace

double ClosingPath::reach_m() const {
  double reach = palm_radius_m;
  for (const auto* places : {&closing, &open})
    for (const Place& place : *places) reach = std::max(reach, place.radius_m);
  return reach;
}

void require_hold_model(const Gripper& gripper) {
  for (const auto& [section, is_there] : {std::pair{"fingers", gripper.fingers.has_value()},
                                          {"hold_model", gripper.hold_model.has_value()}})
    if (!is_there)
      throw libmap::Error("missing: method calibrated needs it, corrected does not",
                          {.field = section});
}

ClosingPath make_closing_path(const Gripper& gripper, double voxel_size_m) {
  require_hold_model(gripper);
  ClosingPath path;
  path.model = *gripper.hold_model;
  path.palm_radius_m = 0.0005 * gripper.palm_diameter_mm;
  const double joint = 0.0005 * gripper.finger_joint_diameter_mm;
  const double proximal = 0.001 * gripper.finger_length_mm;
  const double distal = 0.001 * gripper.spine_length_mm;
  const double curl = gripper.fingers->curl_deg * degree;
  path.finger_length_m = proximal + distal;
  const auto place = [&](double angle, double along_proximal, double along_distal) {
    return ClosingPath::Place{
        joint + along_proximal * std::sin(angle) + along_distal * std::sin(angle - curl),
        along_proximal * std::cos(angle) + along_distal * std::cos(angle - curl),
        along_distal > 0.0};
  };
  const double opening = gripper.opening_angle_deg * degree;
  const double closing = gripper.closing_angle_deg * degree;
  const int steps =
      std::max(1, static_cast<int>(std::ceil((opening - closing) * path.finger_length_m /
                                             (0.5 * voxel_size_m))));
  for (int n = 0; n <= steps; ++n) {
    const double angle = opening + (closing - opening) * n / steps;
    for (const double share : {1.0, 0.5, 0.0})
      path.closing.push_back(place(angle, proximal, share * distal));
  }
  const int parts =
      std::max(1, static_cast<int>(std::ceil(path.finger_length_m / (0.5 * voxel_size_m))));
  for (int n = 0; n <= parts; ++n) {
    const double along = path.finger_length_m * n / parts;
    path.open.push_back(place(opening, std::min(along, proximal), std::max(0.0, along - proximal)));
  }
  for (std::size_t n = 0; n < path.bearing.size(); ++n)
    path.bearing[n] = std::log1p(mean_pull_n(static_cast<double>(n) - 90.0, *gripper.fingers) /
                                 gripper.fingers->closing_force_n);
  return path;
}

}  // namespace libgtd
