// graspmap score: computes the graspability map of a terrain, tile by tile.
#include "libgtd/detect.h"
#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/store_plan.h"
#include "libgtd/tile_detection.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/parallel.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/cloud_tiles.h"
#include "libmap/raster/dem_reader.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"
#include "tools/support/option_values.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libgtd::StoredTile;
using libgtd::TerrainFile;
using libgtd::TileNumber;

// Maximum skewness of heights for a warning. It is +0.5 to +3 for rocks and holds on ground, -0.5
// to -3 if they are upside down, and about 0 for rolling ground.
constexpr double upside_down_skewness = -1.0;

std::string_view name_of(libgtd::UpSource source) {
  if (source == libgtd::UpSource::frame_z) return "frame's z axis";
  if (source == libgtd::UpSource::camera_origin) return "camera's origin";
  return to_text(source);
}

// Reports the source of the up direction, unless it was given. Warns if the normals do not agree,
// and if the relief contradicts the frame's z axis (for example a cloud in a camera's frame, whose
// z axis points into the ground) or normals opposite to it.
void report_plane(const libgtd::RegressionPlane& plane, const std::string& terrain, Run& run) {
  if (plane.up_source == libgtd::UpSource::direction) return;
  const bool by_normals = plane.up_source == libgtd::UpSource::normals;
  run.info("up direction from the {}{}", name_of(plane.up_source),
           by_normals ? fmt::format(": {:.1f} % agree", 100.0 * *plane.normals_up) : "");
  if (!by_normals && plane.up_source != libgtd::UpSource::viewpoint && plane.normals_up)
    run.warn("{}: {}; the up direction is from the {} (--up X,Y,Z sets it)", terrain,
             libmap::disagreement_text(std::max(*plane.normals_up, 1.0 - *plane.normals_up),
                                       plane.opposing_normals),
             name_of(plane.up_source));
  // A viewpoint, or normals that agree with z, determine the outside reliably.
  const bool doubtful = by_normals ? plane.terrain_from_input.linear()(2, 2) < 0.0
                                   : plane.up_source == libgtd::UpSource::frame_z;
  if (doubtful && plane.relief_skewness < upside_down_skewness)
    run.warn(
        "{}: most relief is below the plane; if the cloud is upside down, set --up (--up=0,0,-1 "
        "for a cloud in a camera's frame)",
        terrain);
}

// Returns true for a DEM or a folder of DEM tiles, whose z is up.
bool is_dem(const std::string& terrain) {
  return fs::exists(terrain) && libmap::is_dem_path(libmap::cloud_tiles(terrain).front());
}

// Throws Error for a mesh, whose vertices do not sample its surface.
void refuse_mesh(const std::string& terrain) {
  if (!fs::exists(terrain)) return;
  fs::path first = terrain;
  if (fs::is_directory(terrain)) first = libmap::cloud_tiles(terrain).front();
  const std::string format = libmap::format_of(first);
  if (format == ".obj" || format == ".stl" || format == ".off" || format == ".glb" ||
      (format == ".ply" && libmap::read_cloud_info(first).faces > 0))
    throw libmap::Error(
        "is a mesh; sample its surface first with `graspmap resample MESH --radius M -o CLOUD.pcd`",
        {.file = first.string()});
}

// Throws Error if there are no points; warns about dropped points.
void require_points(std::size_t points, std::size_t dropped, const std::string& terrain, Run& run) {
  if (points == 0 && dropped == 0) throw libmap::no_elements("points of the cloud", terrain);
  if (points == 0)
    throw libmap::Error(fmt::format("none of {} has a position", dropped),
                        {.file = terrain, .field = "points of the cloud"});
  if (dropped > 0)
    run.warn("{}: {} points without a position{} were dropped", terrain, dropped,
             is_dem(terrain) ? " (heights such as -9999, not declared as nodata)" : "");
}

std::int64_t modified_ns(const fs::path& path) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             fs::last_write_time(path).time_since_epoch())
      .count();
}

