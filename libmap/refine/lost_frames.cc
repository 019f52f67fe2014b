#include "libmap/refine/visual_odometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/icp_refinement.h"

namespace libmap {

namespace {

constexpr std::size_t no_frame = static_cast<std::size_t>(-1);
constexpr std::size_t backward = static_cast<std::size_t>(-1);  // steps along the list of frames
constexpr std::size_t forward = 1;
constexpr std::size_t most_lost = 4;          // maximum number of frames in a lost part
constexpr std::size_t farthest_neighbor = 4;  // maximum distance in frames
constexpr double most_steps_on = 1.0;
constexpr double sides_agree_m = 0.02;  // maximum difference of the alignments with both sides
constexpr double sides_agree_rad = 2.0 * std::numbers::pi / 180.0;

class LostFrames {
 public:
  LostFrames(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
             const LoopClosureDetectionOptions& matching, std::uint64_t seed,
             VisualOdometryResult& result)
      : frames_(frames), start_(start), matching_(matching), seed_(seed), result_(result) {
    for (std::size_t part = 0; part < result.parts.size(); ++part)
      for (const int node : result.parts[part]) part_of_[node] = part;
  }

  // Repeats until no more frames are placed.
  void run() {
    for (bool found = true; found;) {
      found = false;
      for (std::size_t f = 0; f < frames_.size(); ++f)
        if (is_lost(f) && place(f)) found = true;
    }
    std::erase_if(result_.parts, [](const std::vector<int>& part) { return part.empty(); });
    for (std::vector<int>& part : result_.parts) std::sort(part.begin(), part.end());
  }

 private:
  int node(std::size_t frame) const { return frames_[frame].node; }
  double stamp_s(std::size_t frame) const { return frames_[frame].stamp_s; }
  std::size_t part(std::size_t frame) const { return part_of_.at(node(frame)); }
  Pose& pose(std::size_t frame) { return result_.map_from_base.at(node(frame)); }
  bool is_lost(std::size_t frame) const {
    const std::vector<int>& nodes = result_.parts[part(frame)];
    return nodes.size() <= most_lost && std::none_of(nodes.begin(), nodes.end(), [&](int node) {
             return start_.map_from_base.contains(node);
           });
  }
  int session(std::size_t frame) const { return start_.session_of(node(frame)); }

  // Returns the nearest frame in this direction that is not lost; no_frame if there is none.
  std::size_t neighbor(std::size_t frame, std::size_t step) const {
    if (frame == no_frame) return no_frame;
    for (std::size_t n = 0, other = frame + step; n < farthest_neighbor; ++n, other += step) {
      if (other >= frames_.size() || session(other) != session(frame)) break;
      if (!is_lost(other)) return other;
    }
    return no_frame;
  }

  // Returns the pose by constant motion from a to b: interpolated, or extrapolated beyond b.
  std::optional<Pose> along(std::size_t a, std::size_t b, std::size_t frame) {
    if (a == no_frame || b == no_frame || part(a) != part(b) || stamp_s(a) == stamp_s(b))
      return std::nullopt;
    const Vector6d step = step_between(pose(a), pose(b));
    const double fraction = (stamp_s(frame) - stamp_s(a)) / (stamp_s(b) - stamp_s(a));
    if (fraction <= 1.0) return moved(pose(a), std::max(0.0, fraction) * step);
    return moved(pose(b), std::min(most_steps_on, fraction - 1.0) * step);
  }

  bool place(std::size_t frame) {
    const std::size_t before = neighbor(frame, backward);
    const std::size_t after = neighbor(frame, forward);
    if (!tried_.insert({frame, before, after}).second) return false;
    const std::optional<Pose> inside = along(before, after, frame);
    std::vector<PoseLink> links;
    std::vector<Pose> candidates;
    for (const std::size_t other : {before, after}) {
      if (other == no_frame || (!links.empty() && part(other) != part(before))) continue;
      const auto link = align(
          frame, other,
          inside ? inside
                 : along(neighbor(other, other == before ? backward : forward), other, frame));
      if (!link) continue;
      links.push_back(*link);
      candidates.push_back(pose(other) * link->from_from_to);
    }
    if (links.empty()) return false;
    if (!is_near(candidates.front(), candidates.back(), sides_agree_m, sides_agree_rad))
      return false;
    move_part(frame, links.front().from, candidates.front());
    result_.depth_links.insert(result_.depth_links.end(), links.begin(), links.end());
    return true;
  }

  // Aligns the frame with `other`, beginning at `guess`, else at the motion from a few matches.
  std::optional<PoseLink> align(std::size_t frame, std::size_t other,
                                const std::optional<Pose>& guess) {
    std::optional<PoseLink> link;
    if (guess) link = align_pair(frames_[other], frames_[frame], pose(other).inverse() * *guess);
    if (link) return link;
    if (auto few = guess_motion(frames_, std::minmax(other, frame), matching_, seed_))
      link = align_pair(frames_[other], frames_[frame], other < frame ? *few : few->inverse());
    return link;
  }

  // Joins the frame's part to the part of the node `at`, moved so that the frame is at `target`.
  void move_part(std::size_t frame, int at, const Pose& target) {
    const Pose move = target * pose(frame).inverse();
    const std::vector<int> nodes = std::exchange(result_.parts[part(frame)], {});
    std::vector<int>& joined = result_.parts[part_of_.at(at)];
    joined.insert(joined.end(), nodes.begin(), nodes.end());
    for (const int moved_node : nodes) {
      part_of_[moved_node] = part_of_.at(at);
      Pose& of_node = result_.map_from_base.at(moved_node);
      of_node = move * of_node;
    }
    for (TrackingLoss& loss : result_.losses)
      if (loss.relocalized_node == 0 &&
          std::find(nodes.begin(), nodes.end(), loss.node) != nodes.end()) {
        loss.relocalized_node = node(frame);
        loss.relocalized_at = at;
      }
  }

  const std::vector<FrameFeatures>& frames_;
  const TrackingStart& start_;
  const LoopClosureDetectionOptions& matching_;
  std::uint64_t seed_;
  VisualOdometryResult& result_;
  std::map<int, std::size_t> part_of_;
  std::set<std::array<std::size_t, 3>> tried_;  // a frame with its neighbors
};

}  // namespace

void place_lost_frames(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
                       const LoopClosureDetectionOptions& matching, std::uint64_t seed,
                       VisualOdometryResult& result) {
  LostFrames(frames, start, matching, seed, result).run();
}

}  // namespace libmap
