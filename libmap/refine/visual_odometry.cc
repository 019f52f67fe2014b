#include "libmap/refine/visual_odometry.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/features/place_recognition.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/icp_refinement.h"

namespace libmap {

namespace {

constexpr std::size_t none = static_cast<std::size_t>(-1);
constexpr std::size_t longest_gap = 4;      // maximum gap in frames that one match may bridge
constexpr std::size_t longest_run = 16;     // maximum number of pairs verified at once
constexpr double motion_agreement_m = 0.1;  // between two motions to one frame
constexpr double motion_agreement_rad = 5.0 * std::numbers::pi / 180.0;
constexpr double max_extrapolation = 2.0;  // in lengths of the last motion
constexpr double min_factor = 1e-3;        // minimum variance factor, for data without noise

struct Trial {
  RejectionCounts counts{};
  std::optional<FeatureLink> link{};
};

std::string reason_of(const RejectionCounts& counts) {
  if (counts.too_few_matches > 0) return "too few matches";
  if (counts.too_few_inliers > 0) return "too few matches agree on a motion";
  if (counts.degenerate > 0) return "matches cover too little of the image";
  return "motion did not converge";
}

// Scales the link's covariance by the variance factor of its matches: chi-square per freedom.
void calibrate(const FrameFeatures& a, const FrameFeatures& b, FeatureLink& link) {
  double squares = 0.0;
  for (const FeatureMatch& match : link.matches)
    squares += match_residual(a, b, match, link.link.from_from_to).chi_square();
  const double freedom = 3.0 * static_cast<double>(link.matches.size()) - 6.0;
  const double factor = std::max(min_factor, squares / freedom);
  // The estimate was already divided by this factor.
  link.link.information *= std::max(1.0, link.chi_square_per_freedom) / factor;
}

// A relocalization candidate: a lost frame matched with an earlier one.
struct RelocalizationCandidate {
  std::size_t frame = none;  // the earlier frame
  Pose map_from_base;        // pose of the lost frame in the earlier frame's part
  std::size_t inliers = 0;
};

class Tracker {
 public:
  Tracker(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
          const LoopClosureDetectionOptions& matching, const VisualOdometryOptions& options,
          std::uint64_t seed)
      : frames_(frames),
        start_(start),
        matching_(matching),
        options_(options),
        seed_(seed),
        pose_(frames.size(), Pose::Identity()),
        part_(frames.size(), none),
        known_(frames.size(), false) {}

  VisualOdometryResult run(Progress& progress);

 private:
  void take_known();
  bool is_usable(std::size_t frame) const {
    return frames_[frame].features.size() >=
           static_cast<std::size_t>(std::max(6, matching_.estimate.min_inliers));
  }
  int session_of(std::size_t frame) const { return start_.session_of(frames_[frame].node); }
  bool is_fixed(std::size_t part) const { return fixed_.contains(part); }

  void verify(const std::vector<FramePair>& pairs);
  const Trial& trial(std::size_t a, std::size_t b);
  const Trial& prefetch_trial(std::size_t key, std::size_t frame);
  Pose pose_by(std::size_t frame, std::size_t other, const FeatureLink& link) const;

  void begin_part(std::size_t frame);
  void pass_known(std::size_t frame);
  bool track(std::size_t frame);
  bool track_by_depth(std::size_t frame);
  void place(std::size_t frame, std::size_t reference, const FeatureLink& link);
  void make_key(std::size_t frame);
  bool relocalize(std::size_t frame);
  std::vector<std::size_t> candidates_of(std::size_t frame);
  void add_link(FeatureLink link, LinkType type);
  bool move_part(std::size_t from, std::size_t onto, const Pose& onto_from_from);
  void lose(std::size_t frame, std::size_t reference, std::string reason);
  void find_lost(std::size_t part, std::size_t frame, std::size_t at);
  VisualOdometryResult finish();

