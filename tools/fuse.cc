// graspmap fuse: the depth images of a scan -> one oriented, colored cloud.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/depth_fusion.h"
#include "libmap/core/error.h"
#include "libmap/scan/rig_images.h"
#include "libmap/scan/scan_source.h"
#include "libmap/trajectory/trajectory_io.h"
#include "tools/support/command_line.h"
#include "tools/support/fuse_rig.h"
#include "tools/support/result_counts.h"
#include "tools/support/scan_poses.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;

// Frame of the cloud: that of the poses, or ground truth's.
enum class CloudFrame { poses, ground_truth };

struct FuseOptions {
  std::string scan;
  std::string output;
  graspmap_tools::PosesOption poses;
  std::string corrected_poses;
  CloudFrame frame = CloudFrame::poses;
  libmap::DepthFusionOptions fusion;
};

void add_results(const libmap::DepthFusionResult& result, libmap::Manifest& manifest) {
  const graspmap_tools::ResultCounts count(manifest);
  count("frames", result.frames);
  count("skipped_frames", result.skipped.size());
  count("pixels", result.pixels.pixels);
  count("measurements_used", result.pixels.used);
  count("rejected_unmeasured", result.pixels.unmeasured);
  count("rejected_out_of_range", result.pixels.out_of_range);
  count("rejected_without_ray", result.pixels.without_ray);
  count("rejected_flying", result.pixels.flying);
  count("rejected_grazing", result.pixels.grazing);
  count("registration_rounds", static_cast<std::size_t>(result.registration_rounds));
  manifest.results.emplace_back("registration_shift_m", result.registration_shift_m);
  manifest.results.emplace_back("registration_turn_deg", result.registration_turn_deg);
  manifest.results.emplace_back("disagreement_before_m", result.disagreement_before_m);
  manifest.results.emplace_back("disagreement_after_m", result.disagreement_after_m);
  count("occupied_voxels", result.occupied_voxels);
  count("surface_elements", result.elements);
  count("dropped_too_few_views", result.points.unconfirmed);
  count("dropped_seen_through", result.points.seen_through);
  count("dropped_beyond_edges", result.points.bent_away);
  count("merged", result.points.merged);
  count("points", result.cloud.size());
  count("points_beyond_edges", result.points.extended_points);
  manifest.timings_s.insert(manifest.timings_s.end(), result.timings_s.begin(),
                            result.timings_s.end());
}

void say_result(const libmap::DepthFusionResult& result, const FuseOptions& options, Run& run) {
  for (const auto& [name, seconds] : result.timings_s)
    run.detail(fmt::format("{}: {:.3f} s", name, seconds));
  const libmap::DepthPixelCounts& pixels = result.pixels;
  run.detail(
      fmt::format("{} of {} pixels used; {} unmeasured, {} out of range, {} flying, {} "
                  "grazing, {} without a ray",
                  pixels.used, pixels.pixels, pixels.unmeasured, pixels.out_of_range, pixels.flying,
                  pixels.grazing, pixels.without_ray));
  if (result.registration_rounds > 0)
    run.say(fmt::format("poses corrected so that frames agree: by {:.1f} mm and {:.2f} deg (RMS)",
                        1e3 * result.registration_shift_m, result.registration_turn_deg));
  run.say(fmt::format("{} frames, {} measurements -> {} points", result.frames, pixels.used,
                      result.cloud.size()));
  if (!result.cloud.empty()) return;
  if (result.points.unconfirmed > 0)
    run.warn(
        fmt::format("--min-views {} leaves no point: the cloud is empty; {} frames see one "
                    "at most",
                    options.fusion.min_views, result.points.max_views));
  else
    run.warn("nothing was measured within the limits: the cloud is empty");
}

void fuse(FuseOptions options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, graspmap_tools::scan_inputs(options.scan, options.poses));
  if (!options.corrected_poses.empty()) {
    if (!libmap::is_trajectory_path(options.corrected_poses))
      throw libmap::Error("not a format of poses", {.file = {},
                                                    .field = "--corrected-poses",
                                                    .value = options.corrected_poses,
                                                    .bound = ".tum, .kitti, .g2o or .toro"});
    run.claim_output(options.corrected_poses,
                     graspmap_tools::scan_inputs(options.scan, options.poses));
  }
  const bool strict = options.fusion.strict;
  const auto scan = graspmap_tools::open_scan(options.scan, strict, run);
  const libmap::Trajectory poses = graspmap_tools::find_poses(*scan, options.poses, strict, run);
  const bool in_true_frame = options.frame == CloudFrame::ground_truth;
  if (in_true_frame) graspmap_tools::require_truth(*scan);
  libmap::DepthFusionResult result;
  try {
    result = libmap::fuse_depth(*scan, poses, options.fusion, run.progress());
  } catch (const libmap::Error& error) {
    throw error.in_file(options.scan);
  }
  for (const auto& [node, fault] : result.skipped)
    run.warn(std::string("skipped: ") + fault.what());
  // By the poses that the cloud was made with.
  if (in_true_frame)
    result.cloud = libmap::transform_cloud(
        result.cloud,
        graspmap_tools::truth_from_poses(
            *scan, result.registration_rounds > 0 ? result.poses : poses, options.poses, run));
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  libmap::Manifest& manifest = run.manifest();
  manifest.frame = in_true_frame ? "ground truth" : "poses";
  add_results(result, manifest);
  say_result(result, options, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, result.cloud); });
  if (options.corrected_poses.empty()) return;
  manifest.frame = "poses";
  run.write_output(options.corrected_poses, [&](const auto& temporary) {
    libmap::write_trajectory(temporary, {result.poses, {}});
  });
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
  graspmap_tools::Command command("fuse");
  command.input("SCAN", options.scan, "scan: a database of RTAB-Map, or a folder of images");
  command.output(options.output, "cloud (.pcd, .ply, .vtp, .csv)");
  graspmap_tools::add_poses_option(command, options.poses);
  command.option(
      "--corrected-poses", "FILE", options.corrected_poses,
      "also write the poses that the frames were fused by (.tum, .kitti, .g2o, .toro), in the "
      "frame of --poses");
  command.parameters().add(
      "frame", options.frame,
      {{"poses", CloudFrame::poses}, {"ground-truth", CloudFrame::ground_truth}},
      "frame of the cloud; ground-truth: carried there by aligning the poses with the true ones");
  libmap::bind(command.parameters(), options.fusion);
  return command.run(argc, argv, [&](Run& run) { fuse(options, run); });
}

}  // namespace

int main(int argc, char** argv) {
  return graspmap_tools::run_usage(argc, argv, argc > 1 && names_rig(argc, argv), fuse_scan,
                                   graspmap_tools::fuse_rig);
}
