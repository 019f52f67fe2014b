// graspmap analyze: graspable area and regions of a map, and differences between maps.
#include "libgtd/evaluate/analysis_tables.h"
#include "libmap/io/cloud_io.h"
#include "libmap/view/image_io.h"
#include "libmap/view/offscreen.h"
#include "tools/support/analysis_outputs.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"
#include "tools/support/option_values.h"
#include "tools/support/placement.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

constexpr const char* no_start = "largest";

struct AnalyzeOptions {
  std::vector<std::string> maps;
  std::string map;  // the single map
  std::string other;
  std::string folder;
  std::string start = no_start;
  PointFrame points_frame = PointFrame::input;
  std::string transform = "auto";
  bool images = true;
  libgtd::MapSurfaceOptions surface;
  libgtd::MapAnalysisOptions analysis;
  libgtd::MapRegionOptions regions;
  libgtd::RegionReachOptions reach;
  libgtd::MapChangeOptions change;
  MapTableOptions table;
};

// Options of the analysis of one map.
void bind_one(libmap::ParameterTable& table, AnalyzeOptions& options) {
  bind(table, options.analysis);
  bind(table, options.surface);
  bind(table, options.regions);
  bind(table, options.reach);
  table.add("start", options.start,
            "start position of the robot: X,Y,Z (m) in the frame of --points-frame; largest: on "
            "the largest graspable region");
  bind(table, options.change);
  table.add(
      "transform", options.transform,
      "transform from OTHER's frame to MAP's: X,Y,Z,ROLL,PITCH,YAW in m and degrees, or a file of "
      "a 4 x 4 matrix; auto: from the manifests, if both clouds are in one frame or from one map");
}

void bind(libmap::ParameterTable& table, AnalyzeOptions& options) {
  bind_one(table, options);
  table.add("points_frame", options.points_frame, point_frame_names(),
            "frame of the start position and of the expected regions; input: frame of the scored "
            "cloud; terrain: frame of scoring, z up; map: frame before `graspmap crop`");
  table.add_former_key("pictures", "images");
  table.add("images", options.images, "write images and charts, not only tables");
  bind(table, options.table);
}

// A map as cloud and as voxels of its lattice.
struct ReadMap {
  libmap::PointCloud cloud;
  std::optional<libmap::Manifest> manifest;
  libgtd::VoxelMap voxels;
};

ReadMap read_map(const std::string& file, Run& run) {
  if (is_tile_store(file))
    throw libmap::Error("is a tile store; merge it into one map with `graspmap convert` first",
                        {.file = file});
  ReadMap map;
  map.cloud = libmap::read_cloud(file).cloud;
  map.manifest = libmap::read_manifest_of(file);
  map.voxels = in_file(file, [&] {
    return libgtd::voxel_map_of(map.cloud,
                                map.manifest ? libgtd::map_info(*map.manifest) : libgtd::MapInfo{});
  });
  if (!map.manifest)
    run.warn(file +
             ": has no manifest; its points are assumed to be in the terrain frame and above the "
             "zero plane");
  else if (map.manifest->find_parameter("zero_plane_m") == nullptr)
    run.warn(file +
             ": the manifest has no zero plane; all points are assumed to be above the zero plane");
  run.add_input(file);
  return map;
}

// Transform from the frame of OTHER's points to that of MAP's.
libmap::Pose map_from_other(const AnalyzeOptions& options, const ReadMap& map, const ReadMap& other,
                            Run& run) {
  if (options.transform != "auto") return parse_transform(options.transform, "--transform");
  const auto has_crop = [](const ReadMap& one) {
    return one.manifest && one.manifest->find_transform(site_from_map_name) != nullptr;
  };
  if (has_crop(map) && has_crop(other))
    return *site_from_map_of(options.map) * site_from_map_of(options.other)->inverse();
  if (has_crop(map) != has_crop(other))
    run.warn("only " + (has_crop(map) ? options.map : options.other) +
             " was cropped; both scored clouds are assumed to be in one frame (--transform sets "
             "the transform)");
  return map_from_input(map.manifest) * map_from_input(other.manifest).inverse();
}

struct Analysis {
  libgtd::MapSurface surface;
  libgtd::MapAnalysis ground;
  libgtd::MapRegionResult regions;
  libgtd::RegionReach reach;
};

