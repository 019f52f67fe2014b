#include "libmap/optimize/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "libmap/core/text.h"
#include "libmap/features/bundle_residuals.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/optimize/joint_adjustment.h"
#include "libmap/optimize/relative_motions.h"
#include "libmap/optimize/sparse_adjustment.h"

namespace libmap {

namespace {

constexpr std::size_t dense_below = 120;  // poses; with more, no dense Schur complement is formed
constexpr double registration_prior_rad = 0.03;
// Scatter of the stamps' depth delays from which on the scale of the motions is observable.
constexpr double observable_delay_s = 0.005;
// Keeps the system regular for unconstrained poses.
constexpr double pose_damping = 1e-6;

std::size_t max_cameras(const std::vector<FrameFeatures>& frames) {
  std::size_t cameras = 0;
  for (const FrameFeatures& frame : frames) cameras = std::max(cameras, frame.cameras.size());
  return cameras;
}

// Priors of the camera parameters x as residuals a x - b.
class Priors {
 public:
  explicit Priors(Eigen::Index numbers) : numbers_(numbers) {}

  // Returns a zero row that the caller fills.
  Eigen::VectorXd& add(double mean = 0.0) {
    means_.push_back(mean);
    return rows_.emplace_back(Eigen::VectorXd::Zero(numbers_));
  }
  void add_near(Eigen::Index first, const Eigen::VectorXd& means,
                const Eigen::VectorXd& deviations) {
    for (Eigen::Index n = 0; n < means.size(); ++n)
      add(means[n] / deviations[n])[first + n] = 1.0 / deviations[n];
  }
  void add_to(JointProblem& problem) const {
    problem.prior.resize(static_cast<Eigen::Index>(rows_.size()), numbers_);
    for (std::size_t n = 0; n < rows_.size(); ++n)
      problem.prior.row(static_cast<Eigen::Index>(n)) = rows_[n];
    problem.prior_mean =
        Eigen::Map<const Eigen::VectorXd>(means_.data(), static_cast<Eigen::Index>(means_.size()));
  }

 private:
  Eigen::Index numbers_;
  std::vector<Eigen::VectorXd> rows_;
  std::vector<double> means_;
};

// Rows of the free unknowns in the normal equations.
struct FreeRows {
  std::vector<Eigen::Index> poses;   // first row of the six of each pose's step (rigid_motion.h)
  std::vector<Eigen::Index> params;  // of cameras and motions
};

// The `count` changes of the parameters by one standard deviation in independent directions that
// change the positions of the poses most. Poses are eliminated by the Schur complement; points have
// been eliminated from the information before.
struct CalibrationModes {
  std::vector<Eigen::VectorXd> changes;
  Eigen::VectorXd deviations;  // of each parameter
};
CalibrationModes calibration_modes(const Eigen::MatrixXd& information, const FreeRows& rows,
                                   std::size_t count) {
  if (rows.params.empty()) return {};
  std::vector<Eigen::Index> steps;
  for (const Eigen::Index first : rows.poses)
    for (Eigen::Index n = 0; n < 6; ++n) steps.push_back(first + n);
  Eigen::MatrixXd of_poses = information(steps, steps);
  of_poses.diagonal().array() += pose_damping;
  // Derivative of the optimal poses by the parameters.
  const Eigen::MatrixXd mixed = information(steps, rows.params);
  const Eigen::MatrixXd follow = -of_poses.ldlt().solve(mixed);
  const Eigen::MatrixXd of_params =
      information(rows.params, rows.params) + mixed.transpose() * follow;
  const Eigen::LLT<Eigen::MatrixXd> root(of_params);
  if (root.info() != Eigen::Success) return {};
  const Eigen::Index params = of_params.rows();
  const Eigen::MatrixXd deviations =
      root.matrixU().solve(Eigen::MatrixXd::Identity(params, params));
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(params, params);
  for (Eigen::Index pose = 0; pose < follow.rows(); pose += 6) {
    const Eigen::MatrixXd moves = follow.middleRows<3>(pose) * deviations;
    squares += moves.transpose() * moves;
  }
  const SymmetricEigen<Eigen::Dynamic> effects = symmetric_eigen<Eigen::Dynamic>(squares);
  CalibrationModes modes{.changes = {}, .deviations = deviations.rowwise().norm()};
  for (Eigen::Index n = params - 1; n >= 0 && modes.changes.size() < count; --n)
    modes.changes.emplace_back(deviations * effects.vectors.col(n));
  return modes;
}

class Adjustment {
 public:
  Adjustment(const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
             const std::map<int, Pose>& poses, const std::vector<GraphComponent>& components,
             const BundleAdjustmentOptions& options, const SensorCalibration& start);