  const std::vector<FrameFeatures>& frames_;
  const TrackingStart& start_;
  const LoopClosureDetectionOptions& matching_;
  const VisualOdometryOptions& options_;
  const std::uint64_t seed_;
  std::vector<Pose> pose_;
  std::vector<std::size_t> part_;
  std::vector<bool> known_;
  std::map<int, std::size_t> known_part_;            // by node, also for nodes without a frame
  std::set<std::size_t> fixed_;                      // parts with known poses
  std::set<std::size_t> separate_parts_;             // parts without a known relation to others
  std::map<std::size_t, std::size_t> loss_of_part_;  // index of the loss that began a part
  std::size_t parts_ = 0;
  std::map<FramePair, Trial> trials_;
  std::vector<std::vector<SimilarFrame>> similar_;
  std::size_t key_ = none;      // key frame
  std::size_t last_ = none;     // last tracked frame
  std::size_t before_ = none;   // frame tracked before last_
  std::size_t earlier_ = none;  // last frame before the tracking loss
  std::size_t key_run_ = 0;     // number of consecutive key frames
  VisualOdometryResult result_;
};

void Tracker::take_known() {
  for (const std::vector<int>& nodes : start_.parts) {
    for (const int node : nodes) known_part_[node] = parts_;
    fixed_.insert(parts_++);
  }
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    const auto part = known_part_.find(frames_[f].node);
    if (part == known_part_.end()) continue;
    known_[f] = true;
    pose_[f] = start_.map_from_base.at(frames_[f].node);
    part_[f] = part->second;
  }
}

void Tracker::verify(const std::vector<FramePair>& pairs) {
  std::vector<FramePair> fresh;
  for (const FramePair& pair : pairs)
    if (!trials_.contains(pair)) fresh.push_back(pair);
  std::vector<Trial> trials(fresh.size());
  parallel_for(fresh.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      PairVerification verified = verify_pairs(frames_, {fresh[n]}, matching_, seed_);
      trials[n].counts = verified.counts;
      if (!verified.links.empty()) trials[n].link = std::move(verified.links.front());
    }
  });
  for (std::size_t n = 0; n < fresh.size(); ++n) trials_.emplace(fresh[n], std::move(trials[n]));
}

const Trial& Tracker::trial(std::size_t a, std::size_t b) {
  const FramePair pair = std::minmax(a, b);
  verify({pair});
  return trials_.at(pair);
}

// Also computes the pairs that are probably needed next, so that all threads have work. Runs of key
// frames, or of frames tracked against one key frame, are assumed to double in length.
const Trial& Tracker::prefetch_trial(std::size_t key, std::size_t frame) {
  if (const auto known = trials_.find({key, frame}); known != trials_.end()) return known->second;
  const bool fresh_key = key + 1 == frame;
  const std::size_t run = std::min(longest_run, fresh_key ? 1 + key_run_ : frame - key);
  std::vector<FramePair> pairs;
  for (std::size_t n = 0; n < run && frame + n < frames_.size(); ++n) {
    if (n > 0 && (!is_usable(frame + n) || known_[frame + n])) break;
    pairs.emplace_back(fresh_key ? key + n : key, frame + n);
  }
  verify(pairs);
  return trials_.at({key, frame});
}

Pose Tracker::pose_by(std::size_t frame, std::size_t other, const FeatureLink& link) const {
  return frame > other ? Pose(pose_[other] * link.link.from_from_to)
                       : Pose(pose_[other] * link.link.from_from_to.inverse());
}

void Tracker::add_link(FeatureLink link, LinkType type) {
  link.link.type = type;
  calibrate(frames_[link.frames.first], frames_[link.frames.second], link);
  result_.links.push_back(std::move(link));
}

void Tracker::make_key(std::size_t frame) {
  key_run_ = key_ != none && key_ + 1 == frame ? key_run_ + 1 : 0;
  key_ = frame;
  result_.key_frames.push_back(frames_[frame].node);
}

void Tracker::begin_part(std::size_t frame) {
  const auto first = start_.first.find(frames_[frame].node);
  pose_[frame] = first != start_.first.end() ? first->second : Pose::Identity();
  part_[frame] = parts_++;
  if (is_usable(frame) && last_ != none) separate_parts_.insert(part_[frame]);
}

// Moves a part into the frame of another; returns false if both have known poses.
bool Tracker::move_part(std::size_t from, std::size_t onto, const Pose& onto_from_from) {
  Pose move = onto_from_from;
  if (is_fixed(from)) {
    if (is_fixed(onto)) return false;
    std::swap(from, onto);
    move = onto_from_from.inverse();
  }
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    if (part_[f] != from) continue;
    pose_[f] = move * pose_[f];
    part_[f] = onto;
  }
  return true;
}

