// graspmap fuse: fuses the depth images of a scan into one oriented, colored cloud.
#include "libmap/camera/sensor_model.h"
#include "libmap/consistency/edge_agreement.h"
#include "libmap/consistency/pose_consistency.h"
#include "libmap/fusion/depth_fusion.h"
#include "libmap/io/cloud_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/refine/noise_estimate.h"
#include "libmap/scan/rig_io.h"
#include "libmap/scan/scan_source.h"
#include "libmap/tiles/eigen_json.h"
#include "tools/support/command_line.h"
#include "tools/support/results.h"
#include "tools/support/scan_poses.h"
#include "tools/support/subcommands.h"
#include "tools/support/tile_folder.h"

// JSON of the plan, which shares and resumed runs read bit for bit.
namespace libmap {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FusionFrame, node, grid_from_base, image_pixels, reach,
                                   max_ray_length, max_pixel_pitch)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PairCosts, count, before, after, deviation)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RegistrationCheck, depth, color)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DepthNoise, axial_m, axial_of_range, axial_of_square, lateral_px)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FusionPlan, noise, grid_origin, frames, skipped, redundant,
                                   registration_rounds, registration_rejected, registration_check,
                                   disagreement_before_m, disagreement_after_m)

}  // namespace libmap

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

// Frame of the cloud: that of the poses or of the true poses.
enum class CloudFrame { poses, ground_truth };

struct FuseOptions {
  std::string scan;
  std::string output;
  PosesOption poses;
  CalibrationOption calibration;
  std::optional<libmap::CameraFile> camera;
  std::string corrected_poses;
  CloudFrame frame = CloudFrame::poses;
  libmap::DepthFusionOptions fusion;
  double tile_m = 5.0;
  std::string tile = whole_share;
};

// Warns if more points are dropped than the 2 to 4 % at edges of static scans.
void report_contradictions(const libmap::DepthFusionResult& result, Run& run) {
  constexpr double usual_fraction = 0.06;
  const libmap::SurfacePointCounts& points = result.points;
  const auto dropped =
      static_cast<double>(points.seen_through + points.missed + points.contradicted);
  if (dropped < usual_fraction * (dropped + static_cast<double>(result.output_points))) return;
  run.info(
      "{} points dropped because frames contradict each other, e.g. because something moved: {} "
      "seen through, {} missed, {} connected to those",
      dropped, points.seen_through, points.missed, points.contradicted);
}

void tell_registration(const libmap::DepthFusionResult& result, Run& run) {
  const libmap::PairCosts& color = result.registration_check.color;
  const libmap::PairCosts& depth = result.registration_check.depth;
  const libmap::PairCosts& shown = color.count > 0 ? color : depth;
  if (result.registration_rounds > 0)
    run.info("poses corrected by registration: {:.1f} mm and {:.2f} deg (RMS)",
             1e3 * result.registration_shift_m, result.registration_turn_deg);
  else if (result.registration_rejected && shown.count > 0)
    run.info("poses not corrected: the error of held-out {} does not decrease, {:.4f} -> {:.4f}",
             color.count > 0 ? "color" : "depth", shown.before, shown.after);
  else if (result.registration_rejected)
    run.info("poses not corrected: poses are refined, and no color can validate registration");
}

void tell_results(const libmap::DepthFusionResult& result, const FuseOptions& options, Run& run) {
  for (const auto& [node, fault] : result.skipped)
    run.warn(std::string("skipped: ") + fault.what());
  const libmap::DepthPixelCounts& pixels = result.pixels;
  run.add_results(libmap::described(result));
  run.add_timings(result.timings_s);
  run.detail(
      "{} of {} pixels used; {} unmeasured, {} out of range, {} flying, {} grazing, {} outside the "
      "invertible lens distortion",
      pixels.used, pixels.pixels, pixels.unmeasured, pixels.out_of_range, pixels.flying,
      pixels.grazing, pixels.without_ray);
  tell_registration(result, run);
  report_contradictions(result, run);
  if (result.redundant_frames > 0)
    run.info("{} frames skipped: earlier frames measured their surface (--enough-views)",
             result.redundant_frames);
  run.info("{} frames, {} measurements -> {} points", result.frames, pixels.used,
           result.output_points);
  if (result.output_points > 0) return;
  if (result.points.unconfirmed > 0)
    run.warn("--min-views {} leaves no points; at most {} frames measured one point",
             options.fusion.points.min_views, result.points.max_views);
  else
    run.warn("the cloud is empty: no depth pixel is within the limits");
}

// Returns true for one of several shares, the last of which claims the outputs.
bool is_share(const FuseOptions& options) { return libmap::parse_share(options.tile).count > 1; }

void claim_poses(const FuseOptions& options, const std::vector<std::string>& inputs, Run& run) {
  if (options.corrected_poses.empty()) return;
  if (!libmap::is_trajectory_path(options.corrected_poses))
    throw libmap::Error("not a pose format", {.field = "--corrected-poses",
                                              .value = options.corrected_poses,
                                              .bound = ".tum, .kitti, .g2o or .toro"});
  if (!is_share(options)) run.claim_output(options.corrected_poses, inputs);
}