// Surveys the files. Data of an earlier run is used for files with the same name, size and time.
std::vector<TerrainFile> terrain_files(const std::vector<fs::path>& paths,
                                       const std::vector<TerrainFile>& known,
                                       const std::optional<libmap::Georeference>& georeference) {
  std::vector<TerrainFile> files(paths.size());
  libmap::parallel_each(paths.size(), [&](std::size_t n) {
    TerrainFile& file = files[n];
    file.input.path = paths[n].string();
    file.input.bytes = fs::file_size(paths[n]);
    file.modified_ns = modified_ns(paths[n]);
    const auto same = std::find_if(known.begin(), known.end(), [&](const TerrainFile& one) {
      return one.input.path == file.input.path && one.input.bytes == file.input.bytes &&
             one.modified_ns == file.modified_ns;
    });
    if (same != known.end()) {
      file = *same;
      return;
    }
    file.input.sha256 = libmap::sha256_of_file(paths[n]);
    const libmap::TileInfo info = libmap::read_tile_info(paths[n], georeference);
    file.points = info.points;
    file.dropped_points = info.dropped_points;
    file.box = info.box;
  });
  return files;
}

struct ScoreOptions {
  std::string terrain;
  std::string output;
  std::string tile = "1/1";
  libmap::TileShare share;  // of `tile`
  std::string up = "auto";
  bool append = false;
  std::string max_points_in_memory = "1000000";
  libgtd::MapFrame frame = libgtd::MapFrame::terrain;
  libgtd::DetectionOptions detection;
};

std::size_t parse_max_points(const ScoreOptions& options) {
  const auto count = libmap::parse_integer(options.max_points_in_memory);
  if (!count || *count < 1)
    throw libmap::Error("not a number of points", {.field = "--max-points-in-memory",
                                                   .value = options.max_points_in_memory,
                                                   .bound = ">= 1"});
  return static_cast<std::size_t>(*count);
}

class StoreScoring {
 public:
  StoreScoring(const ScoreOptions& options, fs::path gripper_file, Run& run)
      : options_(options),
        gripper_file_(std::move(gripper_file)),
        run_(run),
        store_(options.output),
        stream_(libmap::cloud_tiles(options.terrain)),
        tiling_(options.detection) {
    if (fs::is_directory(options.output) && fs::is_directory(options.terrain) &&
        fs::equivalent(options.output, options.terrain))
      throw libmap::Error("is the input; choose another output name", {.file = options.output});
  }

  void score() {
    if (run_.options().dry_run) return;
    libmap::TileJournal journal =
        run_.timed("plan", [&] { return store_.begin(options_.share, [&] { check_plan(); }); });
    const std::vector<TileNumber> wanted = run_.timed("check", [&] {
      return store_.missing(plan_, libgtd::tiles_of(frame_, tiling_.tile_voxels, options_.share));
    });
    if (!wanted.empty()) {
      libmap::PointTileStore points(
          store_.folder() / "progress",
          {.tile_m = point_tile_m(),
           .has_normals = stream_.has_normals() && !frame_.drops_normals()});
      run_.timed("sort points", [&] { read_points(points, wanted); });
      run_.timed("tiles", [&] {
        in_file(options_.terrain, [&] {
          libgtd::detect_streamed(frame_, points, wanted, options_.detection,
                                  [&](std::vector<libgtd::StreamedTile> tiles) {
                                    libgtd::add_tiles(write(tiles), plan_.key, journal);
                                  },
                                  run_.progress(), {.max_points = parse_max_points(options_)});
        });
      });
    }
    finish(wanted.size());
  }

