#include "libmap/features/held_out.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/features/frame_calibration.h"
#include "libmap/features/surface_samples.h"

namespace libmap {

namespace {

constexpr double scale = 9.0;
constexpr double behind = 1e6;      // chi-square of a match behind the camera
constexpr double min_cosine = 0.8;  // between the normals
constexpr double rounding = 1e-6;
constexpr double clear_rise = 0.005;

double cost_of(double chi_square) { return std::log1p(chi_square / scale); }

const Pose* pose_of(const FrameFeatures& frame, const std::map<int, Pose>& map_from_base) {
  const auto pose = map_from_base.find(frame.node);
  return pose == map_from_base.end() ? nullptr : &pose->second;
}

void add_residuals(const std::vector<PlacedElement>& samples, const FrameFeatures& onto,
                   const Pose* from_pose, const Pose* onto_pose,
                   std::vector<SurfaceResidual>& residuals) {
  for (const PlacedElement& sample : samples) {
    residuals.push_back({.distance_m = std::numeric_limits<double>::quiet_NaN()});
    if (from_pose == nullptr || onto_pose == nullptr) continue;
    const Pose onto_from_from = onto_pose->inverse() * *from_pose;
    const Eigen::Vector3d point = onto_from_from * sample.point;
    PlacedElement plane;
    if (!element_at(onto, point, plane) ||
        plane.normal.dot(onto_from_from.linear() * sample.normal) < min_cosine)
      continue;
    residuals.back() = {plane.normal.dot(point - plane.point),
                        std::hypot(sample.noise_m, plane.noise_m),
                        std::max(sample.range_m, plane.range_m)};
  }
}

double weight_of(const HeldOutEvaluation& evaluation, const HeldOutChange& change) {
  const double matches = static_cast<double>(evaluation.matches.count);
  const double surfaces = surface_weight * static_cast<double>(evaluation.surfaces.count);
  const double all = matches + surfaces;
  return all > 0.0 ? (&change == &evaluation.matches ? matches : surfaces) / all : 0.0;
}

}  // namespace

HeldOutChange compare_held_out(const std::vector<double>& before,
                               const std::vector<double>& after) {
  HeldOutChange change;
  if (before.size() != after.size()) return change;
  double sum_before = 0.0;
  double sum_after = 0.0;
  double squares = 0.0;
  for (std::size_t n = 0; n < before.size(); ++n) {
    if (!std::isfinite(before[n]) || !std::isfinite(after[n])) continue;
    ++change.count;
    sum_before += before[n];
    sum_after += after[n];
    squares += (after[n] - before[n]) * (after[n] - before[n]);
  }
  if (change.count == 0) return change;
  const double count = static_cast<double>(change.count);
  change.before = sum_before / count;
  change.after = sum_after / count;
  const double mean = change.after - change.before;
  change.deviation = std::sqrt(std::max(0.0, squares / count - mean * mean) / count);
  return change;
}

std::vector<double> match_costs(const std::vector<FrameFeatures>& frames,
                                const std::vector<FeatureLink>& links,
                                const std::map<int, Pose>& map_from_base) {
  std::vector<double> costs;
  for (const FeatureLink& link : links) {
    const FrameFeatures& a = frames[link.frames.first];
    const FrameFeatures& b = frames[link.frames.second];
    const Pose* of_a = pose_of(a, map_from_base);
    const Pose* of_b = pose_of(b, map_from_base);
    for (const FeatureMatch& match : link.held_out) {
      costs.push_back(std::numeric_limits<double>::quiet_NaN());
      if (of_a == nullptr || of_b == nullptr) continue;
      if (a.features[match.a].depth_noise_m >= unknown_depth_m ||
          b.features[match.b].depth_noise_m >= unknown_depth_m)
        continue;
      const MatchResidual residual = match_residual(a, b, match, of_a->inverse() * *of_b);
      costs.back() = cost_of(residual.in_front ? residual.chi_square() : behind);
    }
  }
  return costs;
}

std::vector<SurfaceResidual> surface_residuals(const std::vector<FrameFeatures>& frames,
                                               const std::vector<FeatureLink>& links,
                                               const std::map<int, Pose>& map_from_base,
                                               int samples_of_frame) {
  std::vector<std::vector<PlacedElement>> samples(frames.size());
  parallel_for(frames.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      samples[f] = surface_samples(frames[f], samples_of_frame, SampleUse::checks);
  });
  std::vector<std::vector<SurfaceResidual>> of_link(links.size());
  parallel_for(links.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const auto [a, b] = links[n].frames;
      const Pose* of_a = pose_of(frames[a], map_from_base);
      const Pose* of_b = pose_of(frames[b], map_from_base);
      add_residuals(samples[a], frames[b], of_a, of_b, of_link[n]);
      add_residuals(samples[b], frames[a], of_b, of_a, of_link[n]);
    }
  });
  std::vector<SurfaceResidual> residuals;
  for (const auto& some : of_link) residuals.insert(residuals.end(), some.begin(), some.end());
  return residuals;
}

std::vector<double> surface_costs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<FeatureLink>& links,
                                  const std::map<int, Pose>& map_from_base) {
  std::vector<double> costs;
  for (const SurfaceResidual& residual : surface_residuals(frames, links, map_from_base))
    costs.push_back(
        cost_of(residual.distance_m * residual.distance_m / (residual.noise_m * residual.noise_m)));
  return costs;
}

HeldOutCosts held_out_costs(const std::vector<FrameFeatures>& frames,
                            const std::vector<FeatureLink>& links,
                            const std::map<int, Pose>& map_from_base) {
  return {match_costs(frames, links, map_from_base), surface_costs(frames, links, map_from_base)};
}

double HeldOutEvaluation::change() const {
  return weight_of(*this, matches) * (matches.after - matches.before) +
         weight_of(*this, surfaces) * (surfaces.after - surfaces.before);
}

double HeldOutEvaluation::deviation() const {
  return std::hypot(weight_of(*this, matches) * matches.deviation,
                    weight_of(*this, surfaces) * surfaces.deviation);
}

double HeldOutEvaluation::before() const {
  return weight_of(*this, matches) * matches.before + weight_of(*this, surfaces) * surfaces.before;
}

bool HeldOutEvaluation::is_worse() const {
  const auto is_clearly_worse = [](const HeldOutChange& kind) {
    const double rise = kind.after - kind.before;
    return rise > 2.0 * kind.deviation && rise > clear_rise * kind.before;
  };
  return change() > rounding * before() || is_clearly_worse(matches) || is_clearly_worse(surfaces);
}

bool HeldOutEvaluation::is_clearly_better() const {
  return !is_worse() && matches.before - matches.after > 2.0 * matches.deviation;
}

HeldOutEvaluation evaluate_held_out(const HeldOutCosts& before, const HeldOutCosts& after) {
  return {compare_held_out(before.matches, after.matches),
          compare_held_out(before.surfaces, after.surfaces)};
}

}  // namespace libmap
