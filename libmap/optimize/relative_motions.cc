#include "libmap/optimize/relative_motions.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "libmap/geometry/rigid_motion.h"

namespace libmap {

namespace {

// Between closer poses, the velocity varies less.
constexpr double unsteady_after_s = 0.33;
constexpr double close_s = 0.15;
constexpr double max_motion_gap_s = 3.0;

// Derivative at time 0 of the polynomial through values at the given times (Lagrange).
Vector6d slope_of(const std::vector<double>& times, const std::vector<Vector6d>& values) {
  Vector6d slope = Vector6d::Zero();
  for (std::size_t n = 0; n < times.size(); ++n) {
    double fraction = 0.0;
    for (std::size_t m = 0; m < times.size(); ++m) {
      if (m == n) continue;
      double product = 1.0 / (times[n] - times[m]);
      for (std::size_t k = 0; k < times.size(); ++k)
        if (k != n && k != m) product *= -times[k] / (times[n] - times[k]);
      fraction += product;
    }
    slope += fraction * values[n];
  }
  return slope;
}

// Uses one pose before and one after each frame, or two each if they follow closely. If one side
// has no pose within max_motion_gap_s, the velocity is from the other side only, or zero.
void add_motions(std::vector<std::pair<double, int>> nodes, const std::map<int, Pose>& poses,
                 std::map<int, KnownMotion>& motions) {
  std::sort(nodes.begin(), nodes.end());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const double time_s = nodes[n].first;
    const int node = nodes[n].second;
    const auto has = [&](std::size_t other, double gap_s) {
      return other < nodes.size() && std::abs(nodes[other].first - time_s) <= gap_s;
    };
    std::size_t first = n > 0 && has(n - 1, max_motion_gap_s) ? n - 1 : n;
    std::size_t last = has(n + 1, max_motion_gap_s) ? n + 1 : n;
    const bool closely = n > 1 && has(n - 2, 2.0 * close_s) && has(n + 2, 2.0 * close_s);
    std::vector<double> times;
    std::vector<Vector6d> steps;
    if (closely) {
      --first;
      ++last;
    }
    for (std::size_t k = first; k <= last; ++k) {
      // For poses further apart, a difference is more accurate than a curve through three poses.
      if (k == n && !closely && first < n && n < last) continue;
      if (!times.empty() && nodes[k].first - time_s <= times.back()) continue;
      times.push_back(nodes[k].first - time_s);
      steps.push_back(step_between(poses.at(node), poses.at(nodes[k].second)));
    }
    KnownMotion& motion = motions[node];
    if (times.size() < 2) continue;
    motion.mean = closely
                      ? slope_of(times, steps)
                      : Vector6d((steps.back() - steps.front()) / (times.back() - times.front()));
    const double apart_s = std::max(times.back(), -times.front());
    motion.deviation *= std::min(1.0, apart_s / unsteady_after_s);
  }
}

}  // namespace

std::map<int, KnownMotion> relative_motions(const std::vector<FrameFeatures>& frames,
                                            const std::map<int, Pose>& poses,
                                            const std::vector<GraphComponent>& components) {
  std::map<int, std::size_t> component_of;
  for (std::size_t n = 0; n < components.size(); ++n)
    for (const int node : components[n].nodes) component_of.emplace(node, n);
  std::map<std::size_t, std::vector<std::pair<double, int>>> nodes_of;
  for (const FrameFeatures& frame : frames) {
    const auto component = component_of.find(frame.node);
    if (!poses.contains(frame.node) || (component == component_of.end() && !components.empty()))
      continue;
    nodes_of[component == component_of.end() ? 0 : component->second].emplace_back(frame.stamp_s,
                                                                                   frame.node);
  }
  std::map<int, KnownMotion> motions;
  for (const auto& [component, nodes] : nodes_of) add_motions(nodes, poses, motions);
  return motions;
}

}  // namespace libmap
