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

// Returns mutual nearest neighbors with a descriptor distance below `max_ratio` times the distance
// of the second nearest descriptor (Lowe 2004; 1: no limit), by ascending a. Inputs:
// descriptor_vectors.
std::vector<FeatureMatch> match_features(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                                         double max_ratio);

// Residual of a feature of b, transformed to a by `a_from_b`, against the matched feature of a: x
// and y (px), depth (m), with the covariance from the noise of both features.
struct MatchResidual {
  bool in_front = false;  // in front of the camera in a; if false, the residual is not set
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 3, 6> jacobian;  // by a step of a_from_b (rigid_motion.h)

  double chi_square() const;  // squared Mahalanobis distance, 3 degrees of freedom
};
MatchResidual match_residual(const FrameFeatures& a, const FrameFeatures& b,
                             const FeatureMatch& match, const Pose& a_from_b,
                             bool with_jacobian = false);

struct RelativePoseOptions {
  int ransac_iterations = 400;        // >= 1: maximum number of iterations
  int min_inliers = 25;               // >= 6: minimum number of inliers
  double min_inlier_fraction = 0.25;  // >= 0: minimum share of inliers among the matches
  double max_chi_square = 14.16;      // maximum for a match; 99.7 % of true matches have less
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
  // Information of a step of a_from_b: J^T W J / max(1, chi_square_per_freedom).
  Matrix6d information = Matrix6d::Zero();
  double chi_square_per_freedom = 0.0;  // of the inliers
  double spread = 0.0;  // twice the standard deviation of the inliers' rays along the narrow axis
  std::vector<FeatureMatch> inliers;
};

// Estimates the pose by seeded RANSAC over the rigid motions of three matched points (Fischler and
// Bolles 1981; Umeyama 1991), then Gauss-Newton over the match_residual of the inliers, which are
// selected again in each step. a_from_b is valid only if `outcome` is found.
RelativePose estimate_relative_pose(const FrameFeatures& a, const FrameFeatures& b,
                                    const std::vector<FeatureMatch>& matches,
                                    const RelativePoseOptions& options, std::uint64_t seed);

}  // namespace libmap
