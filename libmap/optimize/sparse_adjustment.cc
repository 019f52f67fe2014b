#include "libmap/optimize/sparse_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/features/frame_calibration.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/optimize/graph_links.h"
#include "libmap/optimize/joint_adjustment.h"

namespace libmap {

namespace {

constexpr int point_iterations = 3;
constexpr std::size_t tracks_per_task = 1000;
constexpr std::size_t max_parallel_tasks = 8;  // the system of each task is in memory
constexpr double fixed_weight = 1e12;
// Damping is added to the diagonal.
constexpr LevenbergMarquardtOptions levenberg_marquardt_options = {.tolerance = 1e-6,
                                                                   .rounding = 1e-9,
                                                                   .first_damping = 1e-6,
                                                                   .min_damping = 1e-6,
                                                                   .raised_damping = 1.0};

// Observations of tracks by frames with a pose.
class TrackObservations {
 public:
  TrackObservations(const std::vector<FrameFeatures>& frames,
                    const std::map<int, Pose>& map_from_base)
      : frames_(frames), view_(map_from_base), row_of_(frames.size(), none) {
    std::map<int, std::size_t> rows;
    for (const auto& [node, pose] : map_from_base) rows.emplace(node, rows.size());
    for (std::size_t f = 0; f < frames.size(); ++f)
      if (const auto row = rows.find(frames[f].node); row != rows.end()) row_of_[f] = row->second;
  }

  const BundleView& view() const { return view_; }
  // Observations of a track; empty if fewer than two have a pose.
  std::vector<BundleObservation> of(const FeatureTrack& track) const {
    std::vector<BundleObservation> all;
    for (const Observation& seen : track.observations) {
      if (row_of_[seen.frame] == none) continue;
      const FrameFeatures& frame = frames_[seen.frame];
      const Feature& feature = frame.features[seen.feature];
      all.push_back(
          {row_of_[seen.frame], 0, CalibratedFeature(feature, frame.cameras[feature.camera], {})});
    }
    if (all.size() < 2) all.clear();
    return all;
  }

 private:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

  const std::vector<FrameFeatures>& frames_;
  BundleView view_;
  std::vector<std::size_t> row_of_;
};

}  // namespace

TrackSystem::TrackSystem(const std::vector<FrameFeatures>& frames,
                         const std::vector<FeatureTrack>& tracks, double robust_scale)
    : frames_(frames), tracks_(tracks), robust_scale_(robust_scale) {}

std::vector<Eigen::Vector3d> TrackSystem::points_at(
    const std::map<int, Pose>& map_from_base) const {
  std::vector<Eigen::Vector3d> points(tracks_.size(), Eigen::Vector3d::Zero());
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    double count = 0.0;
    for (const Observation& seen : tracks_[t].observations) {
      const auto pose = map_from_base.find(frames_[seen.frame].node);
      if (pose == map_from_base.end()) continue;
      points[t] += pose->second * frames_[seen.frame].point_in_base(seen.feature);
      count += 1.0;
    }
    if (count > 0.0) points[t] /= count;
  }
  optimize_points(map_from_base, points);
  return points;
}

void TrackSystem::optimize_points(const std::map<int, Pose>& map_from_base,
                                  std::vector<Eigen::Vector3d>& points) const {
  const TrackObservations seen(frames_, map_from_base);
  parallel_each(tracks_.size(), tracks_per_task, [&](std::size_t t) {
    optimize_point(seen.of(tracks_[t]), seen.view(), robust_scale_, point_iterations, points[t]);
  });
}

TrackSystem::Totals TrackSystem::totals(const std::map<int, Pose>& map_from_base,
                                        const std::vector<Eigen::Vector3d>& points) const {
  const TrackObservations seen(frames_, map_from_base);
  return parallel_reduce(
      tracks_.size(), tracks_per_task, Totals{},
      [&](std::size_t begin, std::size_t end) {
        Totals sum;
        CalibratedResidual at;
        for (std::size_t t = begin; t < end; ++t) {
          const std::vector<BundleObservation> all = seen.of(tracks_[t]);
          sum.tracks += all.empty() ? 0 : 1;
          sum.observations += all.size();
          for (const BundleObservation& observation : all) {
            sum.cost += seen.view().cost(observation, points[t], robust_scale_, at);
            if (robust_weight(at.residual, robust_scale_) < 0.5) {
              ++sum.outliers;
              continue;
            }
            const Eigen::Vector3d error = observation.feature.unweighted(at.residual);
            sum.pixel_squares += 0.5 * error.head<2>().squaredNorm();
            sum.depth_squares += error.z() * error.z();
          }
        }
        return sum;
      },
      [](Totals a, const Totals& b) {
        a.cost += b.cost;
        a.tracks += b.tracks;
        a.observations += b.observations;
        a.outliers += b.outliers;
        a.pixel_squares += b.pixel_squares;
        a.depth_squares += b.depth_squares;
        return a;
      });
}