  BundleAdjustmentResult run(const std::vector<GraphLinkResult>& links);

 private:
  const Feature& feature(const Observation& seen) const {
    return frames_[seen.frame].features[seen.feature];
  }
  bool has_pose(const Observation& seen) const { return row_.contains(frames_[seen.frame].node); }
  void init_params(const SensorCalibration& start, const std::vector<GraphComponent>& components);
  void add_observations();
  CalibratedObservation calibrated(const Observation& seen) const;
  void add_camera_priors(std::size_t camera, Priors& priors);
  void add_depth_priors(std::size_t camera, Priors& priors);
  double motion_scale() const;
  SensorCalibration calibration(const JointState& state, double motion_scale) const;
  void find_alternatives();

  const std::vector<FrameFeatures>& frames_;
  const std::vector<FeatureTrack>& tracks_;
  const BundleAdjustmentOptions& options_;
  BundleAdjustmentResult result_;
  std::size_t cameras_ = 0;                   // number of cameras; 0 if none is refined
  std::vector<DepthCorrection> corrections_;  // zero corrections that define the knots
  SensorCalibration start_;
  std::map<int, std::size_t> row_;    // row of a node's pose
  std::vector<Eigen::Index> first_;   // first parameter of a camera
  std::vector<bool> sees_;            // true for cameras with observations
  double mean_stamp_offset_s_ = 0.0;  // of FrameFeatures::depth_stamp_offset_s
  double stamp_offset_deviation_s_ = 0.0;
  std::vector<Eigen::Index> free_;   // indices of the free parameters
  std::vector<std::size_t> points_;  // track of each point
  JointProblem problem_;
  JointState state_;
};

Adjustment::Adjustment(const std::vector<FrameFeatures>& frames,
                       const std::vector<FeatureTrack>& tracks, const std::map<int, Pose>& poses,
                       const std::vector<GraphComponent>& components,
                       const BundleAdjustmentOptions& options, const SensorCalibration& start)
    : frames_(frames),
      tracks_(tracks),
      options_(options),
      cameras_(options.refines_cameras() ? max_cameras(frames) : 0),
      corrections_(
          corrections_for(frames, options.refine_depth ? cameras_ : 0, options.depth_knot_m)),
      sees_(cameras_, false) {
  state_.poses = poses;
  for (const auto& [node, pose] : poses) row_.emplace(node, row_.size());
  problem_.robust_scale = options.robust_scale;
  problem_.fix_cameras = options.fixes_cameras;
  problem_.fixed.assign(row_.size(), options.fixes_poses);
  for (const GraphComponent& component : components)
    if (const auto entry = row_.find(component.gauge_node); entry != row_.end())
      problem_.fixed[entry->second] = true;
  init_params(start, components);
  add_observations();
  Priors priors(state_.camera_params.size());
  for (std::size_t n = 0; n < cameras_; ++n) add_camera_priors(n, priors);
  priors.add_to(problem_);
  const auto [first, last] = std::minmax_element(free_.begin(), free_.end());
  problem_.first_param = free_.empty() ? 0 : *first;
  problem_.end_param = free_.empty() ? 0 : *last + 1;
}

void Adjustment::init_params(const SensorCalibration& start,
                             const std::vector<GraphComponent>& components) {
  if (options_.refine_registration) start_.color_from_depth = start.color_from_depth;
  if (options_.refine_timing) {
    start_.timing = start.timing;
    start_.motion = start.motion;
  }
  start_.color_from_depth.resize(cameras_, Pose::Identity());
  start_.timing.resize(cameras_);
  Eigen::Index numbers = 0;
  for (std::size_t n = 0; n < cameras_; ++n) {
    first_.push_back(numbers);
    numbers += spline_at;
    if (n < corrections_.size())
      numbers += static_cast<Eigen::Index>(corrections_[n].spline_m.size());
  }
  state_.camera_params = Eigen::VectorXd::Zero(numbers);
  for (std::size_t n = 0; n < cameras_; ++n) {
    double* const own = state_.camera_params.data() + first_[n];
    own[timing_at] = start_.timing[n].depth_delay_s;
    own[timing_at + 1] = start_.timing[n].rolling_shutter_s;
    if (options_.refine_intrinsics && n < start.intrinsics.size()) {
      const IntrinsicsStep& step = start.intrinsics[n];
      Eigen::Map<Eigen::Vector4d>(own + intrinsics_at) << step.fx_relative, step.fy_relative,
          step.cx_px, step.cy_px;
    }
    if (n >= corrections_.size() || n >= start.depth.size() ||
        !has_same_knots(corrections_[n], start.depth[n]))
      continue;
    std::copy(start.depth[n].radial.begin(), start.depth[n].radial.end(), own + radial_at);
    std::copy(start.depth[n].spline_m.begin(), start.depth[n].spline_m.end(), own + spline_at);
  }
  if (!options_.refine_timing) return;
  problem_.has_motion = true;
  const double count = static_cast<double>(std::max<std::size_t>(1, frames_.size()));
  for (const FrameFeatures& frame : frames_)
    mean_stamp_offset_s_ += frame.depth_stamp_offset_s / count;
  for (const FrameFeatures& frame : frames_)
    stamp_offset_deviation_s_ +=
        std::pow(frame.depth_stamp_offset_s - mean_stamp_offset_s_, 2) / count;
  stamp_offset_deviation_s_ = std::sqrt(stamp_offset_deviation_s_);
  const std::map<int, KnownMotion> between = relative_motions(frames_, state_.poses, components);
  for (const auto& [node, pose] : state_.poses) {
    const auto found = between.find(node);
    const KnownMotion known = found == between.end() ? KnownMotion{} : found->second;
    problem_.motion_mean.push_back(known.mean);
    problem_.motion_deviation.push_back(known.deviation);
    state_.motions.push_back(start_.motion.emplace(node, known.mean).first->second);
  }
}

// Points start at the mean of the frames' measurements.
void Adjustment::add_observations() {
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    const std::vector<Observation>& all = tracks_[t].observations;
    const auto views = std::count_if(all.begin(), all.end(),
                                     [&](const Observation& seen) { return has_pose(seen); });
    if (views < 2) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Observation& seen : all) {
      if (!has_pose(seen)) continue;
      const FrameFeatures& frame = frames_[seen.frame];
      const Feature& observed = feature(seen);
      sum += state_.poses.at(frame.node) * frame.point_in_base(seen.feature);
      problem_.observations.push_back(
          {row_.at(frame.node), cameras_ > 0 ? first_[observed.camera] : 0,
           CalibratedFeature(observed, frame.cameras[observed.camera], calibrated(seen))});
      if (cameras_ > 0) sees_[observed.camera] = true;
    }
    points_.push_back(t);
    problem_.begin.push_back(problem_.observations.size());
    state_.points.emplace_back(sum / static_cast<double>(views));
  }
  result_.observations = problem_.observations.size();
}