Analysis analyze_map(AnalyzeOptions& options, const ReadMap& map, Run& run) {
  if (options.start != no_start) {
    const libmap::Pose map_from_points =
        graspmap_tools::map_from_points(options.map, options.points_frame, run);
    options.reach.start =
        map.voxels.terrain_from_map * (map_from_points * parse_vector(options.start, "--start"));
  }
  return in_file(options.map, [&] {
    Analysis analysis;
    analysis.surface =
        run.timed("surface", [&] { return measure_surface(map.voxels, options.surface); });
    analysis.ground = run.timed(
        "ground", [&] { return analyze_map(map.voxels, analysis.surface, options.analysis); });
    analysis.regions = run.timed(
        "regions", [&] { return find_regions(map.voxels, analysis.surface, options.regions); });
    analysis.reach =
        run.timed("reach", [&] { return find_reach(map.voxels, analysis.regions, options.reach); });
    return analysis;
  });
}

struct Comparison {
  ReadMap other;
  libmap::Pose map_terrain_from_other_terrain = libmap::Pose::Identity();
  libgtd::MapChange change;
};

Comparison compare(const AnalyzeOptions& options, const ReadMap& map, const Analysis& analysis,
                   Run& run) {
  Comparison comparison;
  comparison.other = run.timed("read", [&] { return read_map(options.other, run); });
  const libmap::Pose map_from_points = map_from_other(options, map, comparison.other, run);
  comparison.map_terrain_from_other_terrain = map.voxels.terrain_from_map * map_from_points *
                                              comparison.other.voxels.terrain_from_map.inverse();
  comparison.change = in_file(options.other, [&] {
    return run.timed("change", [&] {
      return compare_maps(map.voxels, analysis.surface, comparison.other.voxels,
                          comparison.map_terrain_from_other_terrain, options.change);
    });
  });
  return comparison;
}

std::string percent_text(const std::optional<double>& fraction) {
  return fraction ? fmt::format("{:.2f} %", 100.0 * *fraction) : "none";
}

void say_ground(const Analysis& analysis, const AnalyzeOptions& options, Run& run) {
  const libgtd::MapAnalysis& ground = analysis.ground;
  run.info("{} of {} voxels evaluated: {:.3f} m2 of ground, {:.4f} m2 ({}) graspable",
           ground.ground.voxels, ground.voxels, ground.ground.area_m2,
           ground.ground.graspable_area_m2, percent_text(ground.ground.graspable_fraction()));
  if (ground.column_coverage < 0.95)
    run.warn(
        "{}: only {:.0f} % of the vertical columns inside the ground have a voxel, which splits "
        "regions; --adjacency-voxels 2 joins them across one empty voxel",
        options.map, 100.0 * ground.column_coverage);
  const libgtd::RegionReach& reach = analysis.reach;
  if (analysis.regions.regions.empty()) {
    run.info("no graspable region");
    return;
  }
  run.info(
      "{} regions, the largest {:.4f} m2; strides of {:g} m: {} groups, of {:.3f} m: one group",
      analysis.regions.regions.size(), analysis.regions.regions.front().area_m2,
      options.reach.stride_m, reach.groups, *reach.joining_stride_m);
  run.info("{} regions ({:.4f} m2) are reachable from {}", reach.reachable_regions,
           reach.reachable_area_m2, options.start == no_start ? "region 1" : options.start);
  if (reach.reachable_regions == 0)
    run.warn("no region is reachable; the nearest, {}, is {:.3f} m away", *reach.start_region + 1,
             reach.start_distance_m);
}

void say_change(const libgtd::MapChange& change, const AnalyzeOptions& options, Run& run) {
  const libgtd::ChangeSummary& evaluated = change.evaluated;
  run.info("{} common voxels ({}), {} in MAP only, {} in OTHER only", change.pairs.size(),
           change.matching == libgtd::VoxelMatching::lattice
               ? std::string("same lattice")
               : fmt::format("nearest within {:g} voxels", options.change.match_distance_voxels),
           change.only_map.size(), change.only_other.size());
  run.info(
      "{} voxels evaluated in both: kappa {}, accuracy {}; graspable in both {}, in MAP only {}, "
      "in OTHER only {}",
      evaluated.graspable.size(),
      evaluated.kappa ? fmt::format("{:.3f} (standard error {:.3f})", evaluated.kappa->value,
                                    evaluated.kappa->standard_error)
                      : "not defined",
      percent_text(evaluated.graspable.accuracy().value()), evaluated.graspable.true_positives,
      evaluated.lost(), evaluated.gained());
  if (evaluated.difference.count > 0)
    run.info("score, OTHER - MAP: mean {:+.3f}, mean absolute {:.3f}, rms {:.3f}",
             evaluated.difference.mean, evaluated.difference.mean_absolute,
             evaluated.difference.rms);
}