 private:
  // Resumes the earlier plan if its parameters and inputs are the same, else writes a new one. The
  // caller must have locked the store.
  void check_plan() {
    const auto earlier = run_.options().force ? std::nullopt : store_.plan();
    if (!earlier && !run_.options().force) require_no_index(store_);
    plan_.terrain =
        terrain_files(stream_.tiles(), earlier ? earlier->terrain : std::vector<TerrainFile>{},
                      stream_.georeference());
    plan_.index.manifest = make_manifest();
    plan_.key = libmap::key_of(plan_.index.manifest);
    if (earlier && earlier->key == plan_.key) {
      // Equal files may now have another folder or time.
      std::vector<TerrainFile> terrain = std::move(plan_.terrain);
      plan_ = *earlier;
      plan_.terrain = std::move(terrain);
      frame_ = libgtd::frame_of(plan_, options_.detection, store_.plan_path());
    } else {
      if (earlier) {
        libgtd::require_appendable(*earlier, plan_, options_.detection, options_.append,
                                   options_.output);
        libgtd::frame_of(*earlier, options_.detection, store_.plan_path());
      }
      store_.require_idle();
      make_frame();
      if (earlier)
        plan_.kept =
            libgtd::unaffected_tiles(store_.done(*earlier), *earlier, plan_, frame_, tiling_);
      else
        store_.clear();
      store_.set_plan(plan_);
    }
    remove_stale_index();
  }

  // Manifest with parameters and inputs, as for a map in one file.
  libmap::Manifest make_manifest() {
    libmap::Manifest& manifest = run_.manifest();
    copy_transforms(options_.terrain, run_);
    for (const TerrainFile& file : plan_.terrain) manifest.inputs.push_back(file.input);
    for (const auto& input : libgtd::gripper_files(gripper_file_)) run_.add_input(input);
    manifest.frame = options_.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
    libmap::Manifest copy = manifest;
    copy.timings_s.clear();
    copy.threads = 0;
    return copy;
  }

  void make_frame() {
    std::size_t points = 0, dropped = 0;
    for (const TerrainFile& file : plan_.terrain) {
      points += file.points;
      dropped += file.dropped_points;
    }
    require_points(points, dropped, options_.terrain, run_);
    in_file(options_.terrain, [&] {
      frame_ = libgtd::frame_terrain(stream_, options_.detection);
      libgtd::tiles_of(frame_, tiling_.tile_voxels);  // throws for too many tiles
    });
    libgtd::set_frame(frame_, tiling_, plan_);
    if (frame_.plane) report_plane(*frame_.plane, options_.terrain, run_);
  }

  void remove_stale_index() const {
    if (!fs::exists(store_.index_path())) return;
    try {
      if (libgtd::read_tile_store(store_.folder()).key == plan_.key) return;
    } catch (const libmap::Error&) {
      // A broken index is written again.
    }
    fs::remove(store_.index_path());
  }

  // Side of the tiles of points: small compared to the tiles in work, but not to their halo.
  double point_tile_m() const {
    return std::max(1.0 + tiling_.halo_voxels,
                    std::min<double>(tiling_.tile_voxels, 4.0 * tiling_.halo_voxels)) *
           options_.detection.scenario.voxel_size_m;
  }

  // Reads the points that the wanted tiles depend on.
  void read_points(libmap::PointTileStore& points, const std::vector<TileNumber>& wanted) const {
    const libgtd::PointsRectangle rectangle = libgtd::points_for(wanted, frame_, tiling_);
    std::vector<fs::path> files;
    for (const TerrainFile& file : plan_.terrain)
      if (libgtd::may_intersect(file, rectangle, frame_)) files.emplace_back(file.input.path);
    const bool are_all = wanted.size() == libgtd::tiles_of(frame_, tiling_.tile_voxels).size();
    const auto all = libmap::PointStream::Need::positions_and_normals;
    libmap::TileStream(files).for_each_block(all, [&](const libmap::PointCloud& block) {
      const libmap::PointCloud terrain = libgtd::to_terrain(block, frame_);
      libgtd::require_in_frame(terrain, frame_, store_.plan_path());
      if (are_all) return points.add(terrain);
      std::vector<std::size_t> inside;
      for (std::size_t n = 0; n < terrain.size(); ++n) {
        const auto position = terrain.positions[n].head<2>().array();
        if ((position >= rectangle.low.array()).all() && (position <= rectangle.high.array()).all())
          inside.push_back(n);
      }
      points.add(libmap::select_points(terrain, inside));
    });
    points.finish();
  }

