#include "libmap/refine/refinement.h"

namespace libmap {

void bind(ParameterTable& table, RefinementOptions& options) {
  table.add("start", options.start,
            {{"auto", StartPoses::automatic},
             {"odometry", StartPoses::odometry},
             {"stored", StartPoses::stored},
             {"visual", StartPoses::visual}},
            "poses that the work starts from; visual: by the pictures alone; auto: visual where "
            "neither poses nor links are");
  table.add("rounds", options.rounds, not_negative,
            "of loop closures, each on the poses of the last, at most");
  bind(table, options.features);
  bind(table, options.odometry);
  bind(table, options.closures);
  bind(table, options.graph);
  table.add("bundle", options.bundle, "adjust poses and points together");
  table.add("intrinsics", options.intrinsics,
            {{"fixed", IntrinsicsMode::fixed},
             {"refined", IntrinsicsMode::refined},
             {"auto", IntrinsicsMode::automatic}},
            "focal length and principal point: as stored, or estimated; auto: estimated where the "
            "held-out matches fit better then");
  table.add("correct_depth", options.correct_depth,
            "estimate a correction of depth by range and radius, if what was held out fits better "
            "then");
  table.add("scale_from", options.scale_from,
            {{"depth", ScaleSource::depth}, {"odometry", ScaleSource::odometry}},
            "what determines the scale where neither a factor, lengths nor a board are known");
  table.add("scale", options.scale, {0.5, 2.0},
            "known factor of the scale, that of crop --border-size for one; 1: none is known");
  bind(table, options.bundle_adjustment);
  bind(table, options.icp);
  table.add("seed", options.seed, not_negative, "of all that is random");
}

}  // namespace libmap
