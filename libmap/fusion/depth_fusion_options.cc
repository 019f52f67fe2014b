#include "libmap/fusion/depth_fusion.h"

namespace libmap {

namespace {

void describe_surface(ResultTable& table, const FusionCounts& counts) {
  const SurfacePointCounts& points = counts.points;
  table.add("occupied_voxels", counts.occupied_voxels, Merge::sum, "voxels with measurements");
  table.add("surface_elements", counts.elements, Merge::sum, "elements of the surface");
  table.add("dropped_too_few_views", points.unconfirmed, Merge::sum,
            "elements measured by fewer than min_views frames");
  table.add("dropped_seen_through", points.seen_through, Merge::sum,
            "elements that views see through");
  table.add("dropped_missed", points.missed, Merge::sum, "elements where views measured nothing");
  table.add("dropped_beside", points.beside, Merge::sum, "elements connected to contradicted ones");
  table.add("dropped_beyond_edges", points.bent_away, Merge::sum,
            "points beyond an edge where the surface ends");
  table.add("merged", points.merged, Merge::sum, "elements merged with one of the same voxel");
  table.add("points", counts.points_made, Merge::sum, "points of the cloud");
  table.add("points_beyond_edges", points.extended_points, Merge::sum,
            "points of the cloud beyond the measured edges");
  table.add_hidden("max_views", points.max_views, Merge::max);
}

}  // namespace

void bind(ParameterTable& table, DepthFusionOptions& options) {
  DepthPlaneOptions& planes = options.planes;
  table.add("voxel_size_m", options.voxel_size_m, positive, "one point per voxel of this size");
  table.add("sensor", options.sensor,
            "depth camera, a name in data/sensors or a file: useful range and noise that no other "
            "option sets; auto: a Kinect v2");
  table.add("min_depth_m", planes.min_depth_m, positive, "nearer measurements are dropped");
  table.add("max_depth_m", planes.max_depth_m, positive, "farther measurements are dropped");
  table.add("max_incidence_deg", planes.max_incidence_deg, {0, 89.5, true, false},
            "measurements more oblique than this to their surface are dropped");
  table.add("axial_noise_m", planes.noise.axial_m, positive,
            "standard deviation of depth at range 0");
  table.add("range_noise", planes.noise.axial_of_range, not_negative,
            "standard deviation of depth added by each meter of range, m/m");
  table.add("square_noise", planes.noise.axial_of_square, not_negative,
            "standard deviation of depth added by range squared, 1/m");
  table.add("lateral_noise_px", planes.noise.lateral_px, not_negative,
            "standard deviation across the line of sight");
  table.add("plane_radius_px", planes.radius_px, {1, 7},
            "disc of pixels that a plane is fitted to");
  table.add("min_pair_share", planes.min_pair_share, zero_to_one,
            "share of the pairs of opposite pixels around a pixel that must agree with it");
  table.add("disc_radius_voxels", options.disc_radius_voxels, positive,
            "disc of the surface whose measurements make a point");
  table.add("pose_error_m", options.pose_error_m, not_negative,
            "standard deviation of a whole frame, along a normal");
  table.add("registration_rounds", options.registration_rounds, {0, 20},
            "times, at most, that poses are corrected so that frames agree; 0: not at all");
  table.add("enough_views", options.enough_views, not_negative,
            "frames are left out that add less than 1/enough_views to what earlier frames measured "
            "of nearly all their surface; 0: all frames are fused");
  table.add("min_views", options.points.min_views, {1},
            "points that fewer frames measured are dropped");
  table.add("max_seen_through", options.points.max_seen_through, not_negative,
            "points are dropped that are seen through more often, against being seen");
  table.add("max_missed", options.points.max_missed, not_negative,
            "points are dropped where more views that should measure them measure nothing, against "
            "being seen");
  table.add("extend_edges", options.extend_edges,
            "also points one voxel beyond the edges of what was measured");
  table.add("color", options.color, "colors, blended with the nearest front views ahead");
  table.add("stereo", options.stereo, "compute the depth of stereo pairs by semi-global matching");
  table.add("strict", options.strict, "end with an error if a frame cannot be used");
}

void describe(ResultTable& table, const FusionCounts& counts) {
  describe(table, counts.pixels);
  describe_surface(table, counts);
}

void describe(ResultTable& table, const DepthFusionResult& result) {
  table.add("frames", result.frames, "frames that were fused");
  table.add("redundant_frames", result.redundant_frames,
            "frames left out because earlier frames have measured their surface");
  table.add("skipped_frames", result.skipped.size(), "frames that could not be used");
  describe(table, result.pixels);
  table.add("registration_rounds", result.registration_rounds,
            "rounds of registration that moved frames");
  table.add("registration_rejected", result.registration_rejected,
            "whether held-out measurements rejected the registration");
  const auto add_check = [&](const std::string& kind, const PairCosts& costs) {
    const auto if_measured = [&](double cost) {
      return costs.count > 0 ? std::optional(cost) : std::nullopt;
    };
    table.add("held_out_" + kind + "_before", if_measured(costs.before),
              "mean cost of held-out " + kind + " with the given poses");
    table.add("held_out_" + kind + "_after", if_measured(costs.after),
              "mean cost of held-out " + kind + " after the first round of registration");
  };
  add_check("depth", result.registration_check.depth);
  add_check("color", result.registration_check.color);
  table.add("registration_shift_m", result.registration_shift_m,
            "shift of the frames by registration, root mean square");
  table.add("registration_turn_deg", result.registration_turn_deg,
            "rotation of the frames by registration, root mean square");
  table.add("disagreement_before_m", result.disagreement_before_m,
            "deviation of the heights that frames measured from their mean, with the given poses");
  table.add("disagreement_after_m", result.disagreement_after_m,
            "deviation of the heights that frames measured from their mean, after registration");
  describe_surface(table, result);
}

}  // namespace libmap