// Transform of the cloud from the frame of `poses` to the requested frame.
libmap::Pose wanted_from_cloud(const FuseOptions& options, const libmap::ScanSource& scan,
                               const libmap::Trajectory& poses,
                               const libmap::DepthFusionResult& result, Run& run) {
  if (options.frame != CloudFrame::ground_truth) return libmap::Pose::Identity();
  return truth_from_poses(scan, result.registration_rounds > 0 ? result.poses : poses,
                          options.poses, run);
}

libmap::PointCloud carried(libmap::PointCloud cloud, const FuseOptions& options,
                           const libmap::Pose& wanted_from_cloud) {
  if (options.frame != CloudFrame::ground_truth) return cloud;
  return libmap::transform_cloud(cloud, wanted_from_cloud);
}

void write_poses(const FuseOptions& options, const libmap::DepthFusionResult& result, Run& run) {
  if (options.corrected_poses.empty()) return;
  if (is_share(options)) run.claim_output(options.corrected_poses, {options.scan});
  const std::string frame = std::exchange(run.manifest().frame, "poses");
  const auto results = run.manifest().results;
  if (options.camera) add_camera(*options.camera, run);
  run.write_output(options.corrected_poses, [&](const auto& temporary) {
    libmap::write_trajectory(temporary, {result.poses, {}});
  });
  run.manifest().frame = frame;
  run.manifest().results = results;
}

// Returns the noise of the depth camera, and logs its source.
libmap::DepthNoise choose_noise(const libmap::DepthFusionOptions& options,
                                const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                                Run& run) {
  const libmap::ScanNoise chosen = run.timed("noise", [&] {
    return libmap::choose_noise(scan, poses, options.sensor, options.planes, run.progress());
  });
  if (chosen.is_estimated)
    run.info("{}", chosen.sentence);
  else
    run.detail("{}", chosen.sentence);
  return chosen.noise;
}

// Makes and writes the tiles one by one; a cloud in one file is one tile.
void make_tiles(const FuseOptions& options, const libmap::ScanSource& scan,
                const libmap::Trajectory& poses, TileFolder* folder, Run& run) {
  std::optional<libmap::TileFusion> fusion;
  const double tile_m = folder == nullptr ? libmap::whole_plan : options.tile_m;
  const auto make_plan = [&] {
    libmap::DepthFusionOptions with_noise = options.fusion;
    with_noise.planes.noise = choose_noise(options.fusion, scan, poses, run);
    fusion.emplace(scan, poses, with_noise, tile_m, run.progress());
    return TileFolder::TileData(fusion->plan());
  };
  const TileFolder::TileData found =
      folder == nullptr ? TileFolder::TileData() : folder->begin(make_plan);
  if (!fusion && found.is_null()) make_plan();
  if (!fusion) {
    const auto known = found.get<libmap::FusionPlan>();
    fusion.emplace(scan, poses, options.fusion, tile_m, run.progress(), &known);
  }
  run.add_results({{"noise", describe(fusion->plan().noise)}});
  libmap::DepthFusionResult result = fusion->report();
  const libmap::Pose wanted_from_tile = wanted_from_cloud(options, scan, poses, result, run);
  const auto make = [&](std::size_t n) {
    libmap::TileFusion::Tile tile = fusion->make(n);
    tile.cloud = carried(std::move(tile.cloud), options, wanted_from_tile);
    return tile;
  };
  const auto add = [&](const libmap::FusionCounts& counts) {
    libmap::merge_into<libmap::FusionCounts>(result, counts);
    result.timings_s = fusion->report().timings_s;
  };
  if (folder == nullptr) {
    const libmap::TileFusion::Tile whole = make(0);
    add(whole.counts);
    tell_results(result, options, run);
    run.write_output(options.output,
                     [&](const fs::path& to) { libmap::write_cloud(to, whole.cloud); });
    return write_poses(options, result, run);
  }
  std::vector<std::string> names;
  for (const libmap::XyTile& tile : fusion->tiles())
    names.push_back(libmap::tile_file_name(tile, ""));
  const auto write = [&](std::size_t n, const fs::path& to) {
    const libmap::TileFusion::Tile tile = make(n);
    if (!tile.cloud.empty()) libmap::write_cloud(to, tile.cloud);
    return tile_json_of(tile.counts);
  };
  const auto finish = [&](const fs::path& to) {
    std::size_t written = 0;
    for (const std::string& name : names) {
      const auto counts = result_of<libmap::FusionCounts>(folder->tile_data(name));
      add(counts);
      if (counts.output_points == 0) continue;
      ++written;
      const fs::path file = folder->file(name, ".pcd");
      TileFolder::link_file(file, to / file.filename());
    }
    run.add_results({{"tiles", written}});
    tell_results(result, options, run);
    write_poses(options, result, run);
  };
  folder->make({names, ".pcd", write, finish});
}

