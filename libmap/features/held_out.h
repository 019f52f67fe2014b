// What the stages of a refinement are evaluated by: observations that no pose is estimated from, by
// how well they fit at the poses before a stage and after it.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "libmap/features/feature_tracks.h"

namespace libmap {

// One kind of observations at two sets of poses. Costs are rho = log(1 + chi-square / 9).
struct HeldOutChange {
  std::size_t count = 0;
  double before = 0.0;  // means
  double after = 0.0;
  double deviation = 0.0;  // standard error of their difference
};

// NaN where an observation says nothing at the one or the other poses: it is left out of both.
HeldOutChange compare_held_out(const std::vector<double>& before, const std::vector<double>& after);

// Features that were matched and kept back, in the order of the links; NaN where a node has no
// pose or a feature no known depth.
std::vector<double> match_costs(const std::vector<FrameFeatures>& frames,
                                const std::vector<FeatureLink>& links,
                                const std::map<int, Pose>& map_from_base);

// Depth that was kept back (SampleUse::checks), of both frames of each link against the other's
// planes; NaN where the other does not see it.
std::vector<double> surface_costs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<FeatureLink>& links,
                                  const std::map<int, Pose>& map_from_base);

// Depth that was kept back against the plane of another frame.
struct SurfaceResidual {
  double distance_m = 0.0;  // along the normal; NaN where the other frame does not see it
  double noise_m = 0.0;     // standard deviation of the distance
  double range_m = 0.0;     // of the farther one of both
};
// The residuals of surface_costs, in their order.
std::vector<SurfaceResidual> surface_residuals(const std::vector<FrameFeatures>& frames,
                                               const std::vector<FeatureLink>& links,
                                               const std::map<int, Pose>& map_from_base);

struct HeldOutCosts {
  std::vector<double> matches;
  std::vector<double> surfaces;
};
// The costs of what was held out, at these poses.
HeldOutCosts held_out_costs(const std::vector<FrameFeatures>& frames,
                            const std::vector<FeatureLink>& links,
                            const std::map<int, Pose>& map_from_base);

// Both kinds. A match has three residuals, a sample one; samples are so far apart that the discs
// their planes are fitted to hardly overlap.
struct HeldOutEvaluation {
  HeldOutChange matches;
  HeldOutChange surfaces;

  double before() const;     // mean of all, weighted
  double change() const;     // of the mean of all, weighted; below 0: they fit better
  double deviation() const;  // its standard error
  bool any() const { return matches.count + surfaces.count > 0; }
  // Together at all, but for rounding; or one kind by more than chance explains and by more than
  // half a percent, so that no gain of the one is paid by the other.
  bool is_worse() const;
  // Not worse, and the matches better by more than chance explains: two standard errors.
  bool is_clearly_better() const;
};
inline constexpr double surface_weight = 1.0 / 3.0;
HeldOutEvaluation evaluate_held_out(const HeldOutCosts& before, const HeldOutCosts& after);

}  // namespace libmap
