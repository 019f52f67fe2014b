#include "libmap/features/feature_tracks.h"

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <numeric>
#include <set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libmap {

namespace {

// Features of all frames, numbered consecutively, in sets whose members form a ring.
class FeatureSets {
 public:
  explicit FeatureSets(const std::vector<FrameFeatures>& frames) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      begin_.push_back(static_cast<std::uint32_t>(frame_of_.size()));
      frame_of_.insert(frame_of_.end(), frames[f].features.size(), static_cast<std::uint32_t>(f));
    }
    sets_ = DisjointSets<std::uint32_t>(frame_of_.size());
    next_.resize(frame_of_.size());
    std::iota(next_.begin(), next_.end(), std::uint32_t{0});
  }

  enum class Join { joined, conflict, unlinked };

  // Returns conflict if the two sets contain different features of one frame.
  Join join(const Observation& a, const Observation& b, const std::set<FramePair>* linked) {
    const std::uint32_t one = sets_.find(number_of(a));
    const std::uint32_t other = sets_.find(number_of(b));
    if (one == other) return Join::joined;
    Join result = Join::joined;
    for (const std::uint32_t member : members(other))
      for (const std::uint32_t own : members(one)) {
        const std::size_t frame = frame_of_[member];
        const std::size_t own_frame = frame_of_[own];
        if (frame == own_frame) return Join::conflict;
        if (linked != nullptr && !linked->contains(std::minmax(frame, own_frame)))
          result = Join::unlinked;
      }
    if (result != Join::joined) return result;
    sets_.join(one, other);
    std::swap(next_[one], next_[other]);
    return Join::joined;
  }

  std::vector<FeatureTrack> tracks() {
    std::vector<FeatureTrack> result;
    for (std::uint32_t n = 0; n < next_.size(); ++n) {
      if (next_[n] == n || sets_.find(n) != n) continue;
      FeatureTrack track;
      std::vector<std::uint32_t> numbers = members(n);
      std::sort(numbers.begin(), numbers.end());
      for (const std::uint32_t number : numbers)
        track.observations.push_back({frame_of_[number], number - begin_[frame_of_[number]]});
      result.push_back(std::move(track));
    }
    return result;
  }

 private:
  std::uint32_t number_of(const Observation& seen) const {
    return begin_[seen.frame] + seen.feature;
  }
  std::vector<std::uint32_t> members(std::uint32_t first) const {
    std::vector<std::uint32_t> ring = {first};
    for (std::uint32_t n = next_[first]; n != first; n = next_[n]) ring.push_back(n);
    return ring;
  }

  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> frame_of_;
  std::vector<std::uint32_t> next_;
  DisjointSets<std::uint32_t> sets_{0};
};

Observation observation(std::size_t frame, int feature) {
  return {static_cast<std::uint32_t>(frame), static_cast<std::uint32_t>(feature)};
}

constexpr int few_matches = 6;

bool is_held_out(int feature, std::size_t frame, int every) {
  // Features are ordered by strength: selection by index would bias all frames alike.
  return mix_bits(static_cast<std::uint64_t>(frame), static_cast<std::uint64_t>(feature)) %
             static_cast<std::uint64_t>(every) ==
         0;
}

struct Verified {
  RelativePoseOutcome outcome = RelativePoseOutcome::too_few_matches;
  std::optional<FeatureLink> link;
};

Verified verify_pair(const FrameFeatures& a, const FrameFeatures& b, FramePair pair,
                     const std::vector<FeatureMatch>& matches, const MatchingOptions& options,
                     std::uint64_t seed) {
  std::vector<FeatureMatch> used;
  std::vector<FeatureMatch> kept;
  for (const FeatureMatch& match : matches)
    (is_held_out(match.a, pair.first, options.held_out) ? kept : used).push_back(match);
  RelativePose pose = estimate_relative_pose(a, b, used, options.estimate, seed);
  Verified result{pose.outcome, std::nullopt};
  if (pose.outcome != RelativePoseOutcome::found) return result;
  FeatureLink link;
  link.frames = pair;
  link.link = {a.node, b.node, LinkType::local_space_closure, pose.a_from_b, pose.information};
  link.matches = std::move(pose.inliers);
  link.chi_square_per_freedom = pose.chi_square_per_freedom;
  for (const FeatureMatch& match : kept) {
    const MatchResidual residual = match_residual(a, b, match, pose.a_from_b);
    // Wider than for inliers, because these matches evaluate the poses of later stages.
    if (residual.in_front && residual.chi_square() <= 4.0 * options.estimate.max_chi_square)
      link.held_out.push_back(match);
  }
  result.link = std::move(link);
  return result;
}

