#include "libmap/refine/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/pose_residuals.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

namespace {

constexpr std::size_t dense_below = 120;  // poses: the Schur complement of more is never formed
constexpr int point_steps = 3;
constexpr double registration_prior_m = 0.02;
constexpr double registration_prior_rad = 0.03;

std::size_t count_numbers(const std::vector<DepthCorrection>& corrections) {
  std::size_t count = 0;
  for (const DepthCorrection& correction : corrections) count += 3 + correction.spline_m.size();
  return count;
}

std::size_t max_cameras(const std::vector<FrameFeatures>& frames) {
  std::size_t cameras = 0;
  for (const FrameFeatures& frame : frames) cameras = std::max(cameras, frame.cameras.size());
  return cameras;
}

class Adjustment {
 public:
  Adjustment(const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
             const std::map<int, Pose>& poses, const BundleAdjustmentOptions& options)
      : frames_(frames),
        tracks_(tracks),
        options_(options),
        cameras_(options.refine_intrinsics || options.refine_depth || options.refine_registration
                     ? max_cameras(frames)
                     : 0),
        corrections_(corrections_for(frames, refines_more() ? cameras_ : 0, options.depth_knot_m)),
        blocks_(poses, 10 * cameras_ + count_numbers(corrections_)) {
    result_.map_from_base = poses;
    for (const FeatureTrack& track : tracks_) {
      const Eigen::Vector3d point = place_of(track);
      points_.push_back({point.x(), point.y(), point.z()});
    }
  }

  BundleAdjustmentResult run(const std::vector<GraphLinkResult>& links,
                             const std::vector<GraphComponent>& components,
                             const std::vector<FeatureTrack>& system_tracks);

 private:
  const Feature& feature(const Observation& seen) const {
    return frames_[seen.frame].features[seen.feature];
  }
  bool has_pose(const Observation& seen) const {
    return blocks_.contains(frames_[seen.frame].node);
  }
  double* intrinsics(std::size_t camera) const { return blocks_.rest() + 4 * camera; }
  double* registration(std::size_t camera) const {
    return blocks_.rest() + 4 * cameras_ + 6 * camera;
  }
  Eigen::Vector3d place_of(const FeatureTrack& track) const;
  // The observation as the refined intrinsics have it.
  Linearized linearized(const Observation& seen, const Eigen::Vector3d& point) const;
  double weight_of(const Linearized& l) const {
    return 1.0 / (1.0 + l.residual.squaredNorm() / (options_.robust_scale * options_.robust_scale));
  }
  double* depth_numbers(std::size_t camera) const {
    double* numbers = blocks_.rest() + 10 * cameras_;
    for (std::size_t n = 0; n < camera; ++n) numbers += 3 + corrections_[n].spline_m.size();
    return numbers;
  }
  bool refines_more() const { return options_.refine_depth || options_.refine_registration; }
  bool refines_more(std::size_t camera) const {
    return refines_more() && !corrections_[camera].empty();
  }
  void add_observation(ceres::Problem& problem, const Observation& seen, double* point);
  void add_observations(ceres::Problem& problem);
  void add_intrinsics_priors(ceres::Problem& problem);
  void add_depth_priors(ceres::Problem& problem, std::size_t camera);
  void add_registration_prior(ceres::Problem& problem, std::size_t camera);
  void add_links(ceres::Problem& problem, const std::vector<GraphLinkResult>& links);
  void solve(ceres::Problem& problem);
  void add_to_system(const FeatureTrack& track, const Eigen::Vector3d& point,
                     const std::map<int, std::size_t>& place);
  void settle(const FeatureTrack& track, Eigen::Vector3d& point) const;
  void eliminate_points(const std::vector<GraphLinkResult>& links,
                        const std::vector<FeatureTrack>& system_tracks);

