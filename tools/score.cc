// graspmap score: graspability map of a terrain, tile by tile.
#include <fmt/format.h>

#include <string>

#include "libgtd/detect.h"
#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/tile_detection.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/cloud_pieces.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/plane_report.h"
#include "tools/support/result_counts.h"
#include "tools/support/score_store.h"

namespace {

using graspmap_tools::Run;

struct ScoreOptions {
  std::string terrain;
  std::string output;
  std::string tile = "1/1";
  std::string up = "auto";
  bool append = false;
  std::string points_at_once = "1000000";
  libgtd::MapFrame frame = libgtd::MapFrame::terrain;
  libgtd::DetectionOptions detection;
};

void bind(libmap::ParameterTable& table, ScoreOptions& options) {
  bind(table, options.detection.scenario);
  table.add("plane", options.detection.plane, libgtd::plane_source_names(),
            "fit: regression plane; none: the cloud is already in the terrain frame");
  table.add("up", options.up,
            "which side of the plane is outside: auto, or a direction X,Y,Z in the cloud's frame");
  table.add("frame", options.frame, libgtd::map_frame_names(), "frame of the map's points");
}

libgtd::TileShare parse_share(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto number = libmap::parse_integer(text.substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : libmap::parse_integer(text.substr(slash + 1));
  if (!number || !count || *count < 1 || *number < 1 || *number > *count || *count > 1000000)
    throw libmap::Error("no such share of the tiles",
                        {.field = "--tile", .value = text, .bound = "K/N with 1 <= K <= N"});
  return {static_cast<int>(*number), static_cast<int>(*count)};
}

std::size_t parse_points_at_once(const std::string& text) {
  const auto count = libmap::parse_integer(text);
  if (!count || *count < 1)
    throw libmap::Error("not a number of points",
                        {.field = "--points-at-once", .value = text, .bound = ">= 1"});
  return static_cast<std::size_t>(*count);
}

std::optional<Eigen::Vector3d> parse_up(const std::string& text) {
  if (text == "auto") return std::nullopt;
  return graspmap_tools::parse_vector(text, "--up");
}

void add_results(libmap::Manifest& manifest, const libgtd::DetectionResult& result,
                 const ScoreOptions& options) {
  const graspmap_tools::ResultCounts count(manifest);
  const Eigen::Vector3d& origin = result.map.lattice.origin_m;
  manifest.frame = options.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
  manifest.transforms.emplace_back("terrain_from_input", result.map.terrain_from_input);
  manifest.results.emplace_back("lattice_origin_m",
                                std::vector<double>{origin.x(), origin.y(), origin.z()});
  count("input_points", result.points);
  if (result.plane) {
    manifest.results.emplace_back("plane_rmse_m", result.plane->rmse_m);
    manifest.results.emplace_back("up_source", std::string(to_text(result.plane->up_source)));
  }
  if (result.downsampled_points > 0) count("downsampled_points", result.downsampled_points);
  if (options.detection.scenario.interpolation) {
    count("interpolated_points", result.interpolated_points);
    manifest.results.emplace_back("interpolation_grid_m", result.grid_spacing_m);
  }
  count("occupied_voxels", result.occupied_voxels);
  count("mask_side_voxels", static_cast<std::size_t>(result.mask.side));
  count("mask_layers", static_cast<std::size_t>(result.mask.layers));
  count("tiles", result.tiles);
  count("scored_voxels", result.map.voxels.size());
  count("border_voxels", result.border_voxels);
  count("curvature_points", result.curvature_points);
  count("convex_points", result.convex_points);
  count("graspable_voxels", result.graspable_voxels);
  const libgtd::Scenario& scenario = options.detection.scenario;
  if (scenario.fits_normals())
    manifest.results.emplace_back("normal_radius_m",
                                  libgtd::normal_radius_m(result.mask, scenario));
  if (scenario.orientation == libgtd::Orientation::surface)
    count("unoriented_voxels", result.unoriented_voxels);
  if (result.map.content.obstacles) count("obstacle_voxels", result.obstacle_voxels);
  manifest.timings_s.insert(manifest.timings_s.end(), result.timings_s.begin(),
                            result.timings_s.end());
}

void say_result(const libgtd::DetectionResult& result, const ScoreOptions& options, Run& run) {
  if (result.plane) graspmap_tools::report_plane(*result.plane, options.terrain, run);
  for (const auto& [name, seconds] : result.timings_s)
    run.detail(fmt::format("{}: {:.3f} s", name, seconds));
  run.say(fmt::format("{} points, {} occupied voxels, {} scored in {} tiles, {} graspable",
                      result.points, result.occupied_voxels, result.map.voxels.size(), result.tiles,
                      result.graspable_voxels));
  if (result.map.content.normals)
    run.say(fmt::format("mask tilted to the surface's normal within {:g} m, {} voxels without one",
                        libgtd::normal_radius_m(result.mask, options.detection.scenario),
                        result.unoriented_voxels));
  if (result.map.content.obstacles)
    run.say(fmt::format("{} voxels are obstacles", result.obstacle_voxels));
  else if (result.map.content.slopes)
    run.say("obstacles are evaluated when `graspmap convert` merges the shares");
  if (result.map.voxels.empty() && options.detection.share.count == 1)
    run.warn("the terrain is smaller than the gripper mask: nothing was scored");
}

// A cloud file, or the pieces of a folder one after the other.
libmap::PiecesReadResult read_terrain(const std::string& path) {
  if (std::filesystem::is_directory(path)) return libmap::read_pieces(libmap::cloud_pieces(path));
  libmap::CloudReadResult read = libmap::read_cloud(path);
  return {std::move(read.cloud), read.dropped_points};
}

void add_terrain_input(const std::string& path, Run& run) {
  for (const auto& piece : libmap::cloud_pieces(path)) run.add_input(piece);
}

void score(ScoreOptions& options, Run& run) {
  libgtd::Scenario& scenario = options.detection.scenario;
  options.detection.share = parse_share(options.tile);
  options.detection.up = parse_up(options.up);
  scenario.check();
  if (options.detection.up && options.detection.plane == libgtd::PlaneSource::none)
    throw libmap::Error("says on which side of the fitted plane up is: with --plane none it is z",
                        {.field = "--up", .value = options.up});
  const auto gripper_file = libmap::find_data_file("grippers", scenario.gripper);
  // Before any work: a voxel size that does not suit the gripper shows here.
  libgtd::make_gripper_mask(libgtd::gripper_of(options.detection),
                            {scenario.method, scenario.voxel_size_m, scenario.extra_void_layers});
  if (libgtd::is_tile_store_name(options.output)) {
    graspmap_tools::score_into_store(
        {.terrain = options.terrain,
         .store = options.output,
         .gripper_file = gripper_file,
         .frame = options.frame,
         .append = options.append,
         .points_at_once = parse_points_at_once(options.points_at_once),
         .detection = options.detection},
        run);
    return;
  }
  if (options.append) throw libmap::Error("adds to a tile store, MAP.tiles", {.field = "--append"});
  if (options.points_at_once != ScoreOptions{}.points_at_once)
    throw libmap::Error("is for a tile store, MAP.tiles", {.field = "--points-at-once"});
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.terrain});
  const libmap::PiecesReadResult read =
      run.timed("read", [&] { return read_terrain(options.terrain); });
  if (read.cloud.empty() && read.dropped_points > 0)
    throw libmap::Error(fmt::format("none of its {} points has a position", read.dropped_points),
                        {.file = options.terrain});
  if (read.cloud.empty()) throw libmap::Error("the cloud has no points", {.file = options.terrain});
  if (read.dropped_points > 0)
    run.warn(fmt::format("{}: {} points without a position were dropped", options.terrain,
                         read.dropped_points));
  if (scenario.orientation == libgtd::Orientation::surface && !read.cloud.has_normals())
    run.warn(
        fmt::format("{}: has no normals: the outside is where the terrain's z points, and the "
                    "sides of walls are guessed",
                    options.terrain));
  libgtd::DetectionResult result;
  try {
    result = libgtd::detect(read.cloud, options.detection, run.progress());
  } catch (const libmap::Error& error) {
    throw error.in_file(options.terrain);
  }
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("tile", options.tile);
  add_terrain_input(options.terrain, run);
  run.add_input(gripper_file);
  add_results(manifest, result, options);
  graspmap_tools::carry_transforms(options.terrain, run);
  say_result(result, options, run);
  const libmap::PointCloud cloud = libgtd::to_cloud(result.map, options.frame);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  ScoreOptions options;
  graspmap_tools::Command command("score");
  command.input("TERRAIN", options.terrain,
                "cloud of the terrain (.pcd, .ply, .csv), or a folder of its pieces");
  command.output(options.output,
                 "graspability map (.pcd, .ply, .vtp, .csv), or tile store (.tiles)");
  command.option("--tile", "K/N", options.tile,
                 "score only share K of N of the tiles; `graspmap convert` merges the shares");
  command.option("--points-at-once", "N", options.points_at_once,
                 "into a tile store: how many points are in memory at once, about 250 bytes each; "
                 "the map is the same");
  command.flag("--append", options.append,
               "the terrain has more pieces than the tile store: score the tiles that they touch");
  bind(command.parameters(), options);
  command.config_resolver(
      [](const std::string& name) { return libmap::find_data_file("scenarios", name); });
  return command.run(argc, argv, [&](Run& run) { score(options, run); });
}
