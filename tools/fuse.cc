// graspmap fuse: the depth images of a scan -> one oriented, colored cloud.
#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/depth_fusion.h"
#include "libmap/scan/rig_images.h"
#include "libmap/scan/scan_source.h"
#include "libmap/trajectory/trajectory_io.h"
#include "tools/support/command_line.h"
#include "tools/support/piece_folder.h"
#include "tools/support/piece_progress.h"
#include "tools/support/results.h"
#include "tools/support/scan_poses.h"
#include "tools/support/store_filling.h"
#include "tools/support/usages.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

// Frame of the cloud: that of the poses, or ground truth's.
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

// On scans where nothing moves 2 to 4 % are dropped, at the edges of surfaces.
void tell_contradictions(const libmap::DepthFusionResult& result, Run& run) {
  constexpr double usual_share = 0.06;
  const libmap::SurfacePointCounts& points = result.points;
  const auto dropped = static_cast<double>(points.seen_through + points.missed + points.beside);
  if (dropped < usual_share * (dropped + static_cast<double>(result.points_made))) return;
  run.say(
      "{} places left out because frames contradict each other, as where something has moved: "
      "others see through {}, measure nothing at {}, and {} hang together with these",
      dropped, points.seen_through, points.missed, points.beside);
}

void tell_results(const libmap::DepthFusionResult& result, const FuseOptions& options, Run& run) {
  for (const auto& [node, fault] : result.skipped)
    run.warn(std::string("skipped: ") + fault.what());
  const libmap::DepthPixelCounts& pixels = result.pixels;
  run.add_results(libmap::described(result));
  run.add_timings(result.timings_s);
  run.detail(
      "{} of {} pixels used; {} unmeasured, {} out of range, {} flying, {} grazing, {} without a "
      "ray",
      pixels.used, pixels.pixels, pixels.unmeasured, pixels.out_of_range, pixels.flying,
      pixels.grazing, pixels.without_ray);
  if (result.registration_rounds > 0)
    run.say("poses corrected so that frames agree: by {:.1f} mm and {:.2f} deg (RMS)",
            1e3 * result.registration_shift_m, result.registration_turn_deg);
  tell_contradictions(result, run);
  run.say("{} frames, {} measurements -> {} points", result.frames, pixels.used,
          result.points_made);
  if (result.points_made > 0) return;
  if (result.points.unconfirmed > 0)
    run.warn("--min-views {} leaves no point: the cloud is empty; {} frames see one at most",
             options.fusion.min_views, result.points.max_views);
  else
    run.warn("nothing was measured within the limits: the cloud is empty");
}

// Of several shares the last one claims them, when it writes them.
bool is_share(const FuseOptions& options) { return parse_share(options.tile).count > 1; }

void claim_poses(const FuseOptions& options, const std::vector<std::string>& inputs, Run& run) {
  if (options.corrected_poses.empty()) return;
  if (!libmap::is_trajectory_path(options.corrected_poses))
    throw libmap::Error("not a format of poses", {.field = "--corrected-poses",
                                                  .value = options.corrected_poses,
                                                  .bound = ".tum, .kitti, .g2o or .toro"});
  if (!is_share(options)) run.claim_output(options.corrected_poses, inputs);
}

// What carries the cloud into the frame that is wanted, by the poses that it is made with.
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