  const std::vector<FrameFeatures>& frames_;
  const std::vector<FeatureTrack>& tracks_;
  const BundleAdjustmentOptions& options_;
  BundleAdjustmentResult result_;
  std::size_t cameras_ = 0;                   // with something to refine
  std::vector<DepthCorrection> corrections_;  // of 0: their knots
  // Then, of each camera: a step of the intrinsics (4), of the registration (6), and a correction
  // of depth, its radial numbers first. In one place, since Ceres orders blocks by address.
  PoseBlocks blocks_;
  std::vector<std::array<double, 3>> points_;
};

// In the middle of where the frames see it.
Eigen::Vector3d Adjustment::place_of(const FeatureTrack& track) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (const Observation& seen : track.observations) {
    if (!has_pose(seen)) continue;
    sum += result_.map_from_base.at(frames_[seen.frame].node) *
           frames_[seen.frame].point_in_base(seen.feature);
    count += 1.0;
  }
  return count > 0.0 ? Eigen::Vector3d(sum / count) : sum;
}

void Adjustment::add_observation(ceres::Problem& problem, const Observation& seen, double* point) {
  const Feature& its = feature(seen);
  const Camera& camera = frames_[seen.frame].cameras[its.camera];
  auto* residual = new ObservationResidual(its, camera);
  auto* loss = new ceres::CauchyLoss(options_.robust_scale);
  double* pose = blocks_.at(frames_[seen.frame].node);
  if (cameras_ == 0) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ObservationResidual, 3, 7, 3>(residual), loss, pose, point);
  } else if (!refines_more(its.camera)) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ObservationResidual, 3, 7, 3, 4>(residual), loss, pose,
        point, intrinsics(its.camera));
  } else {
    const DepthCorrection& depth = corrections_[its.camera];
    const DepthCorrection::Terms terms =
        depth.terms(static_cast<double>(its.depth_m), squared_radius_of(its, camera));
    residual->set_terms(terms);
    if (options_.refine_registration)
      residual->set_registration(depth_by_registration(frames_[seen.frame], its));
    double* spline = depth_numbers(its.camera) + 3 + terms.first;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ObservationResidual, 3, 7, 3, 4, 1, 1, 1, 1, 3, 6>(
            residual),
        loss, pose, point, intrinsics(its.camera), spline, spline + 1, spline + 2, spline + 3,
        depth_numbers(its.camera), registration(its.camera));
  }
}

void Adjustment::add_observations(ceres::Problem& problem) {
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    std::size_t views = 0;
    for (const Observation& seen : tracks_[t].observations) views += has_pose(seen) ? 1 : 0;
    if (views < 2) continue;
    ++result_.tracks;
    for (const Observation& seen : tracks_[t].observations) {
      if (!has_pose(seen)) continue;
      ++result_.observations;
      add_observation(problem, seen, points_[t].data());
    }
  }
  add_intrinsics_priors(problem);
  for (std::size_t n = 0; n < corrections_.size(); ++n)
    if (refines_more(n)) {
      add_depth_priors(problem, n);
      add_registration_prior(problem, n);
    }
}

void Adjustment::add_intrinsics_priors(ceres::Problem& problem) {
  for (std::size_t n = 0; n < cameras_; ++n) {
    if (!problem.HasParameterBlock(intrinsics(n))) continue;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<IntrinsicsPrior, 4, 4>(
            new IntrinsicsPrior(options_.focal_prior, options_.center_prior_px)),
        nullptr, intrinsics(n));
    if (!options_.refine_intrinsics) problem.SetParameterBlockConstant(intrinsics(n));
  }
}

void Adjustment::add_registration_prior(ceres::Problem& problem, std::size_t camera) {
  double* const block = registration(camera);
  if (!problem.HasParameterBlock(block)) return;
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SmallResidual, 6, 6>(
                               new SmallResidual(registration_prior_m, registration_prior_rad)),
                           nullptr, block);
  if (!options_.refine_registration) problem.SetParameterBlockConstant(block);
}

