#include "libmap/refine/feature_tracks.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

#include "libmap/core/disjoint_sets.h"

namespace libmap {

namespace {

// Features of all frames as one row of numbers, joined into sets.
class FeatureSets {
 public:
  explicit FeatureSets(const std::vector<FrameFeatures>& frames) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      begin_.push_back(members_.size());
      for (std::size_t n = 0; n < frames[f].features.size(); ++n) members_.push_back({{f, n}});
    }
    sets_ = DisjointSets<std::size_t>(members_.size());
  }

  enum class Join { joined, conflict, unlinked };

  // A conflict if the two sets hold different features of one frame.
  Join join(const Observation& a, const Observation& b, const std::set<FramePair>* linked) {
    const std::size_t one = sets_.find(begin_[a.frame] + a.feature);
    const std::size_t other = sets_.find(begin_[b.frame] + b.feature);
    if (one == other) return Join::joined;
    Join result = Join::joined;
    for (const Observation& member : members_[other])
      for (const Observation& its : members_[one]) {
        if (member.frame == its.frame) return Join::conflict;
        if (linked != nullptr && !linked->contains(std::minmax(member.frame, its.frame)))
          result = Join::unlinked;
      }
    if (result != Join::joined) return result;
    sets_.join(one, other);
    const std::size_t root = sets_.find(one);
    std::vector<Observation>& joined = members_[root == one ? other : one];
    members_[root].insert(members_[root].end(), joined.begin(), joined.end());
    joined.clear();
    return Join::joined;
  }

  std::vector<FeatureTrack> tracks() {
    std::vector<FeatureTrack> result;
    for (std::vector<Observation>& set : members_) {
      if (set.size() < 2) continue;
      std::sort(set.begin(), set.end(), [](const Observation& a, const Observation& b) {
        return std::tie(a.frame, a.feature) < std::tie(b.frame, b.feature);
      });
      result.push_back({std::move(set)});
    }
    std::sort(result.begin(), result.end(), [](const FeatureTrack& a, const FeatureTrack& b) {
      const Observation& first = a.observations.front();
      const Observation& second = b.observations.front();
      return std::tie(first.frame, first.feature) < std::tie(second.frame, second.feature);
    });
    return result;
  }

 private:
  std::vector<std::size_t> begin_;
  DisjointSets<std::size_t> sets_{0};
  std::vector<std::vector<Observation>> members_;  // at the root of each set
};

}  // namespace

FeatureTracks build_tracks(const std::vector<FrameFeatures>& frames,
                           const std::vector<FeatureLink>& links, TrackFrames together) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> order;  // chi-square, link, match
  for (std::size_t n = 0; n < links.size(); ++n) {
    const FeatureLink& link = links[n];
    for (std::size_t m = 0; m < link.matches.size(); ++m)
      order.emplace_back(match_residual(frames[link.frames.first], frames[link.frames.second],
                                        link.matches[m], link.link.from_from_to)
                             .chi_square(),
                         n, m);
  }
  std::sort(order.begin(), order.end());
  std::set<FramePair> linked;
  for (const FeatureLink& link : links) linked.insert(link.frames);
  FeatureSets sets(frames);
  FeatureTracks result;
  for (const auto& [chi_square, n, m] : order) {
    const FeatureMatch& match = links[n].matches[m];
    const FeatureSets::Join join =
        sets.join({links[n].frames.first, static_cast<std::size_t>(match.a)},
                  {links[n].frames.second, static_cast<std::size_t>(match.b)},
                  together == TrackFrames::linked ? &linked : nullptr);
    result.conflicts += join == FeatureSets::Join::conflict ? 1 : 0;
    result.split += join == FeatureSets::Join::unlinked ? 1 : 0;
  }
  result.tracks = sets.tracks();
  return result;
}

}  // namespace libmap