void fuse_whole(const FuseOptions& options, const libmap::ScanSource& scan,
                const libmap::Trajectory& poses, Run& run) {
  libmap::DepthFusionResult result = in_file(options.scan, [&] {
    return libmap::fuse_depth(scan, poses, options.fusion, run.progress());
  });
  const libmap::PointCloud cloud = carried(std::move(result.cloud), options,
                                           wanted_from_cloud(options, scan, poses, result, run));
  tell_results(result, options, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
  write_poses(options, result, run);
}

std::array<double, 3> numbers_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Eigen::Vector3d vector_of(const nlohmann::json& json) {
  const auto numbers = json.get<std::array<double, 3>>();
  return Eigen::Vector3d(numbers.data());
}

nlohmann::json survey_facts(const libmap::FusionSurvey& survey) {
  nlohmann::json frames = nlohmann::json::array();
  for (const libmap::FusionFrame& frame : survey.frames) {
    const Eigen::Matrix4d& pose = frame.grid_from_base.matrix();
    frames.push_back({{"node", frame.node},
                      {"grid_from_base", std::vector<double>(pose.data(), pose.data() + 16)},
                      {"image_pixels", frame.image_pixels},
                      {"reach_min_m", numbers_of(frame.reach.min())},
                      {"reach_max_m", numbers_of(frame.reach.max())},
                      {"max_ray_length", frame.max_ray_length},
                      {"max_pixel_pitch", frame.max_pixel_pitch}});
  }
  nlohmann::json skipped = nlohmann::json::array();
  for (const auto& [node, fault] : survey.skipped) skipped.push_back({node, fault.what()});
  return {{"grid_origin_m", numbers_of(survey.grid_origin)},
          {"frames", frames},
          {"skipped", skipped},
          {"registration_rounds", survey.registration_rounds},
          {"disagreement_before_m", survey.disagreement_before_m},
          {"disagreement_after_m", survey.disagreement_after_m}};
}

libmap::FusionSurvey survey_of(const nlohmann::json& facts) {
  libmap::FusionSurvey survey;
  survey.grid_origin = vector_of(facts.at("grid_origin_m"));
  for (const nlohmann::json& its : facts.at("frames")) {
    libmap::FusionFrame& frame = survey.frames.emplace_back();
    its.at("node").get_to(frame.node);
    const auto pose = its.at("grid_from_base").get<std::array<double, 16>>();
    frame.grid_from_base.matrix() = Eigen::Map<const Eigen::Matrix4d>(pose.data());
    its.at("image_pixels").get_to(frame.image_pixels);
    frame.reach = {vector_of(its.at("reach_min_m")), vector_of(its.at("reach_max_m"))};
    its.at("max_ray_length").get_to(frame.max_ray_length);
    its.at("max_pixel_pitch").get_to(frame.max_pixel_pitch);
  }
  for (const auto& [node, fault] :
       facts.at("skipped").get<std::vector<std::pair<int, std::string>>>())
    survey.skipped.emplace_back(node, libmap::Error(fault));
  facts.at("registration_rounds").get_to(survey.registration_rounds);
  facts.at("disagreement_before_m").get_to(survey.disagreement_before_m);
  facts.at("disagreement_after_m").get_to(survey.disagreement_after_m);
  return survey;
}

// Each tile is made, written and forgotten.
void make_tiles(const FuseOptions& options, const libmap::ScanSource& scan,
                const libmap::Trajectory& poses, PieceProgress& progress, Run& run) {
  std::optional<libmap::TileFusion> fusion;
  const PieceProgress::Facts found = progress.common_facts([&] {
    fusion.emplace(scan, poses, options.fusion, options.tile_m, run.progress());
    return survey_facts(fusion->survey());
  });
  if (!fusion) {
    const libmap::FusionSurvey survey = survey_of(found);
    fusion.emplace(scan, poses, options.fusion, options.tile_m, run.progress(), &survey);
  }
  libmap::DepthFusionResult result = fusion->report();
  const libmap::Pose wanted_from_tile = wanted_from_cloud(options, scan, poses, result, run);
  std::vector<std::string> pieces;
  for (const libmap::PlanTile& tile : fusion->tiles())
    pieces.push_back(libmap::piece_file_name(tile, ""));
  const auto make = [&](std::size_t n, const fs::path& to) {
    libmap::TileFusion::Tile tile = fusion->make(n);
    if (!tile.cloud.empty())
      libmap::write_cloud(to, carried(std::move(tile.cloud), options, wanted_from_tile));
    return facts_of(tile.counts);
  };
  const auto finish = [&](const fs::path& folder) {
    std::size_t written = 0;
    for (const std::string& piece : pieces) {
      const auto counts = result_of<libmap::FusionCounts>(progress.facts(piece));
      libmap::merge_into<libmap::FusionCounts>(result, counts);
      if (counts.points_made == 0) continue;
      ++written;
      const fs::path file = progress.file(piece, ".pcd");
      PieceProgress::link_file(file, folder / file.filename());
    }
    result.timings_s = fusion->report().timings_s;
    run.add_results({{"pieces", written}});
    tell_results(result, options, run);
    write_poses(options, result, run);
  };
  progress.make({pieces, ".pcd", make, finish});
}

void fuse(FuseOptions options, Run& run) {
  std::vector<std::string> inputs = scan_inputs(options.scan, options.poses);
  inputs.push_back(options.calibration.source);
  const bool in_pieces = is_piece_folder(options.output);
  if (!in_pieces) {
    libmap::require_cloud_format(options.output);
    run.claim_output(options.output, inputs);
  }
  claim_poses(options, inputs, run);
  const bool strict = options.fusion.strict;
  options.camera = known_camera(options.calibration, options.scan, options.poses, run);
  const auto scan = open_scan(options.scan, strict, run, options.camera);
  const libmap::Trajectory poses = find_poses(*scan, options.poses, strict, run);
  const bool in_true_frame = options.frame == CloudFrame::ground_truth;
  if (in_true_frame) require_truth(*scan);
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  run.manifest().frame = in_true_frame ? "ground truth" : "poses";
  if (!in_pieces) return fuse_whole(options, *scan, poses, run);
  PieceProgress progress(options.output, piece_folder_names(options.output), inputs,
                         parse_share(options.tile), run);
  if (progress.is_complete()) return;
  in_file(options.scan, [&] { make_tiles(options, *scan, poses, progress, run); });
}

// A folder of a camera rig, or --rig, which names the rig.
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
  command.output(options.output, std::string("cloud (.pcd, .ply, .vtp, .csv)") + or_piece_folder);
  add_share_option(command, options.tile);
  add_poses_option(command, options.poses);
  add_calibration_option(command, options.calibration);
  command.option("--corrected-poses", "FILE", options.corrected_poses,
                 "also write the poses that the frames were fused by (.tum, .kitti, .g2o, .toro), "
                 "in the frame of --poses");
  command.parameters().add(
      "frame", options.frame,
      {{"poses", CloudFrame::poses}, {"ground-truth", CloudFrame::ground_truth}},
      "frame of the cloud; ground-truth: carried there by aligning the poses with the true ones");
  command.parameters().add("tile_size_m", options.tile_m, libmap::positive,
                           "side of a piece, m, where the output is a folder");
  libmap::bind(command.parameters(), options.fusion);
  return command.run(argc, argv, [&](Run& run) {
    require_folder_of_share(options.output, options.tile);
    fuse(options, run);
  });
}

}  // namespace

int main(int argc, char** argv) {
  return run_usage(argc, argv, {fuse_scan, fuse_rig},
                   argc > 1 && names_rig(argc, argv) ? fuse_rig : fuse_scan);
}
