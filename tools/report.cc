// graspmap report: writes one HTML report of a whole run.
#include <system_error>

#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/grasp/trial_scene.h"
#include "libgtd/score/graspability_map.h"
#include "libgtd/score/map_downsampling.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/parallel.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/report/html.h"
#include "libmap/report/report_page.h"
#include "libmap/report/report_reader.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct ReportCommandOptions {
  std::string folder;
  std::string output;
  std::string outline;
  bool no_views = false;
  std::string three = "/usr/share/javascript/three";
  double max_size_mb = 15.0;
  std::uint64_t max_cells = 80'000;
  std::string title;
};

void bind(libmap::ParameterTable& table, ReportCommandOptions& options) {
  table.add("title", options.title, "heading of the report; empty: the name of the folder");
  table.add("max_size_mb", options.max_size_mb, libmap::Range{1.0, 1000.0},
            "maximum size of the file, MB; images and maps are reduced until they fit");
  table.add("max_cells", options.max_cells, libmap::Range{100.0, 10'000'000.0},
            "maximum number of cells in a map's 3-D view; in larger maps, cubes of voxels are "
            "merged into one cell");
}

// Bytes per cell in the page: at most eleven, in base64.
constexpr double bytes_per_cell = 44.0 / 3.0;
// Maximum shares of the page for maps and for scenes.
constexpr double maps_fraction = 0.4;
constexpr double scenes_fraction = 0.4;

std::size_t cells_per_map(const ReportCommandOptions& options, const libmap::PlannedSection& plan) {
  const std::size_t maps = plan.count(libmap::ItemKind::map);
  const double affordable = maps_fraction * options.max_size_mb * 1e6 / bytes_per_cell /
                            static_cast<double>(std::max<std::size_t>(maps, 1));
  return static_cast<std::size_t>(std::min(affordable, static_cast<double>(options.max_cells)));
}

std::string read_asset(const std::string& name, Run& run) {
  const fs::path path = libmap::data_folder() / "report" / name;
  run.add_input(path);
  return libmap::read_whole_file(path);
}

libmap::PageAssets read_assets(const ReportCommandOptions& options, bool with_views, Run& run) {
  libmap::PageAssets assets;
  assets.version = run.manifest().version;
  assets.style = read_asset("report.css", run);
  for (const char* name :
       {"map_cells.js", "map_marks.js", "scene_mesh.js", "map_view.js", "report.js"})
    assets.scripts.push_back(read_asset(name, run));
  if (!with_views) return assets;
  for (const char* name : {"three.min.js", "examples/js/controls/OrbitControls.js"}) {
    const fs::path path = fs::path(options.three) / name;
    std::error_code code;
    if (!fs::is_regular_file(path, code))
      throw libmap::Error(
          "no such file: install the Debian package libjs-three, or omit the 3-D views by --no-3d",
          {.file = path.string()});
    run.add_input(path);
    assets.libraries.push_back(libmap::read_whole_file(path));
  }
  assets.library_notice = read_asset("three_license.txt", run);
  return assets;
}

struct DownsampledMap {
  libmap::PointCloud points;  // in the terrain frame
  std::uint64_t voxels = 0;   // number of voxels of the whole map
  libmap::MapViewOptions options;
};

void set_parameters(const libmap::Manifest& manifest, libmap::MapViewOptions& options) {
  options.zero_plane_m = libmap::number_of(manifest.find_parameter("zero_plane_m"));
  options.load_n = libmap::number_of(manifest.find_parameter("load_n"));
}

// Initial width of cubes, exact for a flat map with this number of voxels.
int first_width(std::uint64_t voxels, std::size_t max_cells) {
  return std::max(
      1, static_cast<int>(std::sqrt(static_cast<double>(voxels) / static_cast<double>(max_cells))));
}

DownsampledMap read_cloud_map(const fs::path& path, std::size_t max_cells) {
  const auto manifest = libmap::read_manifest_of(path);
  const libmap::PointCloud whole =
      libmap::transform_cloud(libmap::read_cloud(path).cloud, terrain_from_map(manifest));
  DownsampledMap map;
  map.voxels = whole.size();
  const auto lattice = manifest ? libgtd::map_info(*manifest).lattice : std::nullopt;
  if (lattice)
    map.options.lattice = {lattice->voxel_size_m, lattice->origin_m};
  else if (!whole.empty())
    map.options.lattice = libmap::lattice_of(whole);
  int& width = map.options.voxels_per_cell;
  width = first_width(map.voxels, max_cells);
  do {
    map.points = width == 1 ? whole : libgtd::voxel_downsample_map(whole, width);
  } while (map.points.size() > max_cells && ++width > 0);
  if (manifest) set_parameters(*manifest, map.options);
  return map;
}

// Points of the tiles, downsampled by cubes of this width.
libmap::PointCloud thin_tiles(const MapTiles& tiles, int width) {
  std::vector<libmap::PointCloud> parts(tiles.index().tiles.size());
  libmap::parallel_each(parts.size(), [&](std::size_t n) {
    parts[n] = libgtd::voxel_downsample_map(tiles.load(n), width);
  });
  // Cubes shared by two tiles have one point from each tile.
  return libgtd::voxel_downsample_map(libgtd::merge_map_clouds(parts), width);
}

