// Evaluates a refinement stage by the residuals of held-out observations before and after the
// stage. Held-out observations are never used to estimate poses.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "libmap/features/feature_tracks.h"

namespace libmap {

// Change of the costs log(1 + chi-square / 9) of one kind of observations (matches or surfaces).
struct HeldOutChange {
  std::size_t count = 0;   // number of observations with a cost before and after the stage
  double before = 0.0;     // mean cost
  double after = 0.0;      // mean cost
  double deviation = 0.0;  // standard error of the mean difference
};

// Compares costs of the same observations, element by element. Elements that are NaN in either
// vector are ignored. Returns zeros if the sizes differ.
HeldOutChange compare_held_out(const std::vector<double>& before, const std::vector<double>& after);

// Returns the costs of the held-out matches, in the order of the links; NaN if a node has no pose
// or a feature has no known depth.
std::vector<double> match_costs(const std::vector<FrameFeatures>& frames,
                                const std::vector<FeatureLink>& links,
                                const std::map<int, Pose>& map_from_base);

// Returns the costs of held-out depth samples (SampleUse::checks) against the planes of another
// frame, link by link: first the samples of the first frame against the second frame, then the
// reverse. NaN if the other frame does not observe the sample, or a pose is missing.
std::vector<double> surface_costs(const std::vector<FrameFeatures>& frames,
                                  const std::vector<FeatureLink>& links,
                                  const std::map<int, Pose>& map_from_base);

// Residual of a held-out depth sample against the plane of another frame.
struct SurfaceResidual {
  double distance_m = 0.0;  // along the normal; NaN if the other frame does not observe the sample
  double noise_m = 0.0;     // standard deviation of the distance
  double range_m = 0.0;     // larger range of the two measurements
};
inline constexpr int held_out_samples = 60;  // approximate number of depth samples per frame
// Returns the residuals from which surface_costs computes costs, in the same order.
std::vector<SurfaceResidual> surface_residuals(const std::vector<FrameFeatures>& frames,
                                               const std::vector<FeatureLink>& links,
                                               const std::map<int, Pose>& map_from_base,
                                               int samples = held_out_samples);

struct HeldOutCosts {
  std::vector<double> matches;   // match_costs
  std::vector<double> surfaces;  // surface_costs
};
// Returns the costs of all held-out observations at the given poses.
HeldOutCosts held_out_costs(const std::vector<FrameFeatures>& frames,
                            const std::vector<FeatureLink>& links,
                            const std::map<int, Pose>& map_from_base);

// Change of both kinds of costs. The weight of a kind is its number of residuals: three per match
// (x, y, depth), one per sample.
struct HeldOutEvaluation {
  HeldOutChange matches;
  HeldOutChange surfaces;

  double before() const;     // weighted mean cost
  double change() const;     // change of the weighted mean cost; below 0: improved
  double deviation() const;  // standard error of change()
  bool any() const { return matches.count + surfaces.count > 0; }
  // Returns true if the weighted mean increases beyond rounding, or if the mean of one kind
  // increases by more than two standard errors and by more than half a percent.
  bool is_worse() const;
  // Returns true if not worse, and the matches improve by more than two standard errors.
  bool is_clearly_better() const;
};
inline constexpr double surface_weight = 1.0 / 3.0;  // weight of a sample relative to a match
// Compares all costs before and after a stage.
HeldOutEvaluation evaluate_held_out(const HeldOutCosts& before, const HeldOutCosts& after);

}  // namespace libmap
