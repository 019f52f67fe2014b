#include "libmap/scan/view_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace libmap {

void bind(ParameterTable& table, ViewSelectionOptions& options) {
  table.add("radius_m", options.radius_m, not_negative,
            "of two pictures nearer than this that look the same way one is kept");
  table.add("angle_deg", options.angle_deg, {0.0, 180.0},
            "pictures look the same way within this angle");
}

namespace {

bool resemble(const Pose& a, const Pose& b, const ViewSelectionOptions& options) {
  if (!((a.translation() - b.translation()).norm() < options.radius_m)) return false;
  const Eigen::Vector3d axis = a.linear().col(2);
  const Eigen::Vector3d other = b.linear().col(2);
  const double angle = std::atan2(axis.cross(other).norm(), axis.dot(other));
  return angle <= options.angle_deg * std::numbers::pi / 180.0;
}

}  // namespace

std::vector<std::size_t> select_views(const std::vector<Pose>& world_from_camera,
                                      const std::vector<double>& qualities,
                                      const ViewSelectionOptions& options) {
  std::vector<std::size_t> order(world_from_camera.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return qualities[a] > qualities[b]; });
  std::vector<std::size_t> kept;
  for (const std::size_t view : order)
    if (std::none_of(kept.begin(), kept.end(), [&](std::size_t other) {
          return resemble(world_from_camera[view], world_from_camera[other], options);
        }))
      kept.push_back(view);
  std::sort(kept.begin(), kept.end());
  return kept;
}

}  // namespace libmap