void tell_consistency(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                      const PosesOption& taken, Run& run) {
  const libmap::PoseConsistency found =
      run.timed("consistency", [&] { return libmap::check_pose_consistency(scan, poses); });
  run.detail("{} pairs of frames: {:.1f} % of {} common measurements are contradictory",
             found.pairs, 100.0 * found.given.contradicted, found.given.measurements);
  if (const std::string warning = found.warning(); !warning.empty())
    run.warn("{}: {}", taken.source, warning);
}

// Warns if depth is not registered to color, because points then get the colors of other positions.
// Throws Error if the scales differ, because the depth itself is then wrong.
void check_registration(const libmap::ScanSource& scan, const FuseOptions& options, Run& run) {
  if (!options.fusion.color) return;
  const libmap::EdgeAgreement edges =
      run.timed("registration of depth", [&] { return libmap::check_edge_agreement(scan); });
  run.detail("edges of depth are {:.1f} px off the edges of {} images", edges.displacement_px,
             edges.frames);
  if (!edges.is_displaced()) return;
  if (edges.is_scaled())
    throw libmap::Error(edges.sentence() +
                            "; in scan.yaml, set depth_calibration to the calibration file of the "
                            "depth camera (convert a database first: graspmap convert SCAN -o "
                            "FOLDER), or use --no-color",
                        {.file = options.scan, .field = "depth_calibration"});
  run.warn("{}: {}; refine --write-calibration estimates the registration for --calibration",
           options.scan, edges.sentence());
}

void fuse(FuseOptions options, Run& run) {
  std::vector<std::string> inputs = scan_inputs(options.scan, options.poses);
  inputs.push_back(options.calibration.source);
  const bool in_tiles = is_tile_folder(options.output);
  if (!in_tiles) {
    libmap::require_cloud_format(options.output);
    run.claim_output(options.output, inputs);
  }
  claim_poses(options, inputs, run);
  const bool strict = options.fusion.strict;
  options.camera = known_camera(options.calibration, options.scan, options.poses, run);
  const auto scan = open_scan(options.scan, strict, run, options.camera);
  const libmap::Trajectory poses = find_poses(*scan, options.poses, strict, run);
  options.fusion.refined_poses = are_refined(options.poses);
  const bool in_true_frame = options.frame == CloudFrame::ground_truth;
  if (in_true_frame) require_truth(*scan);
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  run.manifest().frame = in_true_frame ? "ground truth" : "poses";
  std::optional<TileFolder> folder;
  if (in_tiles) {
    folder.emplace(options.output, tile_folder_names(options.output), inputs,
                   libmap::parse_share(options.tile), run);
    if (folder->is_complete()) return;
  }
  tell_consistency(*scan, poses, options.poses, run);
  check_registration(*scan, options, run);
  in_file(options.scan,
          [&] { make_tiles(options, *scan, poses, folder ? &*folder : nullptr, run); });
}

// Returns true if an argument is a folder of a camera rig or --rig.
bool names_rig(int argc, char** argv) {
  return std::any_of(argv + 1, argv + argc, [](const std::string& word) {
    std::error_code code;
    return word == "--rig" || word.starts_with("--rig=") ||
           fs::exists(fs::path(word) / libmap::rig_file_name, code);
  });
}

int fuse_scan(int argc, char** argv) {
  FuseOptions options;
  Command command("fuse");
  command.input("SCAN", options.scan, "scan: a database of RTAB-Map, or a folder of images");
  command.output(options.output, std::string("cloud (.pcd, .ply, .vtp, .csv)") + or_tile_folder);
  add_share_option(command, options.tile);
  add_poses_option(command, options.poses);
  add_calibration_option(command, options.calibration);
  command.option("--corrected-poses", "FILE", options.corrected_poses,
                 "output for the poses after registration (.tum, .kitti, .g2o, .toro), in the "
                 "frame of the given poses");
  command.parameters().add(
      "frame", options.frame,
      {{"poses", CloudFrame::poses}, {"ground-truth", CloudFrame::ground_truth}},
      "frame of the cloud; poses: frame of the poses; ground-truth: frame of the scan's true "
      "poses, to which the poses are aligned");
  command.parameters().add("tile_size_m", options.tile_m, libmap::positive,
                           "side of a tile if the output is a folder, m");
  libmap::bind(command.parameters(), options.fusion);
  return command.run(argc, argv, [&](Run& run) {
    require_folder_of_share(options.output, options.tile);
    if (options.fusion.sensor != "auto") libmap::sensor_file(options.fusion.sensor);
    fuse(options, run);
  });
}

}  // namespace

int main(int argc, char** argv) {
  return run_subcommand(argc, argv, {fuse_scan, fuse_rig},
                        argc > 1 && names_rig(argc, argv) ? fuse_rig : fuse_scan);
}