BlockSystem TrackSystem::system(const std::map<int, Pose>& map_from_base,
                                const std::vector<Eigen::Vector3d>& points) const {
  const TrackObservations seen(frames_, map_from_base);
  const auto add_track = [&](std::size_t track, BlockSystem& system) {
    PointSchur<6, BlockSystem> schur;
    CalibratedResidual at;
    for (const BundleObservation& observation : seen.of(tracks_[track]))
      if (seen.view().evaluate(observation, points[track], at, true))
        schur.add(observation, at, robust_weight(at.residual, robust_scale_), system);
    schur.eliminate(system);
  };
  BlockSystem all(map_from_base.size());
  constexpr std::size_t group = tracks_per_task * max_parallel_tasks;
  for (std::size_t first = 0; first < tracks_.size(); first += group) {
    const std::size_t count = std::min(group, tracks_.size() - first);
    std::vector<BlockSystem> parts((count - 1) / tracks_per_task + 1, BlockSystem(all.size()));
    parallel_each(parts.size(), [&](std::size_t n) {
      const std::size_t end = std::min(first + count, first + (n + 1) * tracks_per_task);
      for (std::size_t t = first + n * tracks_per_task; t < end; ++t) add_track(t, parts[n]);
    });
    for (const BlockSystem& part : parts) all.add(part);
  }
  return all;
}

void TrackSystem::Totals::add_to(BundleAdjustmentResult& result) const {
  result.tracks = tracks;
  result.observations = observations;
  result.outliers = outliers;
  const double kept = std::max(1.0, static_cast<double>(observations - outliers));
  result.reprojection_rms_px = std::sqrt(pixel_squares / kept);
  result.depth_rms_m = std::sqrt(depth_squares / kept);
}

namespace {

// Problem for levenberg_marquardt, starting from the state in `result`.
class SparseSolver {
 public:
  SparseSolver(const TrackSystem& observed, const std::vector<GraphLinkResult>& links,
               const std::vector<GraphComponent>& components, BundleAdjustmentResult& result,
               Progress& progress)
      : observed_(observed), links_(links), result_(result), progress_(progress) {
    std::set<int> gauges;
    for (const GraphComponent& component : components) gauges.insert(component.gauge_node);
    for (const auto& [node, pose] : result.map_from_base) fixed_.push_back(gauges.contains(node));
    result.points = observed.points_at(result.map_from_base);
  }

  double cost(const std::map<int, Pose>& poses, const std::vector<Eigen::Vector3d>& points) const {
    return observed_.totals(poses, points).cost + link_cost(poses, links_);
  }
  void linearize() {
    result_.information = observed_.system(result_.map_from_base, result_.points);
    result_.information.add(all_link_system(result_.map_from_base, links_));
  }
  double propose(double damping);
  void accept() {
    result_.map_from_base = std::move(poses_);
    result_.points = std::move(points_);
  }

 private:
  const TrackSystem& observed_;
  const std::vector<GraphLinkResult>& links_;
  BundleAdjustmentResult& result_;
  Progress& progress_;
  std::vector<bool> fixed_;  // by row
  std::map<int, Pose> poses_;
  std::vector<Eigen::Vector3d> points_;
};

double SparseSolver::propose(double damping) {
  progress_.advance(1);
  BlockSystem bound = result_.information;
  for (std::size_t row = 0; row < fixed_.size(); ++row)
    if (fixed_[row]) bound.add(row, row, fixed_weight * Matrix6d::Identity());
  const BlockSolver solver(bound, damping);
  if (!solver.valid()) return std::numeric_limits<double>::infinity();
  const std::vector<Vector6d> steps = solver.solve(bound.rhs());
  poses_ = result_.map_from_base;
  std::size_t row = 0;
  for (auto& [node, pose] : poses_) {
    if (!fixed_[row]) pose = moved(pose, steps[row]);
    ++row;
  }
  points_ = result_.points;
  observed_.optimize_points(poses_, points_);
  return cost(poses_, points_);
}

}  // namespace

BundleAdjustmentResult adjust_sparse(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureTrack>& tracks,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options, Progress& progress) {
  BundleAdjustmentResult result;
  result.map_from_base = map_from_base;
  const TrackSystem observed(frames, tracks, options.robust_scale);
  SparseSolver solver(observed, links, components, result, progress);
  LevenbergMarquardtOptions settings = levenberg_marquardt_options;
  settings.max_iterations = options.max_iterations;
  progress.begin("bundle adjustment", static_cast<std::size_t>(options.max_iterations));
  const LeastSquaresSummary summary =
      levenberg_marquardt(solver, solver.cost(result.map_from_base, result.points), settings);
  progress.end();
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.iterations = summary.iterations;
  result.converged = summary.accepted > 0;
  observed.totals(result.map_from_base, result.points).add_to(result);
  result.information = observed.system(result.map_from_base, result.points);
  result.information.add(link_system(result.map_from_base, links));
  result.information.clear_rhs();
  return result;
}

void add_information(const std::vector<FrameFeatures>& frames,
                     const std::vector<FeatureTrack>& tracks,
                     const std::vector<GraphLinkResult>& links,
                     const BundleAdjustmentOptions& options, BundleAdjustmentResult& result,
                     const std::vector<Eigen::Vector3d>& points) {
  std::vector<FrameFeatures> calibrated;
  if (!result.calibration.empty())
    for (const FrameFeatures& frame : frames)
      calibrated.push_back(calibrated_features(frame, result.calibration));
  const TrackSystem observed(calibrated.empty() ? frames : calibrated, tracks,
                             options.robust_scale);
  const std::vector<Eigen::Vector3d> at =
      points.empty() ? observed.points_at(result.map_from_base) : points;
  observed.totals(result.map_from_base, at).add_to(result);
  result.information = observed.system(result.map_from_base, at);
  result.information.add(link_system(result.map_from_base, links));
  result.information.clear_rhs();
}

}  // namespace libmap
