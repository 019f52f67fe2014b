#include "libmap/refine/bundle_adjustment.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/pose_residuals.h"

namespace libmap {

namespace {

constexpr std::size_t dense_below = 120;  // poses: the Schur complement of more is never formed
constexpr int point_steps = 3;

// x, y in the picture and depth, in standard deviations. The intrinsics are steps away from those
// by which the feature's ray was made: of fx and fy in parts, of cx and cy in pixels.
class ObservationResidual {
 public:
  ObservationResidual(const Feature& feature, const Camera& camera)
      : camera_from_base_(Eigen::Quaterniond(camera.base_from_camera.linear()).conjugate()),
        origin_(camera.base_from_camera.inverse().translation()),
        ray_(feature.ray.cast<double>()),
        depth_(static_cast<double>(feature.depth_m)),
        fx_(camera.fx),
        fy_(camera.fy),
        pixel_noise_(static_cast<double>(feature.pixel_noise_px)),
        depth_noise_(static_cast<double>(feature.depth_noise_m)) {}

  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    const std::array<T, 4> none = {T(0), T(0), T(0), T(0)};
    return (*this)(pose, point, none.data(), residual);
  }

  template <typename T>
  bool operator()(const T* pose, const T* point, const T* intrinsics, T* residual) const {
    const PoseView<T> base(pose);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> in_map(point);
    const Eigen::Matrix<T, 3, 1> in_base =
        base.rotation.conjugate() * Eigen::Matrix<T, 3, 1>(in_map - base.translation);
    const Eigen::Matrix<T, 3, 1> in_camera =
        camera_from_base_.cast<T>() * in_base + origin_.template cast<T>();
    if (in_camera.z() < T(1e-3)) return false;
    const T x = in_camera.x() / in_camera.z();
    const T y = in_camera.y() / in_camera.z();
    residual[0] =
        (T(fx_) * ((T(1) + intrinsics[0]) * x - T(ray_.x())) + intrinsics[2]) / T(pixel_noise_);
    residual[1] =
        (T(fy_) * ((T(1) + intrinsics[1]) * y - T(ray_.y())) + intrinsics[3]) / T(pixel_noise_);
    residual[2] = (in_camera.z() - T(depth_)) / T(depth_noise_);
    return true;
  }

 private:
  Eigen::Quaterniond camera_from_base_;
  Eigen::Vector3d origin_;
  Eigen::Vector2d ray_;
  double depth_;
  double fx_;
  double fy_;
  double pixel_noise_;
  double depth_noise_;
};

class IntrinsicsPrior {
 public:
  IntrinsicsPrior(double focal, double center_px) : focal_(focal), center_(center_px) {}
  template <typename T>
  bool operator()(const T* intrinsics, T* residual) const {
    residual[0] = intrinsics[0] / T(focal_);
    residual[1] = intrinsics[1] / T(focal_);
    residual[2] = intrinsics[2] / T(center_);
    residual[3] = intrinsics[3] / T(center_);
    return true;
  }

