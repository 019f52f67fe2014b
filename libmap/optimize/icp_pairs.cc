#include "libmap/optimize/icp_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/features/surface_samples.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/spatial_index.h"

namespace libmap {

namespace {

constexpr int overlap_samples = 300;
constexpr double reach_m = 2.5;  // maximum distance between the poses of a pair
constexpr double view_angle_deg = 100.0;
constexpr std::size_t max_candidates = 24;
constexpr std::size_t nearest_considered = 8 * max_candidates;

struct PosedFrame {
  std::size_t index = 0;  // among all frames
  int node = 0;
  const Pose& map_from_base;
};

double overlap_of(const std::vector<PlacedElement>& samples, const FrameFeatures& other,
                  const Pose& other_from_base) {
  if (samples.empty()) return 0.0;
  double seen = 0.0;
  for (const PlacedElement& sample : samples) {
    PlacedElement element;
    const Eigen::Vector3d point = other_from_base * sample.point;
    if (element_at(other, point, element) &&
        std::abs(element.normal.dot(point - element.point)) < 0.05)
      seen += 1.0;
  }
  return seen / static_cast<double>(samples.size());
}

// Returns frames whose field of view may overlap the n-th frame's, nearest first.
std::vector<std::size_t> candidates_of(const PointTree& neighbors,
                                       const std::vector<PosedFrame>& posed,
                                       const std::map<int, std::size_t>& component_of,
                                       std::size_t n) {
  const PosedFrame& frame = posed[n];
  std::vector<std::pair<double, std::size_t>> ranked;
  for (const auto& [near, square_m2] : neighbors.around(n, nearest_considered, reach_m)) {
    const PosedFrame& other = posed[near];
    if (component_of.at(frame.node) != component_of.at(other.node)) continue;
    const double angle =
        rotation_vector_of(frame.map_from_base.linear().transpose() * other.map_from_base.linear())
            .norm() *
        180.0 / std::numbers::pi;
    if (angle > view_angle_deg) continue;
    ranked.emplace_back(std::sqrt(square_m2) / reach_m + angle / view_angle_deg, near);
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), max_candidates));
  std::vector<std::size_t> candidates;
  candidates.reserve(ranked.size());
  for (const auto& [measure, other] : ranked) candidates.push_back(other);
  return candidates;
}

}  // namespace

std::vector<FramePair> linked_pairs(const std::vector<FrameFeatures>& frames,
                                    const std::map<int, Pose>& map_from_base,
                                    const std::vector<PoseLink>& links) {
  std::map<int, std::size_t> frame_of;
  for (std::size_t f = 0; f < frames.size(); ++f) frame_of[frames[f].node] = f;
  std::set<FramePair> pairs;
  for (const PoseLink& link : links) {
    const auto a = frame_of.find(link.from);
    const auto b = frame_of.find(link.to);
    if (a == frame_of.end() || b == frame_of.end() || a == b) continue;
    if (!map_from_base.contains(link.from) || !map_from_base.contains(link.to)) continue;
    pairs.insert(std::minmax(a->second, b->second));
  }
  return {pairs.begin(), pairs.end()};
}

std::vector<FramePair> overlapping_pairs(const std::vector<FrameFeatures>& frames,
                                         const std::map<int, Pose>& map_from_base,
                                         const std::vector<GraphComponent>& components,
                                         const IcpOptions& options) {
  std::map<int, std::size_t> component_of;
  for (std::size_t n = 0; n < components.size(); ++n)
    for (const int node : components[n].nodes) component_of[node] = n;
  std::vector<PosedFrame> posed;
  std::vector<Eigen::Vector3d> positions;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto pose = map_from_base.find(frames[f].node);
    if (pose == map_from_base.end()) continue;
    posed.push_back({f, frames[f].node, pose->second});
    positions.emplace_back(pose->second.translation());
  }
  if (posed.empty()) return {};
  const PointTree neighbors(positions);
  std::vector<std::vector<FramePair>> of_frame(posed.size());
  parallel_each(posed.size(), [&](std::size_t n) {
    const PosedFrame& frame = posed[n];
    const std::vector<PlacedElement> few =
        surface_samples(frames[frame.index], overlap_samples, SampleUse::estimation);
    std::vector<std::pair<double, std::size_t>> ranked;
    for (const std::size_t candidate : candidates_of(neighbors, posed, component_of, n)) {
      const PosedFrame& other = posed[candidate];
      const double fraction =
          overlap_of(few, frames[other.index], other.map_from_base.inverse() * frame.map_from_base);
      if (fraction >= options.min_overlap) ranked.emplace_back(-fraction, other.index);
    }
    std::sort(ranked.begin(), ranked.end());
    ranked.resize(std::min(ranked.size(), static_cast<std::size_t>(options.pairs_per_frame)));
    for (const auto& [fraction, other] : ranked)
      of_frame[n].push_back(std::minmax(frame.index, other));
  });
  std::set<FramePair> pairs;
  for (const auto& some : of_frame) pairs.insert(some.begin(), some.end());
  return {pairs.begin(), pairs.end()};
}

}  // namespace libmap