// Passes a frame with a known pose; frames before it may be another part.
void Tracker::pass_known(std::size_t frame) {
  if (!is_usable(frame)) return;
  if (last_ != none && !is_fixed(part_[last_]) && session_of(last_) == session_of(frame) &&
      frame - last_ <= longest_gap) {
    const Trial& met = trial(last_, frame);
    if (met.link && move_part(part_[last_], part_[frame],
                              pose_[frame] * pose_by(frame, last_, *met.link).inverse()))
      add_link(*met.link, LinkType::neighbor);
  }
  key_ = last_ = frame;
  earlier_ = none;
}

void Tracker::place(std::size_t frame, std::size_t reference, const FeatureLink& link) {
  pose_[frame] = pose_by(frame, reference, link);
  part_[frame] = part_[reference];
  before_ = last_;
  last_ = frame;
  add_link(link, LinkType::neighbor);
  if (reference != key_) make_key(reference);
  const Vector6d way = step_between(pose_[key_], pose_[frame]);
  const double angle_deg = way.tail<3>().norm() * 180.0 / std::numbers::pi;
  if (link.matches.size() < static_cast<std::size_t>(options_.keyframe_inliers) ||
      way.head<3>().norm() > options_.keyframe_distance_m ||
      angle_deg > options_.keyframe_angle_deg)
    make_key(frame);
}

bool Tracker::track(std::size_t frame) {
  for (const std::size_t reference : {key_, last_, earlier_}) {
    if (reference == none) continue;
    // The gap counts from the last tracked frame, not from the key frame.
    if (frame - (reference == earlier_ ? earlier_ : last_) > longest_gap) continue;
    const Trial& tried_pairs =
        reference == key_ ? prefetch_trial(key_, frame) : trial(reference, frame);
    if (!tried_pairs.link) continue;
    if (reference == earlier_) earlier_ = none;
    place(frame, reference, *tried_pairs.link);
    return true;
  }
  return false;
}

// Tracks by depth, because motion blur reduces features but not depth.
bool Tracker::track_by_depth(std::size_t frame) {
  if (last_ == none || frame - last_ > longest_gap || session_of(last_) != session_of(frame))
    return false;
  Pose guess = Pose::Identity();
  const double before_s = before_ == none ? 0.0 : frames_[last_].stamp_s - frames_[before_].stamp_s;
  if (before_s > 0.0 && last_ - before_ <= longest_gap && part_[before_] == part_[last_]) {
    const double later_s = frames_[frame].stamp_s - frames_[last_].stamp_s;
    const double steps = std::clamp(later_s / before_s, 0.0, max_extrapolation);
    guess = moved(guess,
                  steps * step_between(Pose::Identity(), pose_[before_].inverse() * pose_[last_]));
  }
  std::optional<PoseLink> link = align_pair(frames_[last_], frames_[frame], guess);
  if (!link && is_usable(last_) && is_usable(frame))
    if (const auto few = guess_motion(frames_, {last_, frame}, matching_, seed_))
      link = align_pair(frames_[last_], frames_[frame], *few);
  if (!link) return false;
  pose_[frame] = pose_[last_] * link->from_from_to;
  part_[frame] = part_[last_];
  before_ = std::exchange(last_, frame);
  result_.depth_links.push_back(*link);
  return true;
}

std::vector<std::size_t> Tracker::candidates_of(std::size_t frame) {
  const auto wanted = static_cast<std::size_t>(options_.relocalization_candidates);
  if (wanted == 0) return {};
  if (similar_.empty())
    similar_ = find_similar_frames(frames_, 4 * wanted, matching_.appearance, seed_);
  std::vector<std::size_t> candidates;
  const auto add = [&](std::size_t other) {
    if (other == none || other == frame || part_[other] == none || part_[other] == part_[frame] ||
        !is_usable(other) ||
        std::find(candidates.begin(), candidates.end(), other) != candidates.end())
      return;
    candidates.push_back(other);
  };
  for (const SimilarFrame& other : similar_[frame])
    if (candidates.size() < wanted) add(other.frame);
  // Frames around the tracking loss are candidates even if they are not similar.
  for (const std::size_t before : {key_, last_, earlier_})
    for (std::size_t back = 0; back < 3; ++back)
      if (before != none && before >= back) add(before - back);
  return candidates;
}