 private:
  double focal_;
  double center_;
};

// Residual of an observation with its derivatives by a step of the pose and by the point.
struct Linearized {
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6> by_pose;
  Eigen::Matrix3d by_point;
};

Linearized linearize(const Feature& feature, const Camera& camera, const Pose& map_from_base,
                     const Eigen::Vector3d& point) {
  const Pose camera_from_base = camera.base_from_camera.inverse();
  const Eigen::Vector3d in_base = map_from_base.inverse() * point;
  const Eigen::Vector3d p = camera_from_base * in_base;
  Eigen::Matrix3d projection;
  projection << camera.fx / p.z(), 0.0, -camera.fx * p.x() / (p.z() * p.z()), 0.0,
      camera.fy / p.z(), -camera.fy * p.y() / (p.z() * p.z()), 0.0, 0.0, 1.0;
  const double pixel = 1.0 / static_cast<double>(feature.pixel_noise_px);
  const double depth = 1.0 / static_cast<double>(feature.depth_noise_m);
  const Eigen::Vector3d weight(pixel, pixel, depth);
  const Eigen::Matrix3d by_base = weight.asDiagonal() * projection * camera_from_base.linear();
  Linearized result;
  result.residual = weight.cwiseProduct(
      Eigen::Vector3d(camera.fx * (p.x() / p.z() - static_cast<double>(feature.ray.x())),
                      camera.fy * (p.y() / p.z() - static_cast<double>(feature.ray.y())),
                      p.z() - static_cast<double>(feature.depth_m)));
  // A step of the pose moves the point against it: d in_base = -t + [in_base]x r.
  result.by_pose.leftCols<3>() = -by_base;
  result.by_pose.rightCols<3>() = by_base * cross_matrix(in_base);
  result.by_point = by_base * map_from_base.linear().transpose();
  return result;
}

Eigen::Vector2f moved_ray(const Feature& feature, const Camera& camera,
                          const IntrinsicsStep& step) {
  const Eigen::Vector2d ray = feature.ray.cast<double>();
  return Eigen::Vector2d((camera.fx * ray.x() - step.cx_px) / (camera.fx * (1.0 + step.fx_share)),
                         (camera.fy * ray.y() - step.cy_px) / (camera.fy * (1.0 + step.fy_share)))
      .cast<float>();
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
        cameras_(options.refine_intrinsics ? max_cameras(frames) : 0),
        blocks_(poses, 4 * cameras_) {
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
  Eigen::Vector3d place_of(const FeatureTrack& track) const;
  // The observation as the refined intrinsics have it.
  Linearized linearized(const Observation& seen, const Eigen::Vector3d& point) const;
  double weight_of(const Linearized& l) const {
    return 1.0 / (1.0 + l.residual.squaredNorm() / (options_.robust_scale * options_.robust_scale));
  }
  void add_observations(ceres::Problem& problem);
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
  std::size_t cameras_ = 0;  // with intrinsics to refine
  PoseBlocks blocks_;        // then a step of four numbers a camera
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

void Adjustment::add_observations(ceres::Problem& problem) {
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    std::size_t views = 0;
    for (const Observation& seen : tracks_[t].observations) views += has_pose(seen) ? 1 : 0;
    if (views < 2) continue;
    ++result_.tracks;
    for (const Observation& seen : tracks_[t].observations) {
      if (!has_pose(seen)) continue;
      ++result_.observations;
      const Feature& its = feature(seen);
      auto* residual = new ObservationResidual(its, frames_[seen.frame].cameras[its.camera]);
      auto* loss = new ceres::CauchyLoss(options_.robust_scale);
      double* pose = blocks_.at(frames_[seen.frame].node);
      if (options_.refine_intrinsics)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ObservationResidual, 3, 7, 3, 4>(residual), loss, pose,
            points_[t].data(), intrinsics(its.camera));
      else
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ObservationResidual, 3, 7, 3>(residual), loss, pose,
            points_[t].data());
    }
  }
  for (std::size_t n = 0; n < cameras_; ++n)
    if (problem.HasParameterBlock(intrinsics(n)))
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<IntrinsicsPrior, 4, 4>(
              new IntrinsicsPrior(options_.focal_prior, options_.center_prior_px)),
          nullptr, intrinsics(n));
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
}

Camera moved(Camera camera, const IntrinsicsStep& step) {
  camera.fx *= 1.0 + step.fx_share;
  camera.fy *= 1.0 + step.fy_share;
  camera.cx += step.cx_px;
  camera.cy += step.cy_px;
  return camera;
}

void move_intrinsics(FrameFeatures& frame, const std::vector<IntrinsicsStep>& steps) {
  for (Feature& feature : frame.features)
    feature.ray = moved_ray(feature, frame.cameras[feature.camera], steps[feature.camera]);
  for (std::size_t n = 0; n < frame.cameras.size(); ++n)
    frame.cameras[n] = moved(frame.cameras[n], steps[n]);
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
