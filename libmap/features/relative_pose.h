// Estimates the relative pose of two frames from matches of features.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/features/features.h"

namespace libmap {

struct FeatureMatch {
  int a = 0;  // index of the feature in frame a
  int b = 0;  // index of the feature in frame b
  bool operator==(const FeatureMatch&) const = default;
};

// Returns mutual nearest neighbors, by ascending a. Their descriptor distance is below `max_ratio`
// times the distance of the second nearest descriptor (Lowe 2004; 1: no limit). a and b are as from
// descriptor_vectors (features.h): one unit vector per column.
std::vector<FeatureMatch> match_features(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                                         double max_ratio);

// Residual of a match: the feature of frame b, transformed by `a_from_b` to frame a, minus the
// feature of frame a. Elements: x and y (px), depth (m).
struct MatchResidual {
  bool in_front = false;  // false, and nothing else is set: the point is behind the camera of a
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // from the noise of both features
  Eigen::Matrix<double, 3, 6> jacobian;  // by a step of a_from_b (rigid_motion.h); if requested

  double chi_square() const;  // squared Mahalanobis distance, 3 degrees of freedom
};
MatchResidual match_residual(const FrameFeatures& a, const FrameFeatures& b,
                             const FeatureMatch& match, const Pose& a_from_b,
                             bool with_jacobian = false);

struct RelativePoseOptions {
  int ransac_iterations = 400;        // >= 1: maximum number of iterations
  int min_inliers = 25;               // >= 6: minimum number of inliers
  double min_inlier_fraction = 0.25;  // >= 0: minimum share of inliers among the matches
  double max_chi_square = 14.16;      // > 0: maximum of an inlier; 99.7 % of true matches have less
  double min_spread = 0.06;           // >= 0: minimum RelativePose::spread
};

// Outcome of the estimation. degenerate: the inliers are in one spot or on one line of the image.
enum class RelativePoseOutcome {
  found,
  too_few_matches,
  too_few_inliers,
  degenerate,
  not_converged
};

struct RelativePose {
  RelativePoseOutcome outcome = RelativePoseOutcome::too_few_matches;
  Pose a_from_b = Pose::Identity();
  // Information matrix of a step of a_from_b: J^T W J / max(1, chi_square_per_freedom), with the
  // Jacobian J and the weights W of the inliers' residuals.
  Matrix6d information = Matrix6d::Zero();
  double chi_square_per_freedom = 0.0;  // chi-square of the inliers per degree of freedom
  double spread = 0.0;  // twice the standard deviation of inliers' unit rays along the minor axis
  std::vector<FeatureMatch> inliers;
};

// Estimates the pose by RANSAC over the rigid motions of three matched points (Fischler and Bolles
// 1981; Umeyama 1991), then by Gauss-Newton over the match_residual of the inliers. Each step
// selects the inliers again. a_from_b is valid only if `outcome` is found. `seed` is for RANSAC.
RelativePose estimate_relative_pose(const FrameFeatures& a, const FrameFeatures& b,
                                    const std::vector<FeatureMatch>& matches,
                                    const RelativePoseOptions& options, std::uint64_t seed);

}  // namespace libmap
