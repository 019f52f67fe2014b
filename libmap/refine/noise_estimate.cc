#include "libmap/refine/noise_estimate.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "libmap/consistency/pose_consistency.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/features/features.h"
#include "libmap/optimize/icp_refinement.h"

namespace libmap {

namespace {

constexpr std::size_t bins = 10;
constexpr std::size_t min_residuals = 1000;
constexpr double median_of_normal = 0.6745;  // of absolute values, in standard deviations
constexpr double min_axial_m = 1e-4;
constexpr int terms = 3;
// An estimate that differs from the assumed noise by this factor replaces it.
constexpr double other_noise = 1.8;
constexpr int samples_per_frame = 200;
constexpr std::size_t max_pairs_of_noise = 12;  // above, every second pair is used

// Fits non-negative terms of the noise with the least relative errors, by trying all subsets of
// terms.
Eigen::Vector3d fit_terms(const std::vector<Eigen::Vector2d>& range_and_noise) {
  const auto count = static_cast<Eigen::Index>(range_and_noise.size());
  Eigen::MatrixXd powers(count, terms);
  for (Eigen::Index n = 0; n < count; ++n) {
    const Eigen::Vector2d& bin = range_and_noise[static_cast<std::size_t>(n)];
    powers.row(n) << 1.0, bin.x(), bin.x() * bin.x();
    powers.row(n) /= bin.y();
  }
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(count);
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (unsigned subset = 1; subset < 1U << terms; ++subset) {
    std::vector<Eigen::Index> used;
    for (Eigen::Index n = 0; n < terms; ++n)
      if ((subset >> n & 1U) != 0) used.push_back(n);
    const Eigen::VectorXd found = powers(Eigen::all, used).colPivHouseholderQr().solve(ones);
    if (!(found.minCoeff() >= 0.0)) continue;
    const double cost = (powers(Eigen::all, used) * found - ones).squaredNorm();
    if (!(cost < least)) continue;
    least = cost;
    best.setZero();
    for (std::size_t n = 0; n < used.size(); ++n)
      best[used[n]] = found[static_cast<Eigen::Index>(n)];
  }
  return best;
}

}  // namespace

std::optional<NoiseEstimate> estimate_noise(const std::vector<SurfaceResidual>& residuals,
                                            const DepthNoise& assumed) {
  std::vector<std::pair<double, double>> known;  // range, and distance in standard deviations
  for (const SurfaceResidual& residual : residuals)
    if (std::isfinite(residual.distance_m))
      known.emplace_back(residual.range_m, std::abs(residual.distance_m) / residual.noise_m);
  if (known.size() < min_residuals) return std::nullopt;
  std::sort(known.begin(), known.end());
  std::vector<Eigen::Vector2d> range_and_noise;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const std::size_t first = bin * known.size() / bins;
    const std::size_t count = (bin + 1) * known.size() / bins - first;
    std::vector<double> ratios;
    for (std::size_t n = first; n < first + count; ++n) ratios.push_back(known[n].second);
    std::nth_element(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(count / 2),
                     ratios.end());
    const double range_m = known[first + count / 2].first;
    range_and_noise.emplace_back(
        range_m,
        std::max(min_axial_m, assumed.axial_at(range_m) * ratios[count / 2] / median_of_normal));
  }
  const Eigen::Vector3d found = fit_terms(range_and_noise);
  NoiseEstimate estimate{.noise = assumed,
                         .residuals = known.size(),
                         .nearest_m = range_and_noise.front().x(),
                         .farthest_m = range_and_noise.back().x()};
  estimate.noise.axial_m = std::max(min_axial_m, found[0]);
  estimate.noise.axial_of_range = found[1];
  estimate.noise.axial_of_square = found[2];
  for (const Eigen::Vector2d& bin : range_and_noise) {
    const double ratio = estimate.noise.axial_at(bin.x()) / assumed.axial_at(bin.x());
    estimate.largest_ratio = std::max({estimate.largest_ratio, ratio, 1.0 / ratio});
  }
  return estimate;
}

bool is_noise_given(const std::string& sensor, const DepthNoise& noise) {
  DepthNoise unset;
  unset.lateral_px = noise.lateral_px;
  return sensor != "auto" || !(noise == unset);
}

ScanNoise choose_noise(const std::vector<SurfaceResidual>& residuals, const DepthNoise& assumed) {
  const auto found = estimate_noise(residuals, assumed);
  if (!found)
    return {assumed, false,
            "depth noise " + describe(assumed) + " assumed: too few held-out depths"};
  ScanNoise chosen{assumed, found->largest_ratio > other_noise, {}};
  chosen.sentence =
      "depth noise " + describe(found->noise) + " by " + std::to_string(found->residuals) +
      " held-out depths from " + to_fixed_text(found->nearest_m, 1) + " to " +
      to_fixed_text(found->farthest_m, 1) +
      " m: " + (chosen.is_estimated ? "replaces " : "agrees with ") + describe(assumed);
  if (chosen.is_estimated) chosen.noise = found->noise;
  return chosen;
}

ScanNoise choose_noise(const ScanSource& scan, const Trajectory& world_from_base,
                       const std::string& sensor, const DepthPlaneOptions& planes,
                       Progress& progress) {
  if (is_noise_given(sensor, planes.noise))
    return {planes.noise, false,
            sensor == "auto" ? "depth noise " + describe(planes.noise) + " as given"
                             : "depth noise of " + sensor};
  auto pairs = near_pairs_of(world_from_base);
  if (pairs.size() > max_pairs_of_noise) {
    std::size_t n = 0;
    std::erase_if(pairs, [&](const auto&) { return n++ % 2 == 1; });
  }
  std::set<int> nodes;
  for (const auto& [a, b] : pairs) nodes.insert({world_from_base[a].node, world_from_base[b].node});
  FeatureOptions options{.planes = planes};
  options.surfaces_only = true;
  const FeatureResult found = find_features(scan, {nodes.begin(), nodes.end()}, options, progress);
  std::map<int, const FrameFeatures*> frame_of;
  for (const FrameFeatures& frame : found.frames) frame_of[frame.node] = &frame;
  std::vector<std::vector<SurfaceResidual>> of_pair(pairs.size());
  parallel_each(pairs.size(), [&](std::size_t n) {
    const TrajectoryPose& a = world_from_base[pairs[n].first];
    const TrajectoryPose& b = world_from_base[pairs[n].second];
    if (!frame_of.contains(a.node) || !frame_of.contains(b.node)) return;
    const std::vector<FrameFeatures> frames = {*frame_of.at(a.node), *frame_of.at(b.node)};
    const auto link =
        align_pair(frames[0], frames[1], a.world_from_base.inverse() * b.world_from_base);
    if (link)
      of_pair[n] = surface_residuals(frames, {{.frames = {0, 1}}},
                                     {{a.node, Pose::Identity()}, {b.node, link->from_from_to}},
                                     samples_per_frame);
  });
  std::vector<SurfaceResidual> residuals;
  for (const auto& some : of_pair) residuals.insert(residuals.end(), some.begin(), some.end());
  return choose_noise(residuals, planes.noise);
}

std::string describe(const DepthNoise& noise) {
  return to_fixed_text(1e3 * noise.axial_m, 1) + " mm + " +
         to_fixed_text(100.0 * noise.axial_of_range, 2) + " % of range + " +
         to_fixed_text(1e3 * noise.axial_of_square, 2) + " mm/m2 of range squared";
}

}  // namespace libmap
