#include "libmap/refine/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/calibration_uncertainty.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/pose_residuals.h"
#include "libmap/refine/rigid_motion.h"
#include "libmap/refine/sparse_adjustment.h"

namespace libmap {

namespace {

constexpr std::size_t dense_below = 120;  // poses: the Schur complement of more is never formed
constexpr double registration_prior_m = 0.02;
constexpr double registration_prior_rad = 0.03;
constexpr double timing_prior_s = 0.03;
// How a hand's motion differs from that between poses of a second or less.
constexpr double motion_prior_m_per_s = 0.15;
constexpr double motion_prior_rad_per_s = 0.25;
constexpr double max_motion_gap_s = 3.0;

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

// How the base moves at each frame, in its own frame (m/s, rad/s): from the frame before to the one
// after. Where there is none within max_motion_gap_s, it does not move.
std::map<int, Vector6d> motion_between(const std::vector<FrameFeatures>& frames,
                                       const std::map<int, Pose>& poses) {
  std::vector<std::pair<double, int>> nodes;
  for (const FrameFeatures& frame : frames)
    if (poses.contains(frame.node)) nodes.emplace_back(frame.stamp_s, frame.node);
  std::sort(nodes.begin(), nodes.end());
  std::map<int, Vector6d> motions;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const auto [time_s, node] = nodes[n];
    const auto is_near = [&](const std::pair<double, int>& other) {
      return std::abs(other.first - time_s) <= max_motion_gap_s;
    };
    const auto& before = n > 0 && is_near(nodes[n - 1]) ? nodes[n - 1] : nodes[n];
    const auto& after = n + 1 < nodes.size() && is_near(nodes[n + 1]) ? nodes[n + 1] : nodes[n];
    Vector6d& motion = motions[node] = Vector6d::Zero();
    const double seconds = after.first - before.first;
    if (!(seconds > 0.0)) continue;
    const Pose& first = poses.at(before.second);
    const Pose& last = poses.at(after.second);
    const Eigen::Matrix3d base_from_map = poses.at(node).linear().transpose();
    motion << base_from_map * (last.translation() - first.translation()),
        base_from_map * rotation_vector_of(last.linear() * first.linear().transpose());
    motion /= seconds;
  }
  return motions;
}

class Adjustment {
 public:
  Adjustment(const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
             const std::map<int, Pose>& poses, const BundleAdjustmentOptions& options,
             const SensorCalibration& start)
      : frames_(frames),
        tracks_(tracks),
        options_(options),
        cameras_(options.refine_intrinsics || options.refine_depth || options.refine_registration ||
                         options.refine_timing
                     ? max_cameras(frames)
                     : 0),
        corrections_(
            corrections_for(frames, options.refine_depth ? cameras_ : 0, options.depth_knot_m)),
        motions_(options.refine_timing ? motion_between(frames, poses) : std::map<int, Vector6d>{}),
        blocks_(poses,
                camera_numbers * cameras_ + count_numbers(corrections_) + 6 * motions_.size()) {
    result_.map_from_base = poses;
    if (options.refine_registration) start_.color_from_depth = start.color_from_depth;
    if (options.refine_timing) {
      start_.timing = start.timing;
      start_.motion = start.motion;
    }
    start_.color_from_depth.resize(cameras_, Pose::Identity());
    start_.timing.resize(cameras_);
    for (std::size_t n = 0; n < cameras_; ++n) {
      timing(n)[0] = start_.timing[n].depth_delay_s;
      timing(n)[1] = start_.timing[n].rolling_shutter_s;
    }
    for (const auto& [node, between] : motions_) {
      const auto known = start_.motion.emplace(node, between).first;
      Eigen::Map<Vector6d>(motion(node)) = known->second;
    }
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
  double* intrinsics(std::size_t camera) const { return blocks_.rest() + camera_numbers * camera; }
  double* registration(std::size_t camera) const { return intrinsics(camera) + 4; }
  double* timing(std::size_t camera) const { return intrinsics(camera) + 10; }
  double* depth_numbers(std::size_t camera) const {
    double* numbers = intrinsics(cameras_);
    for (std::size_t n = 0; n < camera; ++n) numbers += 3 + corrections_[n].spline_m.size();
    return numbers;
  }
  double* motion(int node) const {
    return depth_numbers(corrections_.size()) +
           6 * std::distance(motions_.begin(), motions_.find(node));
  }
  // Blocks of a camera and of a node, in the order of ObservationCost.
  std::vector<double*> calibration_blocks(const Feature& its, int node,
                                          const CalibratedObservation& calibrated) const;
  Eigen::Vector3d place_of(const FeatureTrack& track) const;
  CalibratedObservation calibrated(const Observation& seen) const;
  void add_observation(ceres::Problem& problem, const Observation& seen, double* point);
  void add_observations(ceres::Problem& problem);
  void add_camera_priors(ceres::Problem& problem, std::size_t camera);
  void add_depth_priors(ceres::Problem& problem, std::size_t camera);
  double motion_scale() const;
  SensorCalibration calibration(double motion_scale) const;
  void take_calibration();
  void find_alternatives(ceres::Problem& problem);
  void add_links(ceres::Problem& problem, const std::vector<GraphLinkResult>& links);
  void solve(ceres::Problem& problem);
  void eliminate_points(const std::vector<GraphLinkResult>& links,
                        const std::vector<FeatureTrack>& system_tracks);

  static constexpr std::size_t camera_numbers = 12;

  const std::vector<FrameFeatures>& frames_;
  std::vector<FrameFeatures> calibrated_frames_;  // at the end
  const std::vector<FeatureTrack>& tracks_;
  const BundleAdjustmentOptions& options_;
  BundleAdjustmentResult result_;
  std::size_t cameras_ = 0;                   // with something to refine
  std::vector<DepthCorrection> corrections_;  // of 0: their knots
  std::map<int, Vector6d> motions_;           // between poses
  SensorCalibration start_;
  // Then, of each camera: a step of the intrinsics (4), of the registration (6), its timing (2); a
  // correction of depth, its radial numbers first; of each node its motion (6). In one place, since
  // Ceres orders blocks by address.
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

CalibratedObservation Adjustment::calibrated(const Observation& seen) const {
  CalibratedObservation calibrated;
  if (cameras_ == 0) return calibrated;
  const FrameFeatures& frame = frames_[seen.frame];
  const Feature& its = feature(seen);
  const Camera& camera = frame.cameras[its.camera];
  calibrated.intrinsics = options_.refine_intrinsics;
  calibrated.registration = options_.refine_registration;
  calibrated.timing = options_.refine_timing;
  if (options_.refine_depth && !corrections_[its.camera].empty()) {
    calibrated.depth = true;
    calibrated.terms = corrections_[its.camera].terms(static_cast<double>(its.depth_m),
                                                      squared_radius_of(its, camera));
  }
  if (options_.refine_registration || options_.refine_timing) {
    const RegisteredDepth depth =
        registered_depth(frame, its, color_from_depth_of(frame, its, start_));
    calibrated.added_m = depth.added_m;
    calibrated.by_step = depth.by_step;
  }
  if (options_.refine_timing) {
    const CameraTiming& timing = start_.timing[its.camera];
    calibrated.row_share = row_share_of(its, camera);
    calibrated.known_step =
        (timing.depth_delay_s - timing.rolling_shutter_s * calibrated.row_share) *
        motion_in_camera(camera, start_.motion.at(frame.node));
  }
  return calibrated;
}

std::vector<double*> Adjustment::calibration_blocks(const Feature& its, int node,
                                                    const CalibratedObservation& calibrated) const {
  std::vector<double*> blocks;
  if (calibrated.intrinsics) blocks.push_back(intrinsics(its.camera));
  if (calibrated.depth) {
    double* const numbers = depth_numbers(its.camera);
    for (std::size_t n = 0; n < 4; ++n) blocks.push_back(numbers + 3 + calibrated.terms.first + n);
    blocks.push_back(numbers);
  }
  if (calibrated.registration) blocks.push_back(registration(its.camera));
  if (calibrated.timing) blocks.insert(blocks.end(), {motion(node), timing(its.camera)});
  return blocks;
}

void Adjustment::add_observation(ceres::Problem& problem, const Observation& seen, double* point) {
  const FrameFeatures& frame = frames_[seen.frame];
  const Feature& its = feature(seen);
  const CalibratedObservation calibrated = this->calibrated(seen);
  std::vector<double*> blocks = {blocks_.at(frame.node), point};
  const std::vector<double*> more = calibration_blocks(its, frame.node, calibrated);
  blocks.insert(blocks.end(), more.begin(), more.end());
  problem.AddResidualBlock(new ObservationCost(its, frame.cameras[its.camera], calibrated),
                           new ceres::CauchyLoss(options_.robust_scale), blocks);
}

void Adjustment::add_observations(ceres::Problem& problem) {
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    std::size_t views = 0;
    for (const Observation& seen : tracks_[t].observations) views += has_pose(seen) ? 1 : 0;
    if (views < 2) continue;
    for (const Observation& seen : tracks_[t].observations) {
      if (!has_pose(seen)) continue;
      ++result_.observations;
      add_observation(problem, seen, points_[t].data());
    }
  }
  for (std::size_t n = 0; n < cameras_; ++n) add_camera_priors(problem, n);
  for (const auto& [node, between] : motions_)
    if (problem.HasParameterBlock(motion(node)))
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<NearResidual, 6, 6>(new NearResidual(
                                   between, motion_prior_m_per_s, motion_prior_rad_per_s)),
                               nullptr, motion(node));
}

void Adjustment::add_camera_priors(ceres::Problem& problem, std::size_t camera) {
  if (problem.HasParameterBlock(intrinsics(camera)))
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<IntrinsicsPrior, 4, 4>(
            new IntrinsicsPrior(options_.focal_prior, options_.center_prior_px)),
        nullptr, intrinsics(camera));
  if (options_.refine_depth && !corrections_[camera].empty()) add_depth_priors(problem, camera);
  if (problem.HasParameterBlock(registration(camera)))
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<NearResidual, 6, 6>(new NearResidual(
                                 step_between(start_.color_from_depth[camera], Pose::Identity()),
                                 registration_prior_m, registration_prior_rad)),
                             nullptr, registration(camera));
  if (problem.HasParameterBlock(timing(camera)))
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<TimingPrior, 2, 2>(new TimingPrior(timing_prior_s)),
        nullptr, timing(camera));
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
  std::vector<double*> others;
  problem.GetParameterBlocks(&others);
  for (double* const block : others)
    if (!ordering->IsMember(block)) ordering->AddElementToGroup(block, 1);
  settings.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(settings, &problem, &summary);
  result_.initial_cost = summary.initial_cost;
  result_.final_cost = summary.final_cost;
  result_.iterations = static_cast<int>(summary.iterations.size());
  result_.converged = summary.IsSolutionUsable();
}