// Moves the frame and its part to the pose that two earlier frames of another part agree on.
// Returns false if no two agree.
bool Tracker::relocalize(std::size_t frame) {
  std::vector<FramePair> pairs;
  const std::vector<std::size_t> candidates = candidates_of(frame);
  pairs.reserve(candidates.size());
  for (const std::size_t other : candidates) pairs.push_back(std::minmax(frame, other));
  verify(pairs);
  std::vector<RelocalizationCandidate> sightings;
  for (const std::size_t other : candidates) {
    const Trial& seen = trials_.at(std::minmax(frame, other));
    if (seen.link)
      sightings.push_back({other, pose_by(frame, other, *seen.link), seen.link->matches.size()});
  }
  const auto agree = [&](const RelocalizationCandidate& a, const RelocalizationCandidate& b) {
    return part_[a.frame] == part_[b.frame] &&
           is_near(a.map_from_base, b.map_from_base, motion_agreement_m, motion_agreement_rad);
  };
  const RelocalizationCandidate* best = nullptr;
  std::pair<std::size_t, std::size_t> most{1, 0};  // agreeing sightings, inliers
  for (const RelocalizationCandidate& sighting : sightings) {
    const auto votes = static_cast<std::size_t>(std::count_if(
        sightings.begin(), sightings.end(),
        [&](const RelocalizationCandidate& other) { return agree(sighting, other); }));
    if (votes < 2 || std::pair(votes, sighting.inliers) <= most) continue;
    most = {votes, sighting.inliers};
    best = &sighting;
  }
  if (best == nullptr) return false;
  const std::size_t own = part_[frame];
  const std::size_t onto = part_[best->frame];
  std::vector<std::size_t> witnesses;
  for (const RelocalizationCandidate& sighting : sightings)
    if (agree(*best, sighting)) witnesses.push_back(sighting.frame);
  if (part_[frame] == none) {
    pose_[frame] = best->map_from_base;
    part_[frame] = onto;
  } else if (!move_part(part_[frame], onto, best->map_from_base * pose_[frame].inverse())) {
    return false;
  }
  for (const std::size_t witness : witnesses)
    add_link(*trials_.at(std::minmax(frame, witness)).link, LinkType::local_space_closure);
  ++result_.relocalized;
  earlier_ = none;
  find_lost(own, frame, best->frame);
  return true;
}

void Tracker::lose(std::size_t frame, std::size_t reference, std::string reason) {
  result_.losses.push_back(
      {frames_[frame].node, reference == none ? 0 : frames_[reference].node, std::move(reason)});
}

// Marks the loss that began the part as found again.
void Tracker::find_lost(std::size_t part, std::size_t frame, std::size_t at) {
  const auto loss = loss_of_part_.find(part);
  if (loss == loss_of_part_.end()) return;
  result_.losses[loss->second].relocalized_node = frames_[frame].node;
  result_.losses[loss->second].relocalized_at = frames_[at].node;
}

VisualOdometryResult Tracker::finish() {
  std::map<std::size_t, std::vector<int>> parts;
  result_.map_from_base = start_.map_from_base;
  for (const auto& [node, part] : known_part_) parts[part].push_back(node);
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    if (known_[f]) continue;
    result_.map_from_base[frames_[f].node] = pose_[f];
    parts[part_[f]].push_back(frames_[f].node);
  }
  for (auto& [part, nodes] : parts) {
    std::sort(nodes.begin(), nodes.end());
    result_.parts.push_back(std::move(nodes));
  }
  std::sort(result_.key_frames.begin(), result_.key_frames.end());
  result_.key_frames.erase(std::unique(result_.key_frames.begin(), result_.key_frames.end()),
                           result_.key_frames.end());
  std::set<FramePair> linked;
  for (const FeatureLink& link : result_.links) linked.insert(link.frames);
  // Unconfirmed motions may be confirmed later and are not in `tried_pairs`.
  for (const auto& [pair, tried_pairs] : trials_)
    if (!tried_pairs.link || linked.contains(pair)) result_.tried_pairs.insert(pair);
  return std::move(result_);
}

