#include "libmap/refine/loop_closure.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/optimize/graph_covariance.h"

namespace libmap {

namespace {

constexpr double degree = std::numbers::pi / 180.0;
constexpr double confirmed_m = 0.1;  // maximum difference of two links between two components
constexpr double confirmed_rad = 5.0 * degree;
constexpr std::size_t considered_per_pair = 8;  // candidates per pair, before the angle's test

FramePair ordered(std::size_t a, std::size_t b) { return {std::min(a, b), std::max(a, b)}; }

// Adds pairs of one component: each frame with the nearest frames of similar rotation.
void add_near_pairs(const std::vector<std::size_t>& members, const std::vector<const Pose*>& poses,
                    const LoopClosureDetectionOptions& options, std::set<FramePair>& pairs) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(members.size());
  for (const std::size_t f : members) positions.emplace_back(poses[f]->translation());
  const PointTree neighbors(positions);
  const auto wanted = static_cast<std::size_t>(options.near_candidates);
  for (std::size_t n = 0; n < members.size(); ++n) {
    std::vector<std::pair<double, std::size_t>> ranked;
    for (const auto& [other, square_m2] :
         neighbors.around(n, considered_per_pair * wanted, options.radius_m)) {
      const double angle = rotation_vector_of(poses[members[n]]->linear().transpose() *
                                              poses[members[other]]->linear())
                               .norm() /
                           degree;
      if (angle > options.angle_deg) continue;
      ranked.emplace_back(std::sqrt(square_m2) / options.radius_m + angle / options.angle_deg,
                          members[other]);
    }
    std::sort(ranked.begin(), ranked.end());
    ranked.resize(std::min(ranked.size(), wanted));
    for (const auto& [measure, other] : ranked) pairs.insert(ordered(members[n], other));
  }
}

Matrix6d slack_of(const LoopClosureDetectionOptions& options) {
  Vector6d square;
  square << Eigen::Vector3d::Constant(options.graph_slack_m * options.graph_slack_m),
      Eigen::Vector3d::Constant(std::pow(options.graph_slack_deg * degree, 2));
  return square.asDiagonal();
}

// Returns true if both links determine the same relative pose of their two components.
bool agree(const FeatureLink& one, const FeatureLink& other, const PoseGraphResult& graph) {
  const auto moved_by = [&](const PoseLink& link, bool swapped) {
    const Pose& a = graph.map_from_base.at(link.from);
    const Pose& b = graph.map_from_base.at(link.to);
    return swapped ? Pose(b * link.from_from_to.inverse() * a.inverse())
                   : Pose(a * link.from_from_to * b.inverse());
  };
  const auto component_of = [&](int node) {
    for (std::size_t n = 0; n < graph.components.size(); ++n)
      if (std::find(graph.components[n].nodes.begin(), graph.components[n].nodes.end(), node) !=
          graph.components[n].nodes.end())
        return n;
    return graph.components.size();
  };
  const std::size_t first = component_of(one.link.from);
  const std::size_t second = component_of(one.link.to);
  const std::size_t other_first = component_of(other.link.from);
  const std::size_t other_second = component_of(other.link.to);
  if (std::minmax(first, second) != std::minmax(other_first, other_second)) return false;
  const bool swapped = first != other_first;
  const Pose a = moved_by(one.link, false);
  const Pose b = moved_by(other.link, swapped);
  // The pose of the link's node by both links.
  const Pose& node = graph.map_from_base.at(one.link.to);
  return is_near(a * node, b * node, confirmed_m, confirmed_rad);
}

}  // namespace

void bind(ParameterTable& table, LoopClosureDetectionOptions& options) {
  table.add("radius_m", options.radius_m, not_negative,
            "loop closure candidates by pose: maximum distance between two frames, m");
  table.add("angle_deg", options.angle_deg, {0.0, 180.0},
            "loop closure candidates by pose: maximum rotation between two frames, degrees");
  table.add("near_candidates", options.near_candidates, not_negative,
            "loop closure candidates by pose: maximum number per frame");
  table.add("similar_candidates", options.similar_candidates, not_negative,
            "loop closure candidates by image similarity: maximum number per frame");
  table.add("neighbors", options.neighbors, not_negative,
            "number of following frames with which each frame is matched");
  table.add(
      "max_ratio", options.max_ratio, {0.0, 1.0, true, false},
      "maximum ratio of descriptor distances: a feature's best match to its second-best match");
  table.add("min_inliers", options.estimate.min_inliers, {6, 100000},
            "minimum number of matches that agree with a relative pose of two frames");
  table.add("min_spread", options.estimate.min_spread, not_negative,
            "minimum width in the image of the area with matches that agree, in focal lengths");
  table.add("max_graph_chi_square", options.max_graph_chi_square, positive,
            "maximum chi-square of the difference between a new loop closure and the pose graph; "
            "closures above are dropped");
  table.add("words", options.appearance.words, {1, 65536},
            "number of visual words by which the appearance of frames is compared");
}