// Downsamples a tile store to the same cells tile by tile, because it may exceed the memory.
DownsampledMap read_store_map(const fs::path& path, std::size_t max_cells) {
  const MapTiles tiles(path.string());
  DownsampledMap map;
  const auto& index = tiles.index();
  map.voxels = index.voxels();
  const std::optional<libmap::Manifest> manifest = index.manifest;
  int& width = map.options.voxels_per_cell;
  width = first_width(map.voxels, max_cells);
  do {
    map.points = thin_tiles(tiles, width);
  } while (map.points.size() > max_cells && ++width > 0);
  map.points = libmap::transform_cloud(map.points, terrain_from_map(manifest));
  map.options.lattice = {index.lattice.voxel_size_m, index.lattice.origin_m};
  set_parameters(index.manifest, map.options);
  return map;
}

// Loads a map or tile store, downsampled to at most `max_cells` cells, in its terrain frame. With
// `lookup`, a CSV file of `graspmap lookup`, the view has one marker per row.
libmap::MapView load_map_view(const fs::path& path, const std::optional<fs::path>& lookup,
                              std::size_t max_cells, Run& run) {
  const bool store = is_tile_store(path.string());
  const DownsampledMap map =
      store ? read_store_map(path, max_cells) : read_cloud_map(path, max_cells);
  libmap::MapView view = libmap::make_map_view(map.points, map.options);
  view.voxels = map.voxels;
  if (!lookup) return view;
  const auto manifest = libmap::read_manifest_of(path);
  const PointFrame frame =
      frame_of_points(lookup->string(), PointFrame::automatic, path.string(), run);
  const libmap::Pose terrain_from_points =
      terrain_from_map(manifest) * map_from_points(path.string(), frame, run);
  for (const Eigen::Vector3d& point : positions_of(libmap::read_csv(*lookup)))
    view.markers.push_back({.label = {}, .point_in_terrain = terrain_from_points * point});
  return view;
}

// Loads a scene of the virtual field test and subtracts its size from `bytes_left`. Throws Error if
// it does not fit.
libmap::ReportScene load_report_scene(const fs::path& path, double& bytes_left) {
  libmap::ReportScene scene;
  scene.mesh = libmap::read_mesh(path).mesh;
  const auto bytes = static_cast<double>(libmap::scene_bytes(scene.mesh));
  if (bytes > bytes_left)
    throw libmap::Error("does not fit into the report; increase --max-size-mb");
  bytes_left -= bytes;
  for (const libgtd::ScenePartStyle& part : libgtd::shown_parts(scene.mesh))
    scene.legend.emplace_back(part.color, part.text);
  return scene;
}

void make_report(ReportCommandOptions& options, Run& run) {
  if (!options.outline.empty())
    throw UsageError(
        "--outline was removed: a report shows the content of its folder in the order of the "
        "names");
  libmap::PlannedSection plan = libmap::plan_report(options.folder);
  if (!options.title.empty()) plan.heading = options.title;
  if (options.output.empty()) options.output = (fs::path(options.folder) / "report.html").string();
  const std::string extension = fs::path(options.output).extension().string();
  if (extension != ".html" && extension != ".htm")
    throw libmap::Error("reports are written as .html", {.file = options.output});
  run.claim_output(options.output);
  const std::size_t max_cells = cells_per_map(options, plan);
  const bool has_views = (max_cells > 0 && plan.count(libmap::ItemKind::map) > 0) ||
                         plan.count(libmap::ItemKind::scene) > 0;
  const bool with_views = !options.no_views && has_views;
  const libmap::PageAssets assets = read_assets(options, with_views, run);
  double bytes_left = scenes_fraction * options.max_size_mb * 1e6;
  const libmap::ReportReadResult read = run.timed("read", [&] {
    return libmap::read_report_content(
        plan, {.folder = options.folder, .excluded = options.output},
        [&](const fs::path& map, const auto& lookup) {
          return load_map_view(map, lookup, max_cells, run);
        },
        [&](const fs::path& scene) { return load_report_scene(scene, bytes_left); });
  });
  const libmap::FittedPage page = run.timed("write page", [&] {
    return libmap::fit_report_page(read.content, assets,
                                   static_cast<std::size_t>(options.max_size_mb * 1e6));
  });
  for (const fs::path& file : read.files)
    run.add_input(is_tile_store(file.string()) ? store_index_path(file.string()) : file);
  run.add_results({{"files", read.files.size()},
                   {"bytes", page.html.size()},
                   {"resized_images", page.changed_images}});
  run.info("{} files, {:.1f} MB{}", read.files.size(), static_cast<double>(page.html.size()) / 1e6,
           page.changed_images == 0 ? "" : fmt::format(", {} images reduced", page.changed_images));
  run.write_text(options.output, page.html);
}

}  // namespace

int main(int argc, char** argv) {
  ReportCommandOptions options;
  Command command("report");
  command.input("DIR", options.folder, "folder with the outputs of a run");
  command.output(options.output, "report (.html); default: report.html in DIR", false);
  command.option("--outline", "OUTLINE", options.outline,
                 "removed option; a report shows the content of DIR in the order of the names");
  command.flag("--no-3d", options.no_views, "omit the 3-D views");
  command.option("--three", "FOLDER", options.three,
                 "folder that contains three.js, for the 3-D views");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { make_report(options, run); });
}