CalibratedObservation Adjustment::calibrated(const Observation& seen) const {
  CalibratedObservation calibrated;
  if (cameras_ == 0) return calibrated;
  const FrameFeatures& frame = frames_[seen.frame];
  const Feature& observed = feature(seen);
  const Camera& camera = frame.cameras[observed.camera];
  calibrated.intrinsics = options_.refine_intrinsics;
  calibrated.registration = options_.refine_registration;
  calibrated.timing = options_.refine_timing;
  if (options_.refine_depth && !corrections_[observed.camera].empty()) {
    calibrated.depth = true;
    calibrated.terms = corrections_[observed.camera].terms(static_cast<double>(observed.depth_m),
                                                           squared_radius_of(observed, camera));
  }
  if (options_.refine_registration || options_.refine_timing) {
    const RegisteredDepth depth =
        registered_depth(frame, observed, color_from_depth_of(frame, observed, start_));
    calibrated.has_depth = depth.known;
    calibrated.added_m = depth.added_m;
    calibrated.by_step = depth.by_step;
  }
  if (options_.refine_timing) {
    const CameraTiming& timing = start_.timing[observed.camera];
    calibrated.image_row_fraction = row_fraction(observed, camera);
    calibrated.depth_stamp_offset_s = frame.depth_stamp_offset_s;
    calibrated.known_step = (timing.depth_delay_s + frame.depth_stamp_offset_s -
                             timing.rolling_shutter_s * calibrated.image_row_fraction) *
                            motion_in_camera(camera, start_.motion.at(frame.node));
  }
  return calibrated;
}

