// The motion between two frames by their features.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/features/features.h"

namespace libmap {

struct FeatureMatch {
  int a = 0;  // number of the feature in the one frame
  int b = 0;  // ... and in the other
  bool operator==(const FeatureMatch&) const = default;
};

// Features that are each other's most alike and clearly more so than the next: the distance of the
// descriptors is at most `max_ratio` of that of the second best (Lowe 2004). `a` and `b` hold
// descriptor_vectors. By ascending a.
std::vector<FeatureMatch> match_features(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                                         double max_ratio);

// How far a feature of b, carried to a by `a_from_b`, lies from its match: x and y in pixels, depth
// in meters, and the covariance of the three from the noise of both.
struct MatchResidual {
  bool in_front = false;
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 3, 6> jacobian;  // by a step of a_from_b (rigid_motion.h)

  double chi_square() const;  // squared Mahalanobis length, 3 degrees of freedom
};
MatchResidual match_residual(const FrameFeatures& a, const FrameFeatures& b,
                             const FeatureMatch& match, const Pose& a_from_b,
                             bool with_jacobian = false);

struct RelativePoseOptions {
  int ransac_iterations = 400;     // >= 1
  int min_inliers = 25;            // >= 6
  double min_inlier_share = 0.25;  // of the matches
  double max_chi_square = 14.16;   // of a match's three residuals: 99.7 % of true ones are below
  double min_spread = 0.06;        // across the inliers' least extent, of the focal length
};

// Why a pair has no relative pose, or that it has.
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
  // Of a step of a_from_b: J^T W J, divided by chi_square_per_freedom where that is above 1.
  Matrix6d information = Matrix6d::Zero();
  double chi_square_per_freedom = 0.0;
  double spread = 0.0;  // standard deviation of the inliers' rays along their narrow axis, twice
  std::vector<FeatureMatch> inliers;
};

// Seeded RANSAC over the rigid motions of three matched points (Fischler and Bolles 1981; Umeyama
// 1991), then least squares of match_residual over all inliers, which are chosen anew in each step
// (Gauss-Newton).
RelativePose estimate_relative_pose(const FrameFeatures& a, const FrameFeatures& b,
                                    const std::vector<FeatureMatch>& matches,
                                    const RelativePoseOptions& options, std::uint64_t seed);

}  // namespace libmap
