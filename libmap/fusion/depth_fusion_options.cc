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
            "elements that too many views see through");
  table.add("dropped_missed", points.missed, Merge::sum, "elements where views measured nothing");
  table.add("dropped_beside", points.contradicted, Merge::sum,
            "elements connected to contradicted ones");
  table.add("dropped_beyond_edges", points.beyond_edge, Merge::sum,
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
  table.add("voxel_size_m", options.voxel_size_m, positive, "size of a voxel; one point per voxel");
  table.add("sensor", options.sensor,
            "depth camera, a name in data/sensors or a file: useful range and noise that no other "
            "option sets; auto: the noise is estimated if it differs from a Kinect v2's");
  table.add("min_depth_m", planes.min_depth_m, positive, "minimum depth of measurements");
  table.add("max_depth_m", planes.max_depth_m, positive, "maximum depth of measurements");
  table.add("max_incidence_deg", planes.max_incidence_deg, {0, 89.5, true, false},
            "maximum angle between line of sight and surface normal");
  table.add("axial_noise_m", planes.noise.axial_m, positive,
            "standard deviation of depth at range 0");
  table.add("range_noise", planes.noise.axial_of_range, not_negative,
            "standard deviation of depth added by each meter of range, m/m");
  table.add("square_noise", planes.noise.axial_of_square, not_negative,
            "standard deviation of depth added by range squared, 1/m");
  table.add("lateral_noise_px", planes.noise.lateral_px, not_negative,
            "standard deviation of measurements across the line of sight");
  table.add("plane_radius_px", planes.radius_px, {1, 7},
            "radius of the disc of pixels that a plane is fitted to");
  table.add("min_pair_share", planes.min_pair_share, zero_to_one,
            "minimum share of pairs of opposite pixels around a pixel that agree with it; else it "
            "has no plane");
  table.add("disc_radius_voxels", options.disc_radius_voxels, positive,
            "radius of the disc in which measurements are averaged, in voxels");
  table.add("pose_error_m", options.pose_error_m, not_negative,
            "standard deviation of a whole frame along the surface normal");
  table.add("registration_rounds", options.registration_rounds, {0, 20},
            "maximum number of rounds of registration of the frames; 0: poses are unchanged");
  table.add("enough_views", options.enough_views, not_negative,
            "skip frames that add less than 1/enough_views to the information of earlier frames "
            "on nearly all of their surface; 0: all frames are fused");
  table.add("min_views", options.points.min_views, {1},
            "minimum number of frames that measured a point");
  table.add("max_seen_through", options.points.max_seen_through, not_negative,
            "maximum ratio of views that see through a point to views that see it");
  table.add("max_missed", options.points.max_missed, not_negative,
            "maximum ratio of views that should measure a point and measure nothing to views that "
            "see it");
  table.add("extend_edges", options.extend_edges, "add points one voxel beyond the measured edges");
  table.add("color", options.color, "add colors, weighted towards near frontal views");
  table.add("stereo", options.stereo, "compute the depth of stereo pairs by semi-global matching");
  table.add("strict", options.strict, "fail if a frame cannot be used");
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
  table.add("axial_noise_m", result.noise.axial_m, "assumed noise of depth: constant term");
  table.add("range_noise", result.noise.axial_of_range,
            "assumed noise of depth: term proportional to range, m/m");
  table.add("square_noise", result.noise.axial_of_square,
            "assumed noise of depth: term proportional to squared range, 1/m");
  table.add("registration_rounds", result.registration_rounds,
            "rounds of registration that moved frames");
  table.add("registration_rejected", result.registration_rejected,
            "true if held-out measurements rejected the registration");
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
            "deviation of frames' heights from the mean of all frames, with the given poses");
  table.add("disagreement_after_m", result.disagreement_after_m,
            "deviation of frames' heights from the mean of all frames, after registration");
  describe_surface(table, result);
}

}  // namespace libmap