void Adjustment::add_camera_priors(std::size_t camera, Priors& priors) {
  const auto add = [&](bool wanted, Eigen::Index at, const Eigen::VectorXd& means,
                       const Eigen::VectorXd& deviations) {
    if (!wanted || !sees_[camera]) return;
    priors.add_near(first_[camera] + at, means, deviations);
    for (Eigen::Index n = 0; n < means.size(); ++n) free_.push_back(first_[camera] + at + n);
  };
  add(options_.refine_intrinsics, intrinsics_at, Eigen::Vector4d::Zero(),
      Eigen::Vector4d(options_.focal_prior, options_.focal_prior, options_.center_prior_px,
                      options_.center_prior_px));
  Vector6d registration;
  registration << Eigen::Vector3d::Constant(registration_prior_m),
      Eigen::Vector3d::Constant(registration_prior_rad);
  add(options_.refine_registration, registration_at,
      step_between(start_.color_from_depth[camera], Pose::Identity()), registration);
  add(options_.refine_timing, timing_at,
      Eigen::Vector2d(options_.timing_mean.depth_delay_s, options_.timing_mean.rolling_shutter_s),
      Eigen::Vector2d::Constant(options_.bounds.frame_time_s));
  if (options_.refine_depth && !corrections_[camera].empty()) add_depth_priors(camera, priors);
}

// Priors: coefficients are small, the spline is smooth, and the mean depth is kept (depth_gauge).
void Adjustment::add_depth_priors(std::size_t camera, Priors& priors) {
  const DepthCorrection& depth = corrections_[camera];
  const auto knots = static_cast<Eigen::Index>(depth.spline_m.size());
  const Eigen::Index radial = first_[camera] + radial_at;
  const Eigen::Index spline = first_[camera] + spline_at;
  static_assert(radial_at + 3 == spline_at);
  const auto noise_at = [&](double z) { return options_.depth_noise.axial_at(z); };
  const auto knot_m = [&](Eigen::Index n) {
    return depth.first_m + static_cast<double>(n - 1) * depth.step_m;
  };
  Eigen::VectorXd deviations(3 + knots);
  const double middle_m = 0.5 * (depth.first_m + depth.last_m());
  deviations.head<3>() = noise_at(middle_m) * Eigen::Vector3d(1.0, 1.0, 1.0 / middle_m);
  for (Eigen::Index n = 0; n < knots; ++n)
    deviations[3 + n] = noise_at(std::max(depth.first_m, knot_m(n)));
  priors.add_near(radial, Eigen::VectorXd::Zero(3 + knots), options_.depth_prior * deviations);
  for (Eigen::Index n = 0; n < 3 + knots; ++n) free_.push_back(radial + n);
  for (Eigen::Index n = 0; n + 2 < knots; ++n)
    priors.add().segment<3>(spline + n) =
        Eigen::Vector3d(1.0, -2.0, 1.0) / (options_.depth_smoothness_prior * deviations[4 + n]);
  Eigen::VectorXd& gauge = priors.add();
  double count = 0.0;
  for (const FrameFeatures& frame : frames_)
    for (const Feature& observed : frame.features) {
      if (observed.camera != camera) continue;
      const auto z = static_cast<double>(observed.depth_m);
      const DepthCorrection::Terms terms =
          depth.terms(z, squared_radius_of(observed, frame.cameras[camera]));
      gauge.segment<4>(spline + static_cast<Eigen::Index>(terms.first)) +=
          Eigen::Map<const Eigen::Vector4d>(terms.spline.data()) / z;
      gauge.segment<3>(radial) += Eigen::Map<const Eigen::Vector3d>(terms.radial.data()) / z;
      count += 1.0;
    }
  gauge /= count * depth_gauge;
}

// Only the product of time and motion is observable. Motions are correct on average if their
// regression on the motions between poses has slope 1. The latter miss the tremor of the hand, so
// that least squares with both as measurements overestimates times.
double Adjustment::motion_scale() const {
  // Varying delays of the stamps determine the scale.
  if (!problem_.has_motion || problem_.fix_cameras ||
      stamp_offset_deviation_s_ > observable_delay_s)
    return 1.0;
  double mixed = 0.0;
  double squares = 0.0;
  for (std::size_t n = 0; n < state_.motions.size(); ++n) {
    const Vector6d weight = problem_.motion_deviation[n].array().square().inverse();
    const Vector6d& between = problem_.motion_mean[n];
    mixed += between.dot(weight.cwiseProduct(state_.motions[n]));
    squares += between.dot(weight.cwiseProduct(between));
  }
  return mixed > 0.0 && squares > 0.0 ? mixed / squares : 1.0;
}

