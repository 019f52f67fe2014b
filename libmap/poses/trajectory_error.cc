#include "libmap/poses/trajectory_error.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/pose.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/poses/stamp_pairing.h"

namespace libmap {

namespace {

struct PosePair {
  Pose estimate;
  Pose truth;
};

bool knows_nodes(const Trajectory& trajectory) {
  return std::all_of(trajectory.begin(), trajectory.end(),
                     [](const TrajectoryPose& pose) { return pose.node > 0; });
}

std::vector<PosePair> pair_by_node(const Trajectory& estimate, const Trajectory& truth) {
  std::map<int, const Pose*> truth_of_node;
  for (const TrajectoryPose& pose : truth) truth_of_node.emplace(pose.node, &pose.world_from_base);
  std::vector<PosePair> pairs;
  for (const TrajectoryPose& pose : estimate) {
    const auto entry = truth_of_node.find(pose.node);
    if (entry != truth_of_node.end()) pairs.push_back({pose.world_from_base, *entry->second});
  }
  return pairs;
}

std::vector<double> stamps_of(const Trajectory& trajectory) {
  std::vector<double> stamps;
  for (const TrajectoryPose& pose : trajectory) stamps.push_back(pose.stamp_s);
  return stamps;
}

std::vector<PosePair> pair_poses(const Trajectory& estimate, const Trajectory& truth) {
  if (knows_nodes(estimate) && knows_nodes(truth)) return pair_by_node(estimate, truth);
  std::vector<PosePair> pairs;
  for (const auto& [i, j] :
       pair_by_stamp(stamps_of(estimate), stamps_of(truth), pairing_tolerance_s))
    pairs.push_back({estimate[i].world_from_base, truth[j].world_from_base});
  return pairs;
}

double angle_deg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::Quaterniond(a).angularDistance(Eigen::Quaterniond(b)) * 180.0 / M_PI;
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

// Both vectors must have the same size, at least 1.
TrajectoryError summarize(const std::vector<double>& distances_m,
                          const std::vector<double>& angles_deg) {
  TrajectoryError error;
  error.poses = distances_m.size();
  const double count = static_cast<double>(error.poses);
  for (const double distance : distances_m) {
    error.mean_m += distance / count;
    error.rmse_m += distance * distance / count;
    error.max_m = std::max(error.max_m, distance);
  }
  error.rmse_m = std::sqrt(error.rmse_m);
  error.median_m = median_of(distances_m);
  for (const double angle : angles_deg) {
    error.mean_rotation_deg += angle / count;
    error.max_rotation_deg = std::max(error.max_rotation_deg, angle);
  }
  return error;
}

// Root mean square residuals over all pairs.
struct AlignmentResiduals {
  double position_m = 0.0;
  double rotation_rad = 0.0;  // chordal
};

// Returns the columns minus their mean.
Eigen::Matrix3Xd centered(const Eigen::Matrix3Xd& positions) {
  return positions.colwise() - positions.rowwise().mean();
}

// Bounds of the lever: the distance at which a rotation residual has the weight of a position
// residual of the same arc length.
struct LeverRange {
  double min_m;  // far below any real ratio; rotations determine the remaining directions
  double max_m;
};

// Root mean square distance of a path from its longest axis above which only positions are used for
// the alignment, as in the literature.
constexpr double decisive_width_m = 0.5;

LeverRange lever_range(const Eigen::Matrix3Xd& from) {
  const Eigen::Vector3d squares =
      symmetric_eigen(Eigen::Matrix3d(from * from.transpose())).values.cwiseMax(0.0) /
      static_cast<double>(from.cols());
  const double min_m = std::max(1e-6 * std::sqrt(squares[2]), 1e-9);
  const double width_m = std::max(std::sqrt(squares[0] + squares[1]), 1e-9);
  return {min_m, std::max(min_m, decisive_width_m * decisive_width_m / width_m - width_m)};
}

AlignmentResiduals residuals_of(const Eigen::Matrix3d& rotation, const Eigen::Matrix3Xd& from,
                                const Eigen::Matrix3Xd& to, const std::vector<PosePair>& pairs) {
  const double count = static_cast<double>(pairs.size());
  double squares = 0.0;
  for (const PosePair& pair : pairs)
    squares += 0.5 * (rotation * pair.estimate.linear() - pair.truth.linear()).squaredNorm();
  return {std::sqrt((rotation * from - to).squaredNorm() / count), std::sqrt(squares / count)};
}

// Least-squares alignment of positions (Umeyama 1991, without scale) and rotations (chordal). The
// lever is the ratio of their residuals (variance components), estimated iteratively.
Pose best_alignment(const std::vector<PosePair>& pairs) {
  const auto count = static_cast<Eigen::Index>(pairs.size());
  Eigen::Matrix3Xd positions(3, count);
  Eigen::Matrix3Xd true_positions(3, count);
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < count; ++i) {
    const PosePair& pair = pairs[static_cast<std::size_t>(i)];
    positions.col(i) = pair.estimate.translation();
    true_positions.col(i) = pair.truth.translation();
    turns += pair.truth.linear() * pair.estimate.linear().transpose();
  }
  const Eigen::Matrix3Xd from = centered(positions);
  const Eigen::Matrix3Xd to = centered(true_positions);
  const Eigen::Matrix3d covariance = to * from.transpose();
  const LeverRange range = lever_range(from);
  double lever_m = range.min_m;
  Eigen::Matrix3d rotation;
  for (int iteration = 0; iteration < 20; ++iteration) {
    rotation = nearest_rotation(covariance + 0.5 * lever_m * lever_m * turns);
    const AlignmentResiduals residuals = residuals_of(rotation, from, to, pairs);
    lever_m = std::clamp(residuals.position_m / std::max(residuals.rotation_rad, 1e-12),
                         range.min_m, range.max_m);
  }
  Pose alignment = Pose::Identity();
  alignment.linear() = rotation;
  alignment.translation() = true_positions.rowwise().mean() - rotation * positions.rowwise().mean();
  return alignment;
}

Error too_few(std::size_t count, std::size_t least) {
  return Error("the trajectories have too few common poses",
               {.field = "common poses",
                .value = std::to_string(count),
                .bound = ">= " + std::to_string(least)});
}

}  // namespace