  std::vector<StoredTile> write(std::vector<libgtd::StreamedTile>& tiles) const {
    std::vector<StoredTile> stored(tiles.size());
    libmap::parallel_each(tiles.size(), [&](std::size_t n) {
      stored[n] = libgtd::stored_tile(tiles[n]);
      libgtd::GraspabilityMap map;
      map.lattice = frame_.lattice;
      if (frame_.plane) map.terrain_from_input = frame_.plane->terrain_from_input;
      map.zero_plane_m = options_.detection.scenario.lowest_target_m();
      map.content = libgtd::content_of(options_.detection.scenario);
      map.voxels = std::move(tiles[n].voxels);
      if (!map.voxels.empty())
        write_tile(store_.folder(), libgtd::to_cloud(map, options_.frame), stored[n]);
    });
    return stored;
  }

  // The last share writes the index.
  void finish(std::size_t scored) {
    const libmap::FileLock lock = store_.lock();
    const libgtd::MapTileStore::Completion completion = store_.complete(plan_);
    if (!completion.index) {
      run_.info("{} tiles scored; {} of {} are complete", scored, completion.done,
                completion.tiles);
      return;
    }
    const libgtd::TileStoreIndex& index = *completion.index;
    store_.write_index(index, run_.manifest());
    run_.info("{} of {} tiles scored; all are complete: {} voxels, {} graspable", scored,
              completion.tiles, index.voxels(), index.graspable_voxels());
    if (index.voxels() == 0)
      run_.warn("nothing was scored, because the terrain is smaller than the gripper mask");
  }

  const ScoreOptions& options_;
  fs::path gripper_file_;
  Run& run_;
  libgtd::MapTileStore store_;
  libmap::TileStream stream_;
  libgtd::StoreTiling tiling_;
  libgtd::TilePlan plan_;
  libgtd::TerrainFrame frame_;
};

// Scores the missing tiles of the share in the store, which is created if it is missing.
void score_into_store(const ScoreOptions& options, const fs::path& gripper_file, Run& run) {
  libgtd::require_streamable(options.detection);
  if (run.options().force && options.share.count > 1)
    throw libmap::Error("deletes the tiles of all shares and cannot be combined with --tile",
                        {.field = "--force"});
  parse_max_points(options);
  StoreScoring(options, gripper_file, run).score();
}

void bind(libmap::ParameterTable& table, ScoreOptions& options) {
  bind(table, options.detection);
  table.add("up", options.up,
            "direction out of the ground: X,Y,Z in the cloud's frame; auto: from the cloud's "
            "viewpoint, else its normals, else its z axis");
  table.add("frame", options.frame, libgtd::map_frame_names(),
            "frame of the map's points; terrain: as set by --plane; input: frame of the cloud");
}

void add_results(const libgtd::DetectionResult& result, const ScoreOptions& options, Run& run) {
  libmap::Manifest& manifest = run.manifest();
  manifest.frame = options.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
  manifest.transforms.emplace_back("terrain_from_input", result.map.terrain_from_input);
  run.add_results(libmap::described(result));
}

void say_result(const libgtd::DetectionResult& result, const ScoreOptions& options, Run& run) {
  if (result.plane) report_plane(*result.plane, options.terrain, run);
  run.add_timings(result.timings_s);
  run.info("{} points, {} occupied voxels, {} scored in {} tiles, {} graspable", result.points,
           result.occupied_voxels, result.map.voxels.size(), result.tiles, result.graspable_voxels);
  if (10 * result.isolated_voxels > result.occupied_voxels && result.occupied_voxels >= 10)
    run.warn(
        "{}: {:.1f} % of the voxels have no neighbor, because the points are too sparse for voxels "
        "of {:g} m; set --interpolation or --voxel-size, or resample a mesh",
        options.terrain,
        100.0 * static_cast<double>(result.isolated_voxels) /
            static_cast<double>(result.occupied_voxels),
        options.detection.scenario.voxel_size_m);
  if (result.map.content.normals)
    run.info("mask tilted to the surface's normal within {:g} m; {} voxels without a normal",
             *result.normal_radius_m, result.unoriented_voxels);
  if (result.map.content.obstacles) run.info("{} voxels are obstacles", result.obstacle_voxels);
  if (result.map.voxels.empty())
    run.warn("nothing was scored, because the terrain is smaller than the gripper mask");
}