void Adjustment::eliminate_points(const std::vector<GraphLinkResult>& links,
                                  const std::vector<FeatureTrack>& system_tracks) {
  const TrackSystem observed(calibrated_frames_.empty() ? frames_ : calibrated_frames_,
                             system_tracks.empty() ? tracks_ : system_tracks,
                             options_.robust_scale);
  const std::vector<Eigen::Vector3d> points =
      system_tracks.empty() ? result_.points : observed.points_at(result_.map_from_base);
  observed.totals(result_.map_from_base, points).add_to(result_);
  result_.information = observed.system(result_.map_from_base, points);
  result_.information.add(link_system(result_.map_from_base, links));
  result_.information.clear_side();
}

// Only the product of time and motion is seen: the motions are right on average if their regression
// on those between poses has the slope 1. The hand's tremor is missing in the latter, so that least
// squares with both as measurements makes times too long.
double Adjustment::motion_scale() const {
  double mixed = 0.0;
  double squares = 0.0;
  for (const auto& [node, between] : motions_) {
    Vector6d weight;
    weight << Eigen::Vector3d::Constant(std::pow(motion_prior_m_per_s, -2)),
        Eigen::Vector3d::Constant(std::pow(motion_prior_rad_per_s, -2));
    const Eigen::Map<const Vector6d> estimated(motion(node));
    mixed += between.dot(weight.cwiseProduct(estimated));
    squares += between.dot(weight.cwiseProduct(between));
  }
  return mixed > 0.0 && squares > 0.0 ? mixed / squares : 1.0;
}

