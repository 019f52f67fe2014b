// Bundle adjustment of long scans with fixed cameras, with a sparse system of poses. Each point is
// at the optimum for the poses (variable projection). Memory and time are proportional to the
// number of observations, plus the fill-in of the factorization.
#pragma once

#include <map>
#include <vector>

#include "libmap/optimize/bundle_adjustment.h"

namespace libmap {

// Normal equations of tracks over poses. Observations by frames without a pose are ignored. A
// track with fewer than two remaining observations is ignored, too.
class TrackSystem {
 public:
  // Keeps references to `frames` and `tracks`. `robust_scale` is the width of Cauchy's loss.
  TrackSystem(const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
              double robust_scale);

  // Returns the points of the tracks (map frame): means of the measurements, then optimized.
  std::vector<Eigen::Vector3d> points_at(const std::map<int, Pose>& map_from_base) const;
  // Optimizes the points at the given poses, from the current positions.
  void optimize_points(const std::map<int, Pose>& map_from_base,
                       std::vector<Eigen::Vector3d>& points) const;

  struct Totals {
    double cost = 0.0;
    std::size_t tracks = 0;  // number of tracks with observations from two or more poses
    std::size_t observations = 0;
    std::size_t outliers = 0;    // observations with a weight below one half
    double pixel_squares = 0.0;  // sum of squared image residuals of the inliers, px^2
    double depth_squares = 0.0;  // sum of squared depth residuals of the inliers, m^2

    // Sets counts and root mean squares of the result; the cost is not used.
    void add_to(BundleAdjustmentResult& result) const;
  };
  // Returns cost and residuals at the given poses and points.
  Totals totals(const std::map<int, Pose>& map_from_base,
                const std::vector<Eigen::Vector3d>& points) const;

  // Returns the normal equations of steps of the poses in the order of `map_from_base`.
  BlockSystem system(const std::map<int, Pose>& map_from_base,
                     const std::vector<Eigen::Vector3d>& points) const;

 private:
  const std::vector<FrameFeatures>& frames_;
  const std::vector<FeatureTrack>& tracks_;
  double robust_scale_;
};

// Does the work of adjust_bundle for TrackFrames::linked tracks and fixed camera parameters.
BundleAdjustmentResult adjust_sparse(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureTrack>& tracks,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options,
                                     Progress& progress = no_progress());

}  // namespace libmap