// Each number is small, the spline bends little, and depths keep their mean (depth_gauge).
void Adjustment::add_depth_priors(ceres::Problem& problem, std::size_t camera) {
  const DepthCorrection& depth = corrections_[camera];
  double* const radial = depth_numbers(camera);
  const auto add = [&](std::size_t first, const std::vector<double>& factors,
                       const std::array<double, 3>& of_radial) {
    std::vector<double*> blocks;
    for (std::size_t n = 0; n < factors.size(); ++n) blocks.push_back(radial + 3 + first + n);
    blocks.push_back(radial);
    problem.AddResidualBlock(new LinearResidual(factors, of_radial), nullptr, blocks);
  };
  const double small = 1.0 / options_.depth_prior_m;
  const double bend = 1.0 / options_.depth_bend_m;
  for (std::size_t n = 0; n < depth.spline_m.size(); ++n) {
    add(n, {small}, {});
    if (n + 2 < depth.spline_m.size()) add(n, {bend, -2.0 * bend, bend}, {});
  }
  for (std::size_t n = 0; n < 3; ++n) {
    std::array<double, 3> one{};
    one[n] = small;
    add(0, {}, one);
  }
  std::vector<double> spline(depth.spline_m.size(), 0.0);
  std::array<double, 3> radii{};
  double count = 0.0;
  for (const FrameFeatures& frame : frames_)
    for (const Feature& its : frame.features) {
      if (its.camera != camera) continue;
      const auto z = static_cast<double>(its.depth_m);
      const DepthCorrection::Terms terms =
          depth.terms(z, squared_radius_of(its, frame.cameras[camera]));
      for (std::size_t n = 0; n < 4; ++n) spline[terms.first + n] += terms.spline[n] / z;
      for (std::size_t n = 0; n < 3; ++n) radii[n] += terms.radial[n] / z;
      count += 1.0;
    }
  for (double& factor : spline) factor /= count * depth_gauge;
  for (double& factor : radii) factor /= count * depth_gauge;
  add(0, spline, radii);
  if (options_.refine_depth) return;
  for (std::size_t n = 0; n < depth.spline_m.size(); ++n)
    problem.SetParameterBlockConstant(radial + 3 + n);
  problem.SetParameterBlockConstant(radial);
}

void Adjustment::add_links(ceres::Problem& problem, const std::vector<GraphLinkResult>& links) {
  for (const GraphLinkResult& kept : links) {
    const PoseLink& link = kept.link;
    if (kept.rejected || !blocks_.contains(link.from)) continue;
    if (is_absolute(link))
      add_link(problem, blocks_, link, link.information, nullptr);
    else if (blocks_.contains(link.to))
      add_link(problem, blocks_, link, kept.weight * link.information, nullptr);
  }
}

void Adjustment::solve(ceres::Problem& problem) {
  ceres::Solver::Options settings;
  settings.linear_solver_type =
      blocks_.all().size() < dense_below ? ceres::DENSE_SCHUR : ceres::ITERATIVE_SCHUR;
  settings.preconditioner_type = ceres::SCHUR_JACOBI;
  settings.dense_linear_algebra_library_type = ceres::EIGEN;
  settings.num_threads = 1;
  settings.max_num_iterations = options_.max_iterations;
  settings.function_tolerance = 1e-6;
  settings.gradient_tolerance = 1e-12;
  settings.parameter_tolerance = 1e-10;
  settings.logging_type = ceres::SILENT;
  // Points first: they are eliminated.
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (auto& point : points_)
    if (problem.HasParameterBlock(point.data())) ordering->AddElementToGroup(point.data(), 0);
  for (const auto& [node, block] : blocks_.all())
    if (problem.HasParameterBlock(block)) ordering->AddElementToGroup(block, 1);
  for (std::size_t n = 0; n < cameras_; ++n)
    if (problem.HasParameterBlock(intrinsics(n))) ordering->AddElementToGroup(intrinsics(n), 1);
  for (std::size_t n = 0; n < corrections_.size(); ++n) {
    double* const numbers = depth_numbers(n);
    if (problem.HasParameterBlock(numbers)) ordering->AddElementToGroup(numbers, 1);
    for (std::size_t k = 0; k < corrections_[n].spline_m.size(); ++k)
      if (problem.HasParameterBlock(numbers + 3 + k))
        ordering->AddElementToGroup(numbers + 3 + k, 1);
  }
  for (std::size_t n = 0; n < cameras_; ++n)
    if (problem.HasParameterBlock(registration(n))) ordering->AddElementToGroup(registration(n), 1);
  settings.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(settings, &problem, &summary);
  result_.initial_cost = summary.initial_cost;
  result_.final_cost = summary.final_cost;
  result_.iterations = static_cast<int>(summary.iterations.size());
  result_.converged = summary.IsSolutionUsable();
}

