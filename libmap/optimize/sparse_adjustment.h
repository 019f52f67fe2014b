// Bundle adjustment of long scans: the poses in the sparse system of the links, each point where
// its observations agree best (variable projection). Memory and time are proportional to the number
// of observations, and grow with the fill-in of the graph of the links.
#pragma once

#include <map>
#include <vector>

#include "libmap/optimize/bundle_adjustment.h"

namespace libmap {

// Observations of tracks as a system over poses.
class TrackSystem {
 public:
  // All outlive it. `robust_scale` is of Cauchy's loss.
  TrackSystem(const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
              double robust_scale);

  // The mean of where the frames see them, then where their observations agree best.
  std::vector<Eigen::Vector3d> points_at(const std::map<int, Pose>& map_from_base) const;
  void optimize_points(const std::map<int, Pose>& map_from_base,
                       std::vector<Eigen::Vector3d>& points) const;

  struct Totals {
    double cost = 0.0;
    std::size_t tracks = 0;  // that two poses or more see
    std::size_t observations = 0;
    std::size_t outliers = 0;    // down-weighted below a half
    double pixel_squares = 0.0;  // of the others
    double depth_squares = 0.0;

    // All but the cost.
    void add_to(BundleAdjustmentResult& result) const;
  };
  // Cost and residuals at these poses and points.
  Totals totals(const std::map<int, Pose>& map_from_base,
                const std::vector<Eigen::Vector3d>& points) const;

  // Normal equations of steps of the poses, in their order, the points eliminated.
  BlockSystem system(const std::map<int, Pose>& map_from_base,
                     const std::vector<Eigen::Vector3d>& points) const;

 private:
  const std::vector<FrameFeatures>& frames_;
  const std::vector<FeatureTrack>& tracks_;
  double robust_scale_;
};

// As adjust_bundle with TrackFrames::linked tracks and nothing to refine. The same for any number
// of threads.
BundleAdjustmentResult adjust_sparse(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureTrack>& tracks,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options,
                                     Progress& progress = no_progress());

}  // namespace libmap
