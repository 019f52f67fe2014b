// graspmap score: graspability map of a terrain, tile by tile.
#include "libgtd/detect.h"
#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/tile_detection.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/cloud_pieces.h"
#include "libmap/core/data_folder.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/option_values.h"
#include "tools/support/score_store.h"
#include "tools/support/store_filling.h"

using namespace graspmap_tools;

namespace {

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
  bind(table, options.detection);
  table.add("up", options.up,
            "which side of the plane is outside: auto, or a direction X,Y,Z in the cloud's frame");
  table.add("frame", options.frame, libgtd::map_frame_names(), "frame of the map's points");
}

std::size_t parse_points_at_once(const std::string& text) {
  const auto count = libmap::parse_integer(text);
  if (!count || *count < 1)
    throw libmap::Error("not a number of points",
                        {.field = "--points-at-once", .value = text, .bound = ">= 1"});
  return static_cast<std::size_t>(*count);
}

void add_results(const libgtd::DetectionResult& result, const ScoreOptions& options, Run& run) {
  libmap::Manifest& manifest = run.manifest();
  manifest.frame = options.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
  manifest.transforms.emplace_back("terrain_from_input", result.map.terrain_from_input);
  run.add_results(
      {{"lattice_origin_m", result.map.lattice.origin_m}, {"input_points", result.points}});
  if (result.plane)
    run.add_results(
        {{"plane_rmse_m", result.plane->rmse_m}, {"up_source", to_text(result.plane->up_source)}});
  if (result.downsampled_points > 0)
    run.add_results({{"downsampled_points", result.downsampled_points}});
  const libgtd::Scenario& scenario = options.detection.scenario;
  if (scenario.interpolation)
    run.add_results({{"interpolated_points", result.interpolated_points},
                     {"interpolation_grid_m", result.grid_spacing_m}});
  run.add_results({{"occupied_voxels", result.occupied_voxels},
                   {"mask_side_voxels", result.mask.side},
                   {"mask_layers", result.mask.layers},
                   {"tiles", result.tiles},
                   {"scored_voxels", result.map.voxels.size()},
                   {"border_voxels", result.border_voxels},
                   {"curvature_points", result.curvature_points},
                   {"convex_points", result.convex_points},
                   {"graspable_voxels", result.graspable_voxels}});
  if (scenario.fits_normals())
    run.add_results({{"normal_radius_m", libgtd::normal_radius_m(result.mask, scenario)}});
  if (scenario.orientation == libgtd::Orientation::surface)
    run.add_results({{"unoriented_voxels", result.unoriented_voxels}});
  if (result.map.content.obstacles) run.add_results({{"obstacle_voxels", result.obstacle_voxels}});
}

void say_result(const libgtd::DetectionResult& result, const ScoreOptions& options, Run& run) {
  if (result.plane) report_plane(*result.plane, options.terrain, run);
  run.add_timings(result.timings_s);
  run.say("{} points, {} occupied voxels, {} scored in {} tiles, {} graspable", result.points,
          result.occupied_voxels, result.map.voxels.size(), result.tiles, result.graspable_voxels);
  if (result.map.content.normals)
    run.say("mask tilted to the surface's normal within {:g} m, {} voxels without one",
            libgtd::normal_radius_m(result.mask, options.detection.scenario),
            result.unoriented_voxels);
  if (result.map.content.obstacles)
    run.say("{} voxels are obstacles", result.obstacle_voxels);
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

void score(ScoreOptions& options, Run& run) {
  libgtd::Scenario& scenario = options.detection.scenario;
  options.detection.share = parse_share(options.tile);
  if (options.up != "auto") options.detection.up = parse_vector(options.up, "--up");
  scenario.check();
  if (options.detection.up && options.detection.plane == libgtd::PlaneSource::none)
    throw libmap::Error("says on which side of the fitted plane up is: with --plane none it is z",
                        {.field = "--up", .value = options.up});
  const auto gripper_file = libmap::find_data_file("grippers", scenario.gripper);
  // Before any work: a voxel size that does not suit the gripper shows here.
  const libgtd::Gripper gripper = libgtd::gripper_of(options.detection);
  if (scenario.method == libgtd::Method::calibrated)
    in_file(gripper_file.string(), [&] { libgtd::require_hold_model(gripper); });
  libgtd::make_gripper_mask(gripper,
                            {scenario.method, scenario.voxel_size_m, scenario.extra_void_layers});
  if (libgtd::is_tile_store_name(options.output)) {
    score_into_store({.terrain = options.terrain,
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
  require_points(read.cloud.size(), read.dropped_points, options.terrain, run);
  if (scenario.orientation == libgtd::Orientation::surface && !read.cloud.has_normals())
    run.warn(
        "{}: has no normals: the outside is where the terrain's z points, and the sides of walls "
        "are guessed",
        options.terrain);
  const libgtd::DetectionResult result = in_file(options.terrain, [&] {
    return libgtd::detect(read.cloud, options.detection, run.progress());
  });
  run.manifest().parameters.emplace_back("tile", options.tile);
  for (const auto& piece : libmap::cloud_pieces(options.terrain)) run.add_input(piece);
  for (const auto& input : libgtd::gripper_files(gripper_file)) run.add_input(input);
  add_results(result, options, run);
  carry_transforms(options.terrain, run);
  say_result(result, options, run);
  const libmap::PointCloud cloud = libgtd::to_cloud(result.map, options.frame);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  ScoreOptions options;
  Command command("score");
  command.input("TERRAIN", options.terrain,
                "cloud of the terrain (.pcd, .ply, .csv) or DEM (.tif), or a folder of its pieces");
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