void note_results(const Analysis& analysis, const Comparison* comparison, Run& run) {
  const libgtd::MapAnalysis& ground = analysis.ground;
  run.add_results({{"voxels", ground.voxels},
                   {"evaluated_voxels", ground.ground.voxels},
                   {"surface_area_m2", ground.ground.area_m2},
                   {"graspable_surface_area_m2", ground.ground.graspable_area_m2},
                   {"column_coverage", ground.column_coverage},
                   {"regions", analysis.regions.regions.size()},
                   {"groups", analysis.reach.groups},
                   {"reachable_regions", analysis.reach.reachable_regions},
                   {"joining_stride_m", analysis.reach.joining_stride_m}});
  if (comparison == nullptr) return;
  const libgtd::MapChange& change = comparison->change;
  run.add_results({{"matching", to_text(change.matching)},
                   {"voxels_in_common", change.pairs.size()},
                   {"evaluated_in_both", change.evaluated.graspable.size()}});
  if (change.evaluated.kappa) run.add_results({{"kappa", change.evaluated.kappa->value}});
  run.manifest().transforms.emplace_back("map_terrain_from_other_terrain",
                                         comparison->map_terrain_from_other_terrain);
}

const std::vector<std::string> output_names = {
    "summary.json",  "histogram.csv",    "histogram.svg",   "histogram.png", "by_height.csv",
    "by_height.svg", "by_height.png",    "by_slope.csv",    "by_slope.svg",  "by_slope.png",
    "regions.csv",   "region_links.csv", "regions.pcd",     "regions.png",   "change.csv",
    "change.pcd",    "change.png",       "change_score.png"};

// Name with the folder, because pipelines use the same file name for all maps.
std::string short_name(const std::string& file) {
  const fs::path path = fs::path(file).lexically_normal();
  return (path.parent_path().filename() / path.filename()).string();
}

void write_chart(const fs::path& folder, const std::string& name, const libmap::Chart& chart) {
  libmap::write_text(folder / (name + ".svg"), libmap::chart_svg(chart));
  libmap::write_text(folder / (name + ".png"), libmap::to_png(libmap::draw_chart(chart)));
}

void write_images(const fs::path& folder, const AnalyzeOptions& options, const ReadMap& map,
                  const Analysis& analysis, const Comparison* comparison) {
  const libmap::VirtualDisplay display;
  const std::string name = short_name(options.map);
  const libgtd::MapAnalysis& ground = analysis.ground;
  write_chart(folder, "histogram", histogram_chart(ground, "Scores of " + name));
  write_chart(folder, "by_height",
              ground_chart(ground.by_height, "height [m]", "Graspable ground by height, " + name));
  write_chart(folder, "by_slope",
              ground_chart(ground.by_slope, "slope [deg]", "Graspable ground by slope, " + name));
  MapImage map_image{map.voxels, analysis.surface, ""};
  const auto write = [&](const char* file, const libmap::ColorImage& drawn) {
    libmap::write_text(folder / file, libmap::to_png(drawn));
  };
  map_image.title = fmt::format("{}: {} regions, stride {:g} m", name,
                                analysis.regions.regions.size(), options.reach.stride_m);
  write("regions.png", draw_regions(map_image, analysis.regions, analysis.reach));
  if (comparison == nullptr) return;
  const libgtd::MapChange& change = comparison->change;
  map_image.title = fmt::format(
      "MAP {}, OTHER {}{}", name, short_name(options.other),
      change.evaluated.kappa ? fmt::format(": kappa {:.2f}", change.evaluated.kappa->value) : "");
  write("change.png", draw_change(map_image, change, comparison->other.voxels,
                                  comparison->map_terrain_from_other_terrain));
  write("change_score.png", draw_score_change(map_image, change, comparison->other.voxels));
}

