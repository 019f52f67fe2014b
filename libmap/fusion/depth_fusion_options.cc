#include "libmap/fusion/depth_fusion.h"

namespace libmap {

namespace {

void describe_surface(ResultTable& table, const FusionCounts& counts) {
  const SurfacePointCounts& points = counts.points;
  table.add("occupied_voxels", counts.occupied_voxels, Merge::sum,
            "number of voxels with measurements");
  table.add("surface_elements", counts.elements, Merge::sum,
            "number of surface elements, from which points are selected");
  table.add("dropped_too_few_views", points.unconfirmed, Merge::sum,
            "number of surface elements dropped: fewer than min_views frames measured the element");
  table.add("dropped_seen_through", points.seen_through, Merge::sum,
            "number of surface elements dropped: too many frames see through the element");
  table.add("dropped_missed", points.missed, Merge::sum,
            "number of surface elements dropped: too many frames have no depth at the element");
  table.add("dropped_contradicted", points.contradicted, Merge::sum,
            "number of surface elements dropped: one or two frames, near contradicted elements");
  table.add("dropped_beyond_edges", points.beyond_edge, Merge::sum,
            "number of surface elements dropped: beyond an edge at which the surface bends");
  table.add("merged", points.merged, Merge::sum,
            "number of surface elements merged with another in the same or the next voxel");
  table.add("points", counts.output_points, Merge::sum, "number of points of the cloud");
  table.add("points_beyond_edges", points.extended_points, Merge::sum,
            "number of points added beyond measured edges");
  table.add_hidden("max_views", points.max_views, Merge::max);
}

}  // namespace

void bind(ParameterTable& table, DepthFusionOptions& options) {
  DepthPlaneOptions& planes = options.planes;
  table.add("voxel_size_m", options.voxel_size_m, positive,
            "edge length of a voxel, m; the cloud contains at most one point per voxel");
  table.add("sensor", options.sensor,
            "depth camera: a name in data/sensors or a file, from which depth range and noise are "
            "taken unless options set them; auto: noise of a Kinect v2, or the estimated noise if "
            "it differs clearly");
  table.add("min_depth_m", planes.min_depth_m, positive, "minimum depth of used measurements, m");
  table.add("max_depth_m", planes.max_depth_m, positive, "maximum depth of used measurements, m");
  table.add("max_incidence_deg", planes.max_incidence_deg, {0, 89.5, true, false},
            "maximum angle between line of sight and surface normal of a measurement, degrees");
  table.add("axial_noise_m", planes.noise.axial_m, positive,
            "standard deviation of depth: constant term, m");
  table.add("range_noise", planes.noise.axial_of_range, not_negative,
            "standard deviation of depth: term proportional to range, m per m");
  table.add("square_noise", planes.noise.axial_of_square, not_negative,
            "standard deviation of depth: term proportional to squared range, 1/m");
  table.add("lateral_noise_px", planes.noise.lateral_px, not_negative,
            "standard deviation of a measurement perpendicular to the line of sight, pixels");
  table.add("plane_radius_px", planes.radius_px, {1, 7},
            "radius of the disc around a pixel in which a plane is fitted, pixels");
  table.add_former_key("min_pair_share", "min_pair_fraction");
  table.add("min_pair_fraction", planes.min_pair_fraction, zero_to_one,
            "minimum share of opposite pixel pairs that agree with a pixel, to fit a plane there");
  table.add("disc_radius_voxels", options.disc_radius_voxels, positive,
            "radius of the disc around a point in which measurements are averaged, in voxels");
  table.add(
      "pose_error_m", options.pose_error_m, not_negative,
      "standard deviation of a frame's position along the surface normal due to pose errors, m");
  table.add("registration_rounds", options.registration_rounds, {0, 20},
            "maximum number of rounds in which frames are registered to each other; 0: poses are "
            "unchanged");
  table.add("enough_views", options.enough_views, not_negative,
            "number N of views that suffice: a frame is skipped if it adds less than 1/N to the "
            "information of earlier frames on nearly all of its surface; 0: all frames are fused");
  table.add("min_views", options.points.min_views, {1},
            "minimum number of frames that measure a point of the cloud");
  table.add("max_seen_through", options.points.max_seen_through, not_negative,
            "maximum ratio of views that see through a point to views that see the point");
  table.add("max_missed", options.points.max_missed, not_negative,
            "maximum ratio of views without depth at a point to views that see the point");
  table.add("extend_edges", options.extend_edges,
            "add points one voxel beyond measured edges of the surface");
  table.add("color", options.color, "add colors, with larger weights for near and frontal views");
  table.add("stereo", options.stereo, "compute the depth of stereo pairs by semi-global matching");
  table.add("strict", options.strict, "fail if a frame cannot be used, instead of skipping it");
}

void describe(ResultTable& table, const FusionCounts& counts) {
  describe(table, counts.pixels);
  describe_surface(table, counts);
}

void describe(ResultTable& table, const DepthFusionResult& result) {
  table.add("frames", result.frames, "number of fused frames");
  table.add("redundant_frames", result.redundant_frames,
            "number of frames skipped because earlier frames measured their surface well enough");
  table.add("skipped_frames", result.skipped.size(), "number of frames that could not be used");
  describe(table, result.pixels);
  table.add("axial_noise_m", result.noise.axial_m,
            "assumed standard deviation of depth: constant term, m");
  table.add("range_noise", result.noise.axial_of_range,
            "assumed standard deviation of depth: term proportional to range, m per m");
  table.add("square_noise", result.noise.axial_of_square,
            "assumed standard deviation of depth: term proportional to squared range, 1/m");
  table.add("registration_rounds", result.registration_rounds,
            "number of registration rounds that moved frames");
  table.add("registration_rejected", result.registration_rejected,
            "true if the registration was rejected, or could not be checked without color");
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
            "RMS translation of the frames by registration, m");
  table.add("registration_turn_deg", result.registration_turn_deg,
            "RMS rotation of the frames by registration, degrees");
  table.add("disagreement_before_m", result.disagreement_before_m,
            "RMS deviation of frames' surface heights from the mean height with given poses, m");
  table.add(
      "disagreement_after_m", result.disagreement_after_m,
      "RMS deviation of frames' surface heights from the mean height with registered poses, m");
  describe_surface(table, result);
}

}  // namespace libmap