SensorCalibration Adjustment::calibration(const JointState& state, double motion_scale) const {
  SensorCalibration found;
  for (std::size_t n = 0; n < cameras_; ++n) {
    const double* own = state.camera_params.data() + first_[n];
    const double* step = own + intrinsics_at;
    if (options_.refine_intrinsics)
      found.intrinsics.push_back({step[0], step[1], step[2], step[3]});
    if (options_.refine_registration)
      found.color_from_depth.push_back(
          moved(Pose::Identity(), Eigen::Map<const Vector6d>(own + registration_at)) *
          start_.color_from_depth[n]);
    if (options_.refine_timing)
      found.timing.push_back(
          {motion_scale * (own[timing_at] + mean_stamp_offset_s_) - mean_stamp_offset_s_,
           motion_scale * own[timing_at + 1]});
    if (options_.refine_depth) {
      found.depth.push_back(corrections_[n]);
      std::copy_n(own + radial_at, 3, found.depth[n].radial.begin());
      std::copy_n(own + spline_at, corrections_[n].spline_m.size(),
                  found.depth[n].spline_m.begin());
    }
  }
  for (const FrameFeatures& frame : frames_)
    if (const auto entry = row_.find(frame.node); problem_.has_motion && entry != row_.end())
      found.motion.emplace(frame.node, state.motions[entry->second] / motion_scale);
  return found;
}

void Adjustment::find_alternatives() {
  const Eigen::Index size = problem_.has_motion ? 12 : 6;
  const auto poses = static_cast<Eigen::Index>(state_.poses.size());
  FreeRows rows;
  for (Eigen::Index n = 0; n < poses; ++n) {
    if (!problem_.fixed[static_cast<std::size_t>(n)]) rows.poses.push_back(size * n);
    for (Eigen::Index k = 6; k < size; ++k) rows.params.push_back(size * n + k);
  }
  for (const Eigen::Index number : free_) rows.params.push_back(size * poses + number);
  const double scale = motion_scale();
  const Eigen::MatrixXd information =
      joint_system(problem_, state_).matrix.selfadjointView<Eigen::Lower>();
  const CalibrationModes modes = calibration_modes(information, rows, options_.alternatives);
  if (modes.deviations.size() > 0) {
    JointState spread = state_;
    spread.camera_params.setZero();
    spread.camera_params(free_) = modes.deviations.tail(static_cast<Eigen::Index>(free_.size()));
    result_.deviations = calibration(spread, scale);
    for (CameraTiming& timing : result_.deviations.timing)
      timing.depth_delay_s += (1.0 - scale) * mean_stamp_offset_s_;
  }
  for (const Eigen::VectorXd& change : modes.changes) {
    JointState other = state_;
    for (std::size_t n = 0; n < rows.params.size(); ++n) {
      const Eigen::Index row = rows.params[n];
      const double by = change[static_cast<Eigen::Index>(n)];
      if (row < size * poses)
        other.motions[static_cast<std::size_t>(row / size)][row % size - 6] += by;
      else
        other.camera_params[row - size * poses] += by;
    }
    result_.alternatives.push_back(calibration(other, scale));
  }
}

BundleAdjustmentResult Adjustment::run(const std::vector<GraphLinkResult>& links) {
  problem_.links = links;
  if (result_.observations > 0) {
    const LeastSquaresSummary summary =
        adjust_jointly(problem_, state_, options_.max_iterations, options_.tolerance);
    result_.initial_cost = summary.initial_cost;
    result_.final_cost = summary.final_cost;
    result_.iterations = summary.iterations;
    result_.converged = true;  // the cost never increases
  }
  result_.map_from_base = state_.poses;
  result_.points.assign(tracks_.size(), Eigen::Vector3d::Zero());
  for (std::size_t n = 0; n < points_.size(); ++n) result_.points[points_[n]] = state_.points[n];
  if (cameras_ > 0) result_.calibration = calibration(state_, motion_scale());
  if (options_.alternatives > 0 && cameras_ > 0) find_alternatives();
  return std::move(result_);
}

}  // namespace

BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options,
    const std::vector<FeatureTrack>& system_tracks, const SensorCalibration& start) {
  check_parameters(options);
  BundleAdjustmentResult result =
      Adjustment(frames, tracks, map_from_base, components, options, start).run(links);
  if (!options.with_information) return result;
  if (system_tracks.empty())
    add_information(frames, tracks, links, options, result, result.points);
  else
    add_information(frames, system_tracks, links, options, result);
  return result;
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
  FeatureTracks sparse;
  if (map_from_base.size() >= dense_below)
    sparse = build_tracks(frames, feature_links, TrackFrames::linked);
  if (map_from_base.size() >= dense_below && !options.refines_cameras()) {
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
