#include "libmap/refine/sparse_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/link_terms.h"

namespace libmap {

namespace {

constexpr int settling_steps = 3;
constexpr std::size_t tracks_a_task = 1000;
constexpr std::size_t tasks_at_once = 8;  // whose systems are in memory
constexpr double settled_cost = 1e-6;     // share by which a step lowers the cost
constexpr double least_damping = 1e-6;
constexpr double held_weight = 1e12;
constexpr double cost_rounding = 1e-9;  // of a cost
constexpr int max_rejected = 8;

// The observations of one track by frames with a pose.
struct Seen {
  std::size_t row = 0;  // of the pose
  const Pose* pose = nullptr;
  const Feature* feature = nullptr;
  const Camera* camera = nullptr;
};

class Poses {
 public:
  Poses(const std::vector<FrameFeatures>& frames, const std::map<int, Pose>& map_from_base)
      : frames_(frames), pose_of_(frames.size(), nullptr), row_of_(frames.size(), 0) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const auto pose = map_from_base.find(frames[f].node);
      if (pose == map_from_base.end()) continue;
      pose_of_[f] = &pose->second;
      row_of_[f] = static_cast<std::size_t>(std::distance(map_from_base.begin(), pose));
    }
  }

  std::vector<Seen> of(const FeatureTrack& track) const {
    std::vector<Seen> seen;
    for (const Observation& observation : track.observations) {
      const FrameFeatures& frame = frames_[observation.frame];
      const Feature& feature = frame.features[observation.feature];
      if (pose_of_[observation.frame] != nullptr)
        seen.push_back({row_of_[observation.frame], pose_of_[observation.frame], &feature,
                        &frame.cameras[feature.camera]});
    }
    if (seen.size() < 2) seen.clear();
    return seen;
  }

 private:
  const std::vector<FrameFeatures>& frames_;
  std::vector<const Pose*> pose_of_;
  std::vector<std::size_t> row_of_;
};

double weight_of(const Eigen::Vector3d& residual, double scale) {
  return 1.0 / (1.0 + residual.squaredNorm() / (scale * scale));
}

Linearized linearize(const Seen& seen, const Eigen::Vector3d& point) {
  return linearize(*seen.feature, *seen.camera, *seen.pose, point);
}

void settle_point(const std::vector<Seen>& all, double scale, Eigen::Vector3d& point) {
  for (int step = 0; step < settling_steps; ++step) {
    Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
    Eigen::Vector3d side = Eigen::Vector3d::Zero();
    for (const Seen& seen : all) {
      const Linearized l = linearize(seen, point);
      const double weight = weight_of(l.residual, scale);
      of_point += weight * l.by_point.transpose() * l.by_point;
      side -= weight * l.by_point.transpose() * l.residual;
    }
    const Eigen::Vector3d move = of_point.ldlt().solve(side);
    if (!move.allFinite()) return;
    point += move;
  }
}

// The track's share of the normal equations, its point eliminated.
void add_track(const std::vector<Seen>& all, const Eigen::Vector3d& point, double scale,
               BlockSystem& system) {
  Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_side = Eigen::Vector3d::Zero();
  std::vector<std::pair<std::size_t, Eigen::Matrix<double, 6, 3>>> mixed;
  for (const Seen& seen : all) {
    const Linearized l = linearize(seen, point);
    const double weight = weight_of(l.residual, scale);
    system.add(seen.row, seen.row, weight * l.by_pose.transpose() * l.by_pose);
    system.add_side(seen.row, -weight * l.by_pose.transpose() * l.residual);
    of_point += weight * l.by_point.transpose() * l.by_point;
    point_side -= weight * l.by_point.transpose() * l.residual;
    mixed.emplace_back(seen.row, weight * l.by_pose.transpose() * l.by_point);
  }
  const Eigen::Matrix3d inverse = of_point.inverse();
  for (std::size_t a = 0; a < mixed.size(); ++a) {
    const Eigen::Matrix<double, 6, 3> reduced = mixed[a].second * inverse;
    system.add_side(mixed[a].first, -reduced * point_side);
    for (std::size_t b = a; b < mixed.size(); ++b)
      system.add(mixed[a].first, mixed[b].first, -reduced * mixed[b].second.transpose());
  }
}

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
  settle(map_from_base, points);
  return points;
}

void TrackSystem::settle(const std::map<int, Pose>& map_from_base,
                         std::vector<Eigen::Vector3d>& points) const {
  const Poses poses(frames_, map_from_base);
  parallel_for(tracks_.size(), tracks_a_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t)
      settle_point(poses.of(tracks_[t]), robust_scale_, points[t]);
  });
}

