#include "libmap/fusion/registration_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/fusion/tile_mask.h"
#include "libmap/fusion/view_pairs.h"

namespace libmap {

namespace {

constexpr std::size_t max_anchors = 24;
constexpr std::size_t partners = 3;
constexpr double min_common_reach = 0.3;  // overlap of two boxes by the smaller box
constexpr float gate = 0.05F;             // maximum relative depth difference for comparing colors
constexpr double cost_scale = 9.0;        // a cost is log(1 + chi-square / 9)
constexpr double clear_deviations = 2.0;
constexpr double clear_fraction = 0.005;

// A frame with the other frames that it is compared with.
struct Anchor {
  std::size_t frame = 0;
  std::vector<std::size_t> others;
};

std::vector<Anchor> find_anchors(std::span<const FusionFrame> frames) {
  std::vector<Anchor> found;
  const std::size_t anchors = std::min(max_anchors, frames.size());
  for (std::size_t n = 0; n < anchors; ++n) {
    const std::size_t a = n * frames.size() / anchors;
    std::vector<std::size_t> others;
    for (std::size_t b = 0; b < frames.size(); ++b) {
      const Eigen::AlignedBox3d common = frames[a].reach.intersection(frames[b].reach);
      if (b != a && !common.isEmpty() &&
          common.volume() >
              min_common_reach * std::min(frames[a].reach.volume(), frames[b].reach.volume()))
        others.push_back(b);
    }
    RandomStream random(n, a);
    Anchor& anchor = found.emplace_back(Anchor{a, {}});
    for (std::size_t k = 0; k < partners && !others.empty(); ++k) {
      const auto chosen = others.begin() + static_cast<std::ptrdiff_t>(random.below(others.size()));
      anchor.others.push_back(*chosen);
      others.erase(chosen);
    }
  }
  return found;
}

struct PairSums {
  double count = 0.0;
  double before = 0.0;
  double after = 0.0;
};

// Adds the costs of all entries that both vectors have.
template <typename Cost>
void add(const std::vector<float>& before, const std::vector<float>& after, const Cost& cost,
         PairSums& sums) {
  for (std::size_t n = 0; n < before.size(); ++n) {
    if (!std::isfinite(before[n]) || !std::isfinite(after[n])) continue;
    sums.count += 1.0;
    sums.before += cost(before[n]);
    sums.after += cost(after[n]);
  }
}

PairCosts costs_of(const std::vector<PairSums>& pairs) {
  PairSums all;
  for (const PairSums& pair : pairs) {
    all.count += pair.count;
    all.before += pair.before;
    all.after += pair.after;
  }
  PairCosts costs;
  costs.count = static_cast<std::size_t>(all.count);
  if (!(all.count > 0.0)) return costs;
  costs.before = all.before / all.count;
  costs.after = all.after / all.count;
  double squares = 0.0;
  for (const PairSums& pair : pairs) {
    const double off = pair.after - pair.before - pair.count * (costs.after - costs.before);
    squares += off * off;
  }
  costs.deviation = std::sqrt(squares) / all.count;
  return costs;
}

// Removes the depth of all samples of `from` outside held-out squares.
void keep_held_out(const RefinementView& from, double voxel_size_m, ViewComparison& compared) {
  const Pose grid_from_camera = from.camera_from_grid.inverse();
  for (std::size_t n = 0; n < compared.depth.size(); ++n) {
    const Eigen::Vector3d position = grid_from_camera * compared.points[n].cast<double>();
    if (!TileMask::is_held_out((position.head<2>() / voxel_size_m).cast<float>()))
      compared.depth[n] = std::numeric_limits<float>::quiet_NaN();
  }
}

}  // namespace

bool PairCosts::is_clearly_worse() const {
  return after - before > std::max(clear_deviations * deviation, clear_fraction * before);
}

bool PairCosts::is_clearly_better() const {
  return before - after > std::max(clear_deviations * deviation, clear_fraction * before);
}

bool RegistrationCheck::is_accepted(bool refined_poses) const {
  if (depth.is_clearly_worse() || color.is_clearly_worse()) return false;
  if (refined_poses) return color.is_clearly_better();
  const auto gain = [](const PairCosts& kind) {
    return kind.deviation > 0.0 ? (kind.before - kind.after) / kind.deviation
                                : kind.before - kind.after;
  };
  return gain(depth) + gain(color) > 0.0;
}

RegistrationCheck check_registration(FusionFrames& images, std::span<const FusionFrame> before,
                                     std::span<const FusionFrame> after, const DepthSensor& sensor,
                                     double voxel_size_m) {
  const std::vector<Anchor> anchors = find_anchors(before);
  std::vector<PairSums> depth(anchors.size() * partners);
  std::vector<PairSums> color(anchors.size() * partners);
  const double noise = sensor.noise.axial_at(1.0);
  const auto depth_cost = [&](float off) {
    return std::log1p(off * off / (2.0 * noise * noise) / cost_scale);
  };
  const auto color_cost = [](float off) { return static_cast<double>(off); };
  parallel_each(anchors.size(), [&](std::size_t n) {
    const std::size_t a = anchors[n].frame;
    const RefinementView first = images.views_of(before[a], 0, true).front();
    for (std::size_t k = 0; k < anchors[n].others.size(); ++k) {
      const std::size_t b = anchors[n].others[k];
      const RefinementView second = images.views_of(before[b], 1, true).front();
      const Pose given = second.camera_from_grid * first.camera_from_grid.inverse();
      const Pose moved = second.camera_from_grid * before[b].grid_from_base *
                         after[b].grid_from_base.inverse() * after[a].grid_from_base *
                         before[a].grid_from_base.inverse() * first.camera_from_grid.inverse();
      for (const bool back : {false, true}) {
        const RefinementView& from = back ? second : first;
        const RefinementView& onto = back ? first : second;
        ViewComparison one = compare_views(from, onto, back ? given.inverse() : given, gate);
        const ViewComparison two = compare_views(from, onto, back ? moved.inverse() : moved, gate);
        keep_held_out(from, voxel_size_m, one);
        add(one.depth, two.depth, depth_cost, depth[n * partners + k]);
        add(one.color, two.color, color_cost, color[n * partners + k]);
      }
    }
  });
  return {costs_of(depth), costs_of(color)};
}

}  // namespace libmap