SensorCalibration Adjustment::calibration(double motion_scale) const {
  SensorCalibration found;
  for (std::size_t n = 0; n < cameras_; ++n) {
    const double* step = intrinsics(n);
    if (options_.refine_intrinsics)
      found.intrinsics.push_back({step[0], step[1], step[2], step[3]});
    if (options_.refine_registration)
      found.color_from_depth.push_back(
          moved(Pose::Identity(), Eigen::Map<const Vector6d>(registration(n))) *
          start_.color_from_depth[n]);
    if (options_.refine_timing)
      found.timing.push_back({motion_scale * timing(n)[0], motion_scale * timing(n)[1]});
    if (options_.refine_depth) {
      const double* numbers = depth_numbers(n);
      found.depth.push_back(corrections_[n]);
      std::copy_n(numbers, 3, found.depth[n].radial.begin());
      std::copy_n(numbers + 3, corrections_[n].spline_m.size(), found.depth[n].spline_m.begin());
    }
  }
  for (const auto& [node, between] : motions_)
    found.motion.emplace(node, Eigen::Map<const Vector6d>(motion(node)) / motion_scale);
  return found;
}

void Adjustment::take_calibration() {
  if (cameras_ == 0) return;
  result_.calibration = calibration(options_.refine_timing ? motion_scale() : 1.0);
  calibrated_frames_ = frames_;
  for (FrameFeatures& frame : calibrated_frames_) calibrate(frame, result_.calibration);
}