VisualOdometryResult Tracker::run(Progress& progress) {
  take_known();
  progress.begin("odometry", frames_.size());
  for (std::size_t f = 0; f < frames_.size(); ++f, progress.advance(1)) {
    if (known_[f]) {
      pass_known(f);
      continue;
    }
    if (!is_usable(f)) {
      if (track_by_depth(f)) continue;
      lose(f, none, "only " + std::to_string(frames_[f].features.size()) + " features with depth");
      begin_part(f);
      continue;
    }
    const bool begins = key_ == none || session_of(key_) != session_of(f);
    if (!begins && track(f)) {
      // A separate part tries to relocalize at each key frame.
      if (key_ == f && separate_parts_.contains(part_[f])) relocalize(f);
      continue;
    }
    if (!begins && track_by_depth(f)) continue;
    if (!begins) {
      loss_of_part_[none] = result_.losses.size();  // until the frame is in a part
      lose(f, key_,
           f - last_ > longest_gap ? "no earlier tracked frame" : reason_of(trial(key_, f).counts));
    }
    if (!relocalize(f)) {
      if (earlier_ == none && !begins) earlier_ = last_;
      begin_part(f);
      if (!begins) loss_of_part_[part_[f]] = loss_of_part_.at(none);
    }
    loss_of_part_.erase(none);
    make_key(f);
    last_ = f;
  }
  progress.end();
  return finish();
}

}  // namespace

void bind(ParameterTable& table, VisualOdometryOptions& options) {
  table.add("keyframe_inliers", options.keyframe_inliers, not_negative,
            "visual odometry: number of matches with the key frame below which a frame becomes the "
            "next key frame");
  table.add("keyframe_distance_m", options.keyframe_distance_m, positive,
            "visual odometry: distance from the key frame above which a frame becomes the next key "
            "frame, m");
  table.add("keyframe_angle_deg", options.keyframe_angle_deg, positive,
            "visual odometry: rotation from the key frame above which a frame becomes the next key "
            "frame, degrees");
  table.add("relocalization_candidates", options.relocalization_candidates, not_negative,
            "visual odometry: number of similar earlier frames with which a lost frame is "
            "compared; 0: lost frames are not relocalized");
}

VisualOdometryResult track_frames(const std::vector<FrameFeatures>& frames,
                                  const TrackingStart& start,
                                  const LoopClosureDetectionOptions& matching,
                                  const VisualOdometryOptions& options, std::uint64_t seed,
                                  Progress& progress) {
  check_parameters(options);
  VisualOdometryResult result = Tracker(frames, start, matching, options, seed).run(progress);
  place_lost_frames(frames, start, matching, seed, result);
  return result;
}

LinkConsistency link_consistency(const std::vector<FeatureLink>& links, const Trajectory& truth) {
  std::map<int, Pose> poses;
  for (const TrajectoryPose& pose : truth) poses.emplace(pose.node, pose.world_from_base);
  LinkConsistency result;
  for (const FeatureLink& link : links) {
    const auto a = poses.find(link.link.from);
    const auto b = poses.find(link.link.to);
    if (a == poses.end() || b == poses.end()) continue;
    const Vector6d error = step_between(link.link.from_from_to, a->second.inverse() * b->second);
    result.squared_error_per_freedom += error.dot(link.link.information * error) / 6.0;
    ++result.links;
  }
  if (result.links > 0) result.squared_error_per_freedom /= static_cast<double>(result.links);
  return result;
}

std::string describe(const std::vector<TrackingLoss>& losses) {
  constexpr std::size_t most = 5;
  std::string text;
  for (std::size_t n = 0; n < losses.size() && n < most; ++n) {
    const TrackingLoss& loss = losses[n];
    text +=
        (n > 0 ? "; " : "") + std::string("node ") + std::to_string(loss.node) + ", " + loss.reason;
    if (loss.relocalized_node == loss.node)
      text += ", relocalized at node " + std::to_string(loss.relocalized_at);
    else if (loss.relocalized_node > 0)
      text += ", relocalized by node " + std::to_string(loss.relocalized_node) + " at node " +
              std::to_string(loss.relocalized_at);
  }
  if (losses.size() > most) text += "; and " + std::to_string(losses.size() - most) + " more";
  return text;
}

}  // namespace libmap
