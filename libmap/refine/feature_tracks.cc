#include "libmap/refine/feature_tracks.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

namespace libmap {

namespace {

// Features of all frames as one row of numbers, joined into sets.
class FeatureSets {
 public:
  explicit FeatureSets(const std::vector<FrameFeatures>& frames) {
    std::size_t count = 0;
    for (const FrameFeatures& frame : frames) {
      begin_.push_back(count);
      count += frame.features.size();
    }
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    members_.resize(count);
    for (std::size_t f = 0; f < frames.size(); ++f)
      for (std::size_t n = 0; n < frames[f].features.size(); ++n)
        members_[begin_[f] + n] = {{f, n}};
  }

  enum class Join { joined, conflict, unlinked };

  // A conflict if the two sets hold different features of one frame.
  Join join(const Observation& a, const Observation& b, const std::set<FramePair>* linked) {
    std::size_t one = root(begin_[a.frame] + a.feature);
    std::size_t other = root(begin_[b.frame] + b.feature);
    if (one == other) return Join::joined;
    if (members_[one].size() < members_[other].size()) std::swap(one, other);
    Join result = Join::joined;
    for (const Observation& member : members_[other])
      for (const Observation& its : members_[one]) {
        if (member.frame == its.frame) return Join::conflict;
        if (linked != nullptr && !linked->contains(std::minmax(member.frame, its.frame)))
          result = Join::unlinked;
      }
    if (result != Join::joined) return result;
    parent_[other] = one;
    members_[one].insert(members_[one].end(), members_[other].begin(), members_[other].end());
    members_[other].clear();
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
  std::size_t root(std::size_t n) {
    while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
    return n;
  }

  std::vector<std::size_t> begin_;
  std::vector<std::size_t> parent_;
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