void Adjustment::find_alternatives(ceres::Problem& problem) {
  FreeBlocks blocks;
  for (auto& point : points_)
    if (problem.HasParameterBlock(point.data())) blocks.points.push_back(point.data());
  for (const auto& [node, block] : blocks_.all())
    if (problem.HasParameterBlock(block) && !problem.IsParameterBlockConstant(block))
      blocks.poses.push_back(block);
  std::vector<double*> all;
  problem.GetParameterBlocks(&all);
  std::copy_if(all.begin(), all.end(), std::back_inserter(blocks.cameras),
               [&](const double* block) {
                 return std::greater_equal<>()(block, static_cast<const double*>(blocks_.rest())) &&
                        std::less<>()(block, static_cast<const double*>(blocks_.end()));
               });
  std::sort(blocks.cameras.begin(), blocks.cameras.end());
  const double scale = options_.refine_timing ? motion_scale() : 1.0;
  for (const Eigen::VectorXd& change : likely_changes(problem, blocks, options_.alternatives)) {
    const std::vector<double> best(static_cast<const double*>(blocks_.rest()), blocks_.end());
    Eigen::Index first = 0;
    for (double* const block : blocks.cameras) {
      const int size = problem.ParameterBlockSize(block);
      Eigen::Map<Eigen::VectorXd>(block, size) += change.segment(first, size);
      first += size;
    }
    result_.alternatives.push_back(calibration(scale));
    std::copy(best.begin(), best.end(), blocks_.rest());
  }
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
  take_calibration();
  if (options_.alternatives > 0 && cameras_ > 0) find_alternatives(problem);
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

BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options,
    const std::vector<FeatureTrack>& system_tracks, const SensorCalibration& start) {
  check_parameters(options);
  return Adjustment(frames, tracks, map_from_base, options, start)
      .run(links, components, system_tracks);
}

FeatureTracks information_tracks(const std::vector<FrameFeatures>& frames,
                                 const std::vector<FeatureLink>& feature_links, std::size_t poses) {
  return build_tracks(frames, feature_links,
                      poses < dense_below ? TrackFrames::any : TrackFrames::linked);
}

BundleAdjustmentResult adjust_bundle(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureLink>& feature_links,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options,
                                     const SensorCalibration& start, Progress& progress) {
  check_parameters(options);
  const bool refines = options.refine_intrinsics || options.refine_depth ||
                       options.refine_registration || options.refine_timing;
  const bool between_nodes =
      std::none_of(links.begin(), links.end(),
                   [](const GraphLinkResult& link) { return is_absolute(link.link); });
  FeatureTracks sparse;
  if (map_from_base.size() >= dense_below)
    sparse = build_tracks(frames, feature_links, TrackFrames::linked);
  if (map_from_base.size() >= dense_below && !refines && between_nodes) {
    BundleAdjustmentResult result =
        adjust_sparse(frames, sparse.tracks, map_from_base, links, components, options, progress);
    result.conflicts = sparse.conflicts;
    return result;
  }
  const FeatureTracks tracks = build_tracks(frames, feature_links);
  BundleAdjustmentResult result = adjust_bundle(frames, tracks.tracks, map_from_base, links,
                                                components, options, sparse.tracks, start);
  result.conflicts = tracks.conflicts;
  return result;
}

}  // namespace libmap