void write_tables(const fs::path& folder, const AnalyzeOptions& options, const ReadMap& map,
                  const Analysis& analysis, const Comparison* comparison) {
  const auto table = [&](const char* name, const libmap::Table& rows) {
    libmap::write_text(folder / name, libmap::to_csv(rows));
  };
  libmap::write_text(
      folder / "summary.json",
      libgtd::analysis_json(analysis.ground, analysis.surface, analysis.regions, options.reach,
                            analysis.reach, comparison ? &comparison->change : nullptr));
  table("histogram.csv", libgtd::histogram_table(analysis.ground));
  table("by_height.csv", libgtd::ground_table(analysis.ground.by_height, "m"));
  table("by_slope.csv", libgtd::ground_table(analysis.ground.by_slope, "deg"));
  table("regions.csv", libgtd::regions_table(map.voxels, analysis.regions, analysis.reach));
  table("region_links.csv", libgtd::region_links_table(map.voxels, analysis.reach));
  libmap::write_cloud(folder / "regions.pcd",
                      libgtd::regions_cloud(map.cloud, map.voxels, analysis.surface,
                                            analysis.regions, analysis.reach));
  if (comparison == nullptr) return;
  table("change.csv", libgtd::change_table(comparison->change));
  libmap::write_cloud(
      folder / "change.pcd",
      libgtd::to_cloud(comparison->change, map.voxels, comparison->other.voxels,
                       comparison->map_terrain_from_other_terrain, options.change.border));
}

void analyze(AnalyzeOptions& options, Run& run) {
  if (options.maps.size() > 1 || !options.table.expected.empty()) {
    if (!options.other.empty())
      throw UsageError(
          "--against requires exactly one MAP and cannot be used with --expected; use --pairs to "
          "compare several maps");
    reject_changed(options, bind_one, "requires a single MAP and no --expected");
    options.table.points_frame = options.points_frame;
    options.table.images = options.images;
    return tabulate_maps(options.maps, options.folder, options.table, run);
  }
  reject_changed<MapTableOptions>(options.table, graspmap_tools::bind,
                                  "requires several MAPs or --expected");
  options.map = options.maps.front();
  if (options.other.empty() && options.transform != "auto")
    throw libmap::Error("can only be used with --against OTHER",
                        {.field = "--transform", .value = options.transform});
  run.claim_output_tree(options.folder, output_names, {options.map, options.other});
  options.regions.border = options.change.border = options.analysis.border;
  options.change.height_bin_m = options.analysis.height_bin_m;
  options.change.slope_bin_deg = options.analysis.slope_bin_deg;
  const ReadMap map = run.timed("read", [&] { return read_map(options.map, run); });
  const Analysis analysis = analyze_map(options, map, run);
  std::optional<Comparison> comparison;
  if (!options.other.empty()) comparison = compare(options, map, analysis, run);
  say_ground(analysis, options, run);
  if (comparison) say_change(comparison->change, options, run);
  const Comparison* against = comparison ? &*comparison : nullptr;
  if (map.manifest) {
    run.manifest().frame = map.manifest->frame;
    run.manifest().transforms = map.manifest->transforms;
  }
  note_results(analysis, against, run);
  run.write_output_tree(options.folder, output_names, [&](const fs::path& folder) {
    if (folder.empty()) return;
    write_tables(folder, options, map, analysis, against);
    if (options.images) write_images(folder, options, map, analysis, against);
  });
}

}  // namespace

int main(int argc, char** argv) {
  AnalyzeOptions options;
  Command command("analyze");
  command.inputs("MAP", options.maps, "graspability map; several: a table with one row per map");
  command.option("--against", "OTHER", options.other, "map of the same ground, compared with MAP");
  command.option("--expected", "EXPECTED.csv", options.table.expected,
                 "table of regions with their expected graspability, compared with each map, e.g. "
                 "data/expected/primitive_shapes.csv");
  command.output(options.folder,
                 "output folder; for one map: summary.json, histogram, by_height, by_slope, "
                 "regions, region_links and, with --against, change; for several: maps.csv, "
                 "histograms.csv, pairs.csv (--pairs) and regions.csv (--expected)");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { analyze(options, run); });
}