Linearized Adjustment::linearized(const Observation& seen, const Eigen::Vector3d& point) const {
  Feature its = feature(seen);
  Camera camera = frames_[seen.frame].cameras[its.camera];
  if (!result_.color_from_depth.empty()) {
    const std::array<double, 6> derivatives = depth_by_registration(frames_[seen.frame], its);
    double added = 0.0;
    for (std::size_t n = 0; n < 6; ++n) added += derivatives[n] * registration(its.camera)[n];
    its.depth_m += static_cast<float>(added);
  }
  if (!result_.depth.empty()) {
    const auto z = static_cast<double>(its.depth_m);
    its.depth_m =
        static_cast<float>(z + result_.depth[its.camera].at(z, squared_radius_of(its, camera)));
  }
  if (!result_.intrinsics.empty()) {
    its.ray = moved_ray(its, camera, result_.intrinsics[its.camera]);
    camera = moved(camera, result_.intrinsics[its.camera]);
  }
  return linearize(its, camera, result_.map_from_base.at(frames_[seen.frame].node), point);
}

// The track's share of the normal equations, its point eliminated.
void Adjustment::add_to_system(const FeatureTrack& track, const Eigen::Vector3d& point,
                               const std::map<int, std::size_t>& place) {
  const auto views = std::count_if(track.observations.begin(), track.observations.end(),
                                   [&](const Observation& seen) { return has_pose(seen); });
  if (views < 2) return;
  Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
  std::vector<std::pair<std::size_t, Eigen::Matrix<double, 6, 3>>> mixed;
  for (const Observation& seen : track.observations) {
    if (!has_pose(seen)) continue;
    const int node = frames_[seen.frame].node;
    const Feature& its = feature(seen);
    const Linearized l = linearized(seen, point);
    const double weight = weight_of(l);
    if (weight < 0.5) {
      ++result_.outliers;
    } else {
      result_.reprojection_rms_px += l.residual.head<2>().squaredNorm() *
                                     static_cast<double>(its.pixel_noise_px) *
                                     static_cast<double>(its.pixel_noise_px) / 2.0;
      result_.depth_rms_m += std::pow(l.residual.z() * static_cast<double>(its.depth_noise_m), 2);
    }
    const std::size_t row = place.at(node);
    result_.information.add(row, row, weight * l.by_pose.transpose() * l.by_pose);
    of_point += weight * l.by_point.transpose() * l.by_point;
    mixed.emplace_back(row, weight * l.by_pose.transpose() * l.by_point);
  }
  const Eigen::Matrix3d inverse = of_point.inverse();
  for (std::size_t a = 0; a < mixed.size(); ++a)
    for (std::size_t b = a; b < mixed.size(); ++b)
      result_.information.add(mixed[a].first, mixed[b].first,
                              -mixed[a].second * inverse * mixed[b].second.transpose());
}

// Where the track's observations agree best at the poses as they are.
void Adjustment::settle(const FeatureTrack& track, Eigen::Vector3d& point) const {
  for (int step = 0; step < point_steps; ++step) {
    Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
    Eigen::Vector3d side = Eigen::Vector3d::Zero();
    for (const Observation& seen : track.observations) {
      if (!has_pose(seen)) continue;
      const Linearized l = linearized(seen, point);
      of_point += weight_of(l) * l.by_point.transpose() * l.by_point;
      side -= weight_of(l) * l.by_point.transpose() * l.residual;
    }
    point += of_point.ldlt().solve(side);
  }
}

