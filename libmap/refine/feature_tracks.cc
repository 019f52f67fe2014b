#include "libmap/refine/feature_tracks.h"

#include <algorithm>
#include <compare>
#include <cstdint>
#include <numeric>
#include <set>
#include <utility>

#include "libmap/geometry/disjoint_sets.h"

namespace libmap {

namespace {

// Features of all frames as one row of numbers, joined into sets; the members of a set are a ring.
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

  // A conflict if the two sets hold different features of one frame.
  Join join(const Observation& a, const Observation& b, const std::set<FramePair>* linked) {
    const std::uint32_t one = sets_.find(number_of(a));
    const std::uint32_t other = sets_.find(number_of(b));
    if (one == other) return Join::joined;
    Join result = Join::joined;
    for (const std::uint32_t member : members(other))
      for (const std::uint32_t its : members(one)) {
        const std::size_t frame = frame_of_[member];
        const std::size_t its_frame = frame_of_[its];
        if (frame == its_frame) return Join::conflict;
        if (linked != nullptr && !linked->contains(std::minmax(frame, its_frame)))
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

struct RankedMatch {
  double chi_square = 0.0;
  std::uint32_t link = 0;
  std::uint32_t match = 0;
  auto operator<=>(const RankedMatch&) const = default;
};

}  // namespace

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