// Reads a cloud file, or the tiles of a folder one by one.
libmap::TilesReadResult read_terrain(const std::string& path) {
  if (std::filesystem::is_directory(path)) return libmap::read_tiles(libmap::cloud_tiles(path));
  libmap::CloudReadResult read = libmap::read_cloud(path);
  return {std::move(read.cloud), read.dropped_points};
}

void score(ScoreOptions& options, Run& run) {
  libgtd::Scenario& scenario = options.detection.scenario;
  options.share = libmap::parse_share(options.tile);
  refuse_mesh(options.terrain);
  if (options.up != "auto")
    options.detection.up = parse_vector(options.up, "--up");
  else if (is_dem(options.terrain) && options.detection.plane == libgtd::PlaneSource::fit)
    options.detection.up = Eigen::Vector3d::UnitZ(), options.detection.max_tilt_deg = 75.0;
  scenario.check();
  scenario.set_defaults();
  libmap::ParameterTable in_force;
  bind(in_force, options);
  run.manifest().add_parameters(in_force);
  if (options.detection.up && options.detection.plane == libgtd::PlaneSource::none)
    throw libmap::Error("requires a fitted plane; with --plane none, up is z",
                        {.field = "--up", .value = options.up});
  const auto gripper_file = libmap::find_data_file("grippers", scenario.gripper);
  // Throws for a voxel size that does not fit the gripper, before the work.
  const libgtd::Gripper gripper = libgtd::gripper_of(options.detection);
  if (scenario.method == libgtd::Method::calibrated)
    in_file(gripper_file.string(), [&] { libgtd::require_fingers(gripper); });
  libgtd::make_gripper_mask(gripper, mask_options(scenario));
  if (libgtd::is_tile_store_name(options.output))
    return score_into_store(options, gripper_file, run);
  reject_given({{"--tile", options.share.count > 1},
                {"--append", options.append},
                {"--max-points-in-memory",
                 options.max_points_in_memory != ScoreOptions{}.max_points_in_memory}},
               "requires a tile store, MAP.tiles");
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.terrain});
  const libmap::TilesReadResult read =
      run.timed("read", [&] { return read_terrain(options.terrain); });
  require_points(read.cloud.size(), read.dropped_points, options.terrain, run);
  if (scenario.orientation == libgtd::Orientation::surface && !read.cloud.has_normals())
    run.warn(
        "{}: has no normals; the terrain's z is assumed to point outwards, and the outer sides of "
        "walls are uncertain",
        options.terrain);
  const libgtd::DetectionResult result = in_file(options.terrain, [&] {
    return libgtd::detect(read.cloud, options.detection, run.progress());
  });
  run.manifest().parameters.emplace_back("tile", options.tile);
  for (const auto& tile : libmap::cloud_tiles(options.terrain)) run.add_input(tile);
  for (const auto& input : libgtd::gripper_files(gripper_file)) run.add_input(input);
  add_results(result, options, run);
  copy_transforms(options.terrain, run);
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
                "terrain: cloud (.pcd, .ply, .csv), DEM (.tif), or a folder of tiles of either");
  command.output(options.output,
                 "graspability map (.pcd .ply .vtp .csv), or tile store: folder of tiles (.tiles)");
  command.option(
      "--tile", "K/N", options.tile,
      "score only share K of N (1/N) of the tiles; all N shares complete the tile store");
  command.option("--max-points-in-memory", "N", options.max_points_in_memory,
                 "for a tile store: maximum number of cloud points in memory (about 250 bytes "
                 "each); the map does not depend on it");
  command.renamed_flag("--points-at-once", "--max-points-in-memory");
  command.flag("--append", options.append,
               "extend a tile store: score tiles affected by new clouds in the folder TERRAIN");
  bind(command.parameters(), options);
  command.config_resolver(
      [](const std::string& name) { return libmap::find_data_file("scenarios", name); });
  return command.run(argc, argv, [&](Run& run) { score(options, run); });
}