AbsoluteTrajectoryError absolute_trajectory_error(const Trajectory& estimate,
                                                  const Trajectory& truth) {
  const std::vector<PosePair> pairs = pair_poses(estimate, truth);
  if (pairs.size() < 3) throw too_few(pairs.size(), 3);
  const Pose alignment = best_alignment(pairs);
  std::vector<double> distances_m;
  std::vector<double> angles_deg;
  for (const PosePair& pair : pairs) {
    const Pose aligned = alignment * pair.estimate;
    distances_m.push_back((aligned.translation() - pair.truth.translation()).norm());
    angles_deg.push_back(angle_deg(aligned.linear(), pair.truth.linear()));
  }
  AbsoluteTrajectoryError error;
  static_cast<TrajectoryError&>(error) = summarize(distances_m, angles_deg);
  error.truth_from_estimate = alignment;
  return error;
}

TrajectoryError relative_trajectory_error(const Trajectory& estimate, const Trajectory& truth) {
  const std::vector<PosePair> pairs = pair_poses(estimate, truth);
  if (pairs.size() < 2) throw too_few(pairs.size(), 2);
  std::vector<double> distances_m;
  std::vector<double> angles_deg;
  for (std::size_t i = 0; i + 1 < pairs.size(); ++i) {
    const PosePair& begin = pairs[i];
    const PosePair& end = pairs[i + 1];
    const Pose estimated_motion = begin.estimate.inverse() * end.estimate;
    const Pose true_motion = begin.truth.inverse() * end.truth;
    const Pose error = true_motion.inverse() * estimated_motion;
    distances_m.push_back(error.translation().norm());
    angles_deg.push_back(angle_deg(estimated_motion.linear(), true_motion.linear()));
  }
  return summarize(distances_m, angles_deg);
}

void describe(ResultTable& table, const TrajectoryError& error) {
  table.add("poses", error.poses, "number of compared poses");
  table.add("rmse_m", error.rmse_m, "root mean square error of the positions, m");
  table.add("median_m", error.median_m, "median error of the positions, m");
  table.add("max_m", error.max_m, "maximum error of the positions, m");
  table.add("mean_rotation_deg", error.mean_rotation_deg, "mean error of the rotations, degrees");
  table.add("max_rotation_deg", error.max_rotation_deg, "maximum error of the rotations, degrees");
}

}  // namespace libmap