const std::vector<FeatureMatch>* known_matches(const KnownMatches* known, const FramePair& pair) {
  if (known == nullptr) return nullptr;
  const auto found = known->find(pair);
  return found == known->end() ? nullptr : &found->second;
}

// `counted` is in the order of RelativePoseOutcome.
void count(RelativePoseOutcome outcome, RejectionCounts& counts) {
  constexpr std::array counted = {&RejectionCounts::accepted, &RejectionCounts::too_few_matches,
                                  &RejectionCounts::too_few_inliers, &RejectionCounts::degenerate,
                                  &RejectionCounts::not_converged};
  ++counts.candidates;
  ++(counts.*counted.at(static_cast<std::size_t>(outcome)));
}

struct RankedMatch {
  double chi_square = 0.0;
  std::uint32_t link = 0;
  std::uint32_t match = 0;
  auto operator<=>(const RankedMatch&) const = default;
};

}  // namespace

PairVerification verify_pairs(const std::vector<FrameFeatures>& frames,
                              const std::vector<FramePair>& pairs, const MatchingOptions& options,
                              std::uint64_t seed, Progress& progress, KnownMatches* known) {
  std::vector<Verified> verified(pairs.size());
  std::vector<std::vector<FeatureMatch>> fresh(pairs.size());
  progress.begin("matching", pairs.size());
  parallel_for(pairs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const auto [a, b] = pairs[n];
      const std::uint64_t own = mix_bits(mix_bits(seed, static_cast<std::uint64_t>(frames[a].node)),
                                         static_cast<std::uint64_t>(frames[b].node));
      const std::vector<FeatureMatch>* matches = known_matches(known, pairs[n]);
      if (matches == nullptr) {
        fresh[n] = match_features(descriptor_vectors(frames[a]), descriptor_vectors(frames[b]),
                                  options.max_ratio);
        fresh[n].shrink_to_fit();
        matches = &fresh[n];
      }
      verified[n] = verify_pair(frames[a], frames[b], pairs[n], *matches, options, own);
      if (known == nullptr) fresh[n] = {};
      progress.advance(1);
    }
  });
  progress.end();
  for (std::size_t n = 0; known != nullptr && n < pairs.size(); ++n)
    known->emplace(pairs[n], std::move(fresh[n]));
  PairVerification result;
  for (Verified& pair : verified) {
    count(pair.outcome, result.counts);
    if (pair.link) result.links.push_back(std::move(*pair.link));
  }
  return result;
}

std::optional<Pose> guess_motion(const std::vector<FrameFeatures>& frames, const FramePair& pair,
                                 const MatchingOptions& options, std::uint64_t seed) {
  MatchingOptions few = options;
  few.estimate.min_inliers = few_matches;
  few.estimate.min_inlier_fraction = 0.0;
  few.estimate.min_spread = 0.0;
  const PairVerification verified = verify_pairs(frames, {pair}, few, seed);
  if (verified.links.empty()) return std::nullopt;
  return verified.links.front().link.from_from_to;
}

FeatureTracks build_tracks(const std::vector<FrameFeatures>& frames,
                           const std::vector<FeatureLink>& links, TrackFrames together) {
  std::vector<RankedMatch> order;
  for (std::size_t n = 0; n < links.size(); ++n) {
    const FeatureLink& link = links[n];
    for (std::size_t m = 0; m < link.matches.size(); ++m)
      order.push_back({match_residual(frames[link.frames.first], frames[link.frames.second],
                                      link.matches[m], link.link.from_from_to)
                           .chi_square(),
                       static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(m)});
  }
  std::sort(order.begin(), order.end());
  std::set<FramePair> linked;
  for (const FeatureLink& link : links) linked.insert(link.frames);
  FeatureSets sets(frames);
  FeatureTracks result;
  for (const auto& [chi_square, n, m] : order) {
    const FeatureMatch& match = links[n].matches[m];
    const FeatureSets::Join join = sets.join(observation(links[n].frames.first, match.a),
                                             observation(links[n].frames.second, match.b),
                                             together == TrackFrames::linked ? &linked : nullptr);
    result.conflicts += join == FeatureSets::Join::conflict ? 1 : 0;
    result.split += join == FeatureSets::Join::unlinked ? 1 : 0;
  }
  result.tracks = sets.tracks();
  return result;
}

}  // namespace libmap