void Adjustment::eliminate_points(const std::vector<GraphLinkResult>& links,
                                  const std::vector<FeatureTrack>& system_tracks) {
  std::map<int, std::size_t> place;
  for (const auto& [node, pose] : result_.map_from_base) place.emplace(node, place.size());
  result_.information = BlockSystem(place.size());
  if (system_tracks.empty()) {
    for (std::size_t t = 0; t < tracks_.size(); ++t)
      add_to_system(tracks_[t], result_.points[t], place);
  } else {
    for (const FeatureTrack& track : system_tracks) {
      Eigen::Vector3d point = place_of(track);
      settle(track, point);
      add_to_system(track, point, place);
    }
  }
  const double kept = std::max(1.0, static_cast<double>(result_.observations - result_.outliers));
  result_.reprojection_rms_px = std::sqrt(result_.reprojection_rms_px / kept);
  result_.depth_rms_m = std::sqrt(result_.depth_rms_m / kept);
  result_.information.add(link_system(result_.map_from_base, links));
  result_.information.clear_side();
}

BundleAdjustmentResult Adjustment::run(const std::vector<GraphLinkResult>& links,
                                       const std::vector<GraphComponent>& components,
                                       const std::vector<FeatureTrack>& system_tracks) {
  ceres::Problem problem;
  add_observations(problem);
  add_links(problem, links);
  set_pose_manifolds(problem, blocks_);
  for (const GraphComponent& component : components) {
    double* block = blocks_.at(component.gauge_node);
    if (problem.HasParameterBlock(block)) problem.SetParameterBlockConstant(block);
  }
  if (result_.observations > 0) solve(problem);
  take_poses(problem, blocks_, result_.map_from_base);
  for (const auto& point : points_) result_.points.emplace_back(point[0], point[1], point[2]);
  for (std::size_t n = 0; n < cameras_; ++n) {
    const double* step = intrinsics(n);
    result_.intrinsics.push_back({step[0], step[1], step[2], step[3]});
    if (options_.refine_registration)
      result_.color_from_depth.push_back(
          moved(Pose::Identity(), Eigen::Map<const Vector6d>(registration(n))));
  }
  for (std::size_t n = 0; options_.refine_depth && n < cameras_; ++n) {
    const double* numbers = depth_numbers(n);
    result_.depth.push_back(corrections_[n]);
    std::copy_n(numbers, 3, result_.depth[n].radial.begin());
    std::copy_n(numbers + 3, corrections_[n].spline_m.size(), result_.depth[n].spline_m.begin());
  }
  eliminate_points(links, system_tracks);
  return std::move(result_);
}

}  // namespace

void bind(ParameterTable& table, BundleAdjustmentOptions& options) {
  table.add("observation_scale", options.robust_scale, positive,
            "of Cauchy's loss, standard deviations of an observation");
  table.add("bundle_iterations", options.max_iterations, {1, 10000},
            "of the bundle adjustment, at most");
  table.add("focal_prior", options.focal_prior, positive,
            "standard deviation of the focal length, of itself");
  table.add("center_prior_px", options.center_prior_px, positive,
            "standard deviation of the principal point");
  table.add("depth_prior_m", options.depth_prior_m, positive,
            "standard deviation of a correction of depth");
  table.add("depth_bend_m", options.depth_bend_m, positive,
            "standard deviation of its second difference from knot to knot");
  table.add("depth_knot_m", options.depth_knot_m, {0.02}, "between its knots");
}

BundleAdjustmentResult adjust_bundle(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureTrack>& tracks,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options,
                                     const std::vector<FeatureTrack>& system_tracks) {
  check_parameters(options);
  return Adjustment(frames, tracks, map_from_base, options).run(links, components, system_tracks);
}

BundleAdjustmentResult adjust_bundle(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureLink>& feature_links,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options) {
  const FeatureTracks tracks = build_tracks(frames, feature_links);
  FeatureTracks sparse;
  if (map_from_base.size() >= dense_below)
    sparse = build_tracks(frames, feature_links, TrackFrames::linked);
  BundleAdjustmentResult result = adjust_bundle(frames, tracks.tracks, map_from_base, links,
                                                components, options, sparse.tracks);
  result.conflicts = tracks.conflicts;
  return result;
}

}  // namespace libmap