TrackSystem::Totals TrackSystem::totals(const std::map<int, Pose>& map_from_base,
                                        const std::vector<Eigen::Vector3d>& points) const {
  const Poses poses(frames_, map_from_base);
  const double square = robust_scale_ * robust_scale_;
  return parallel_reduce(
      tracks_.size(), tracks_a_task, Totals{},
      [&](std::size_t begin, std::size_t end) {
        Totals sum;
        for (std::size_t t = begin; t < end; ++t) {
          const std::vector<Seen> all = poses.of(tracks_[t]);
          sum.tracks += all.empty() ? 0 : 1;
          for (const Seen& seen : all) {
            const Eigen::Vector3d residual = linearize(seen, points[t]).residual;
            sum.cost += 0.5 * square * std::log1p(residual.squaredNorm() / square);
            ++sum.observations;
            if (weight_of(residual, robust_scale_) < 0.5) {
              ++sum.outliers;
              continue;
            }
            const auto pixel = static_cast<double>(seen.feature->pixel_noise_px);
            const auto depth = static_cast<double>(seen.feature->depth_noise_m);
            sum.pixel_squares += 0.5 * residual.head<2>().squaredNorm() * pixel * pixel;
            sum.depth_squares += residual.z() * residual.z() * depth * depth;
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
  const Poses poses(frames_, map_from_base);
  BlockSystem all(map_from_base.size());
  constexpr std::size_t group = tracks_a_task * tasks_at_once;
  for (std::size_t first = 0; first < tracks_.size(); first += group) {
    const std::size_t count = std::min(group, tracks_.size() - first);
    std::vector<BlockSystem> parts((count - 1) / tracks_a_task + 1, BlockSystem(all.size()));
    parallel_each(parts.size(), [&](std::size_t n) {
      const std::size_t end = std::min(first + count, first + (n + 1) * tracks_a_task);
      for (std::size_t t = first + n * tracks_a_task; t < end; ++t)
        if (const std::vector<Seen> seen = poses.of(tracks_[t]); !seen.empty())
          add_track(seen, points[t], robust_scale_, parts[n]);
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

// Levenberg and Marquardt's steps from the result as it is.
class SparseAdjustment {
 public:
  SparseAdjustment(const TrackSystem& observed, const std::vector<GraphLinkResult>& links,
                   const std::vector<GraphComponent>& components, BundleAdjustmentResult& result)
      : observed_(observed), links_(links), result_(result) {
    std::set<int> gauges;
    for (const GraphComponent& component : components) gauges.insert(component.gauge_node);
    for (const auto& [node, pose] : result.map_from_base) held_.push_back(gauges.contains(node));
    result.points = observed.points_at(result.map_from_base);
    result.initial_cost = result.final_cost = cost_at(result.map_from_base, result.points);
    result.information = system();
  }

  void run(int max_iterations, Progress& progress) {
    progress.begin("bundle adjustment", static_cast<std::size_t>(max_iterations));
    int rejected = 0;
    while (result_.iterations < max_iterations && rejected < max_rejected) {
      ++result_.iterations;
      progress.advance(1);
      const double before = result_.final_cost;
      if (!step()) {
        damping_ = std::max(1.0, 100.0 * damping_);
        ++rejected;
        continue;
      }
      damping_ = std::max(least_damping, 0.1 * damping_);
      rejected = 0;
      result_.converged = true;
      if (before - result_.final_cost < settled_cost * before) break;
    }
    progress.end();
  }

 private:
  double cost_at(const std::map<int, Pose>& poses,
                 const std::vector<Eigen::Vector3d>& points) const {
    return observed_.totals(poses, points).cost + link_cost(poses, links_);
  }
  BlockSystem system() const {
    BlockSystem system = observed_.system(result_.map_from_base, result_.points);
    system.add(all_link_system(result_.map_from_base, links_));
    return system;
  }
  bool step();

  const TrackSystem& observed_;
  const std::vector<GraphLinkResult>& links_;
  BundleAdjustmentResult& result_;
  std::vector<bool> held_;  // by row
  double damping_ = least_damping;
};

// False, and nothing changed, where the cost would rise by more than rounding.
bool SparseAdjustment::step() {
  BlockSystem bound = result_.information;
  for (std::size_t row = 0; row < held_.size(); ++row)
    if (held_[row]) bound.add(row, row, held_weight * Matrix6d::Identity());
  const BlockSolver solver(bound, damping_);
  if (!solver.valid()) return false;
  const std::vector<Vector6d> steps = solver.solve(bound.side());
  std::map<int, Pose> poses = result_.map_from_base;
  std::size_t row = 0;
  for (auto& [node, pose] : poses) {
    if (!held_[row]) pose = moved(pose, steps[row]);
    ++row;
  }
  std::vector<Eigen::Vector3d> points = result_.points;
  observed_.settle(poses, points);
  const double cost = cost_at(poses, points);
  if (!(cost <= (1.0 + cost_rounding) * result_.final_cost)) return false;
  result_.map_from_base = std::move(poses);
  result_.points = std::move(points);
  result_.final_cost = cost;
  result_.information = system();
  return true;
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
  SparseAdjustment(observed, links, components, result).run(options.max_iterations, progress);
  observed.totals(result.map_from_base, result.points).add_to(result);
  if (std::any_of(links.begin(), links.end(),
                  [](const GraphLinkResult& link) { return is_absolute(link.link); })) {
    result.information = observed.system(result.map_from_base, result.points);
    result.information.add(link_system(result.map_from_base, links));
  }
  result.information.clear_side();
  return result;
}

}  // namespace libmap