std::set<FramePair> consecutive_pairs(const std::vector<FrameFeatures>& frames, int neighbors) {
  std::set<FramePair> pairs;
  for (std::size_t a = 0; a < frames.size(); ++a)
    for (std::size_t b = a + 1; b < frames.size() && b - a <= static_cast<std::size_t>(neighbors);
         ++b)
      pairs.insert({a, b});
  return pairs;
}

std::set<FramePair> similar_pairs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<GraphComponent>& components,
                                  const LoopClosureDetectionOptions& options, std::uint64_t seed) {
  std::set<FramePair> pairs;
  std::vector<std::size_t> parts;
  if (components.size() > 1) {
    std::map<int, std::size_t> part_of;
    for (std::size_t n = 0; n < components.size(); ++n)
      for (const int node : components[n].nodes) part_of[node] = n;
    for (const FrameFeatures& frame : frames) {
      const auto part = part_of.find(frame.node);
      parts.push_back(part == part_of.end() ? components.size() : part->second);
    }
  }
  // Consecutive frames are the most similar ones and are candidates already.
  const auto neighbors = static_cast<std::size_t>(options.neighbors);
  const auto wanted = static_cast<std::size_t>(options.similar_candidates);
  const auto similar =
      find_similar_frames(frames, wanted + 2 * neighbors, options.appearance, seed, parts);
  for (std::size_t f = 0; f < similar.size(); ++f) {
    std::size_t taken = 0;
    std::size_t taken_elsewhere = 0;
    for (const SimilarFrame& other : similar[f]) {
      const std::size_t apart = other.frame > f ? other.frame - f : f - other.frame;
      if (apart <= neighbors) continue;
      const bool elsewhere = !parts.empty() && parts[other.frame] != parts[f];
      if (taken < wanted || (elsewhere && taken_elsewhere < wanted))
        pairs.insert(ordered(f, other.frame));
      ++taken;
      taken_elsewhere += elsewhere ? 1 : 0;
    }
  }
  return pairs;
}

std::set<FramePair> near_pairs(const std::vector<FrameFeatures>& frames,
                               const std::map<int, Pose>& map_from_base,
                               const std::vector<GraphComponent>& components,
                               const LoopClosureDetectionOptions& options) {
  std::set<FramePair> pairs;
  if (!(options.radius_m > 0.0) || !(options.angle_deg > 0.0)) return pairs;
  std::map<int, std::size_t> frame_of;
  for (std::size_t f = 0; f < frames.size(); ++f) frame_of[frames[f].node] = f;
  std::vector<const Pose*> poses(frames.size(), nullptr);
  for (const GraphComponent& component : components) {
    std::vector<std::size_t> members;
    for (const int node : component.nodes) {
      const auto frame = frame_of.find(node);
      const auto pose = map_from_base.find(node);
      if (frame == frame_of.end() || pose == map_from_base.end()) continue;
      members.push_back(frame->second);
      poses[frame->second] = &pose->second;
    }
    if (members.size() > 1) add_near_pairs(members, poses, options, pairs);
  }
  return pairs;
}

void check_against_graph(std::vector<FeatureLink>& links, const PoseGraphResult& graph,
                         const LoopClosureDetectionOptions& options, RejectionCounts& counts) {
  std::vector<std::pair<int, int>> pairs;
  pairs.reserve(links.size());
  for (const FeatureLink& link : links) pairs.emplace_back(link.link.from, link.link.to);
  const GraphCovariance covariance(graph, pairs);
  const Matrix6d slack = slack_of(options);
  std::vector<FeatureLink> kept;
  for (std::size_t n = 0; n < links.size(); ++n) {
    const PoseLink& link = links[n].link;
    bool good = false;
    if (covariance.valid() && covariance.connected(link.from, link.to)) {
      const Vector6d error =
          step_between(link.from_from_to, graph.map_from_base.at(link.from).inverse() *
                                              graph.map_from_base.at(link.to));
      const Matrix6d expected =
          covariance.of_relative(link.from, link.to) + link.information.inverse() + slack;
      good = error.dot(expected.llt().solve(error)) <= options.max_graph_chi_square;
      counts.against_graph += good ? 0 : 1;
    } else {
      for (std::size_t m = 0; m < links.size() && !good; ++m)
        good =
            m != n &&
            !(covariance.valid() && covariance.connected(links[m].link.from, links[m].link.to)) &&
            agree(links[n], links[m], graph);
      counts.unconfirmed += good ? 0 : 1;
    }
    if (good)
      kept.push_back(links[n]);
    else
      --counts.accepted;
  }
  links = std::move(kept);
}

}  // namespace libmap
