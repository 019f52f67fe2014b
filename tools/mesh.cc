// graspmap mesh: reconstructs a clean surface from a cloud.
#include <iostream>
#include <nlohmann/json.hpp>

#include "libmap/core/memory_budget.h"
#include "libmap/fusion/normals.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/cloud_tiles.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_report.h"
#include "libmap/surface/surface_reconstruction.h"
#include "libmap/surface/surface_tiles.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/results.h"
#include "tools/support/tile_folder.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Source of the normals for the reconstruction.
enum class NormalSource { automatic, cloud, estimate };

struct MeshOptions {
  std::string cloud;
  std::string output;
  NormalSource normals = NormalSource::automatic;
  std::string tile = whole_share;
  bool report = false;
  bool json = false;
  libmap::NormalEstimationOptions estimation;
  libmap::SurfaceTileOptions surface;
};

void bind(libmap::ParameterTable& table, MeshOptions& options) {
  table.add("normals", options.normals,
            {{"auto", NormalSource::automatic},
             {"cloud", NormalSource::cloud},
             {"estimate", NormalSource::estimate}},
            "source of normals; cloud: normals of the cloud; estimate: estimated normals; auto: "
            "cloud if it has normals, reoriented if neighbors face opposite sides, else estimate");
  libmap::bind(table, options.estimation);
  libmap::bind(table, options.surface.reconstruction);
  libmap::bind(table, options.surface.cleaning);
  table.add("tile_size_m", options.surface.tile_m, libmap::positive,
            "side of a tile if the output is a folder, m");
}

void check_points(const std::string& input, std::size_t points, std::size_t dropped, Run& run) {
  if (dropped > 0) run.warn("{}: {} points without a finite position are skipped", input, dropped);
  if (points == 0) throw libmap::no_elements("points of the cloud", input);
}

libmap::PointCloud read_points(const std::string& input, Run& run) {
  libmap::CloudReadResult read = libmap::read_cloud(input);
  check_points(input, read.cloud.size(), read.dropped_points, run);
  return std::move(read.cloud);
}

// Orients normals without a consistent orientation, such as those from Open3D, PCL or a PCA.
void orient_if_mixed(const MeshOptions& options, libmap::PointCloud& cloud, Run& run) {
  const double fraction = libmap::opposing_fraction(cloud.positions, cloud.normals);
  run.add_results({{"opposing_normals", fraction}});
  if (fraction <= libmap::max_opposing_fraction || options.normals == NormalSource::cloud) return;
  const libmap::NormalEstimationResult oriented =
      run.timed("normals", [&] { return libmap::orient_normals(cloud); });
  cloud.normals = oriented.normals;
  const std::string way(to_text(oriented.orientation));
  run.warn("{}: {:.1f} % of neighboring normals face opposite sides; all are reoriented by {}",
           options.cloud, 100.0 * fraction, way);
  run.add_results({{"normals_oriented_by", way}});
}

void prepare_normals(const MeshOptions& options, libmap::PointCloud& cloud, Run& run) {
  const bool has_any = std::any_of(
      cloud.normals.begin(), cloud.normals.end(),
      [](const Eigen::Vector3f& normal) { return normal.allFinite() && !normal.isZero(0.0F); });
  if (options.normals != NormalSource::estimate && cloud.has_normals()) {
    if (has_any) return orient_if_mixed(options, cloud, run);
    throw libmap::Error("the stored normals cannot be used; use --normals estimate",
                        {.file = options.cloud, .field = "normals", .value = "all zero or NaN"});
  }
  if (options.normals == NormalSource::cloud)
    throw libmap::Error("the cloud has no normals", {.file = options.cloud,
                                                     .field = "--normals",
                                                     .value = "cloud",
                                                     .bound = "auto or estimate"});
  const libmap::NormalEstimationResult estimated =
      run.timed("normals", [&] { return libmap::estimate_normals(cloud, options.estimation); });
  cloud.normals = estimated.normals;
  const std::string way(to_text(estimated.orientation));
  run.info("normals estimated{}, oriented by {}",
           options.normals == NormalSource::automatic ? ", because the cloud has none" : "", way);
  run.add_results({{"normals_oriented_by", way}, {"normals_undefined", estimated.undefined}});
}

// Reports the expected size, memory and time of large surfaces before the work.
void announce(const libmap::SurfaceWork& work, Run& run) {
  if (work.triangles < 2e6) return;
  run.info("about {:.1f} million triangles: {:.1f} GB of memory, {:.0f} s on one thread",
           1e-6 * work.triangles, 1e-9 * work.bytes, work.seconds);
  if (work.bytes > static_cast<double>(libmap::machine_memory()))
    run.warn("this exceeds the machine's memory; use a larger --cell-size or a folder of tiles");
}

libmap::TriangleMesh reconstructed(const MeshOptions& options, const libmap::PointCloud& cloud,
                                   Run& run) {
  libmap::SurfaceReconstructionResult made =
      libmap::reconstruct_surface(cloud, options.surface.reconstruction, run.progress(),
                                  [&](const libmap::SurfaceWork& work) { announce(work, run); });
  if (made.dropped_points > 0)
    run.warn("{} of {} points have no normal and are skipped", made.dropped_points, cloud.size());
  run.add_results({{"points", cloud.size()}});
  run.add_results(libmap::described(made));
  run.add_timings(made.timings_s, "reconstruction");
  run.info("{} points, cells of {:.4g} m -> {} triangles", cloud.size(), made.cell_size_m,
           made.mesh.triangles.size());
  if (!made.mesh.triangles.empty()) return std::move(made.mesh);
  if (made.trimmed_triangles == 0)
    throw libmap::Error("no surface was found: there are too few points, or their normals cancel",
                        {.file = options.cloud});
  throw libmap::Error(
      "trimming removed the entire surface; use a larger distance",
      {.file = options.cloud,
       .field = "trim_distance_cells",
       .value = libmap::to_text(options.surface.reconstruction.trim_distance_cells)});
}

libmap::TriangleMesh cleaned(const MeshOptions& options, const libmap::TriangleMesh& mesh,
                             Run& run) {
  libmap::MeshCleaningResult made =
      libmap::clean_mesh(mesh, options.surface.cleaning, run.progress());
  run.add_results(libmap::described(made));
  run.add_timings(made.timings_s, "cleaning");
  run.info("{} islands dropped, {} holes filled -> {} triangles", made.islands, made.filling.holes,
           made.mesh.triangles.size());
  return std::move(made.mesh);
}

libmap::ResultTable quality(const libmap::PointCloud& cloud, const libmap::TriangleMesh& mesh) {
  libmap::ResultTable table = libmap::described(libmap::report_mesh(mesh));
  table.append("cloud_to_mesh_", libmap::described(libmap::distance_statistics(
                                     libmap::distances_to_surface(cloud.positions, mesh))));
  return table;
}

void print_text(const Json& quality) {
  for (const auto& [key, value] : quality.items()) {
    std::cout << key << ":";
    if (value.is_boolean())
      std::cout << (value.get<bool>() ? " yes" : " no");
    else if (value.is_array())
      for (const Json& number : value) std::cout << fmt::format(" {:.4g}", number.get<double>());
    else if (value.is_number_float())
      std::cout << fmt::format(" {:.6g}", value.get<double>());
    else
      std::cout << " " << value.dump();
    std::cout << "\n";
  }
}

void report(const MeshOptions& options, const libmap::PointCloud& cloud,
            const libmap::TriangleMesh& mesh, Run& run) {
  const libmap::ResultTable found = run.timed("report", [&] { return quality(cloud, mesh); });
  for (const libmap::NamedResult& one : found.results())
    if (run.manifest().find_result(one.key) == nullptr) run.add_results({one});
  if (options.json)
    print_json(to_json(found));
  else
    print_text(to_json(found));
}

void mesh(const MeshOptions& options, Run& run) {
  libmap::require_mesh_format(options.output);
  run.claim_output(options.output, {options.cloud});
  libmap::PointCloud cloud = run.timed("read", [&] { return read_points(options.cloud, run); });
  libmap::TriangleMesh surface;
  in_file(options.cloud, [&] {
    prepare_normals(options, cloud, run);
    surface = cleaned(options, reconstructed(options, cloud, run), run);
  });
  if (options.report || options.json) report(options, cloud, surface, run);
  run.add_input(options.cloud);
  copy_frame(options.cloud, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_mesh(temporary, surface); });
}

TileFolder::TileData tile_data_of(const libmap::SurfaceTile& made) {
  return {{"vertices", made.mesh.vertices.size()},
          {"triangles", made.mesh.triangles.size()},
          {"area_m2", libmap::surface_area(made.mesh)},
          {"component_areas_m2", made.component_areas_m2},
          {"seams", made.seams}};
}

// Totals of the written tiles.
struct Totals {
  std::int64_t tiles = 0;
  std::int64_t vertices = 0;
  std::int64_t triangles = 0;
  double area_m2 = 0.0;

  void add(const libmap::TriangleMesh& mesh) {
    add({{"vertices", mesh.vertices.size()},
         {"triangles", mesh.triangles.size()},
         {"area_m2", libmap::surface_area(mesh)}});
  }
  void add(const TileFolder::TileData& data) {
    const auto count = data.at("triangles").get<std::int64_t>();
    tiles += count > 0 ? 1 : 0;
    vertices += data.at("vertices").get<std::int64_t>();
    triangles += count;
    area_m2 += data.at("area_m2").get<double>();
  }
};

// File name of a tile, without extension.
std::string name_of(const libmap::XyTile& tile) { return libmap::tile_file_name(tile, ""); }

Totals assemble(const MeshOptions& options, const TileFolder& output,
                const std::vector<libmap::XyTile>& tiles, const fs::path& folder, Run& run) {
  libmap::SurfaceIslands islands;
  for (const libmap::XyTile& tile : tiles) {
    const TileFolder::TileData data = output.tile_data(name_of(tile));
    libmap::SurfaceTile made;
    data.at("component_areas_m2").get_to(made.component_areas_m2);
    data.at("seams").get_to(made.seams);
    islands.add(tile, made);
  }
  const libmap::SurfaceIslands::Dropped dropped = islands.dropped(options.surface.cleaning);
  Totals totals;
  for (const libmap::XyTile& tile : tiles) {
    const TileFolder::TileData data = output.tile_data(name_of(tile));
    const fs::path to = folder / libmap::tile_file_name(tile, ".ply");
    const auto components = dropped.find(tile);
    if (components != dropped.end()) {
      const libmap::TriangleMesh kept = libmap::without_components(
          libmap::read_mesh(output.file(name_of(tile), ".ply")).mesh, components->second);
      totals.add(kept);
      if (!kept.triangles.empty()) libmap::write_mesh(to, kept);
    } else if (data.at("triangles") > 0) {
      totals.add(data);
      TileFolder::link_file(output.file(name_of(tile), ".ply"), to);
    }
  }
  if (totals.triangles == 0)
    throw libmap::Error("no surface was found: there are too few points, or their normals cancel",
                        {.file = options.cloud});
  run.add_results({{"tiles", totals.tiles},
                   {"islands_across_tiles", islands.islands()},
                   {"vertices", totals.vertices},
                   {"triangles", totals.triangles},
                   {"area_m2", totals.area_m2}});
  return totals;
}

// Makes and writes the tiles one by one.
void make_tiles(const MeshOptions& options, TileFolder& output, Run& run) {
  libmap::CloudStatistics statistics;
  std::map<libmap::XyTile, std::size_t> points_in_tiles;
  libmap::TileIndex index = run.timed("statistics", [&] {
    return libmap::TileIndex(libmap::cloud_tiles(options.cloud),
                             [&](const libmap::PointCloud& tile) {
                               statistics.add(tile, options.surface.reconstruction.weigh_by_error);
                               libmap::add_surface_tiles(tile, options.surface, points_in_tiles);
                             });
  });
  check_points(options.cloud, index.points(), index.dropped_points(), run);
  if (statistics.dropped_points() > 0)
    run.warn("{} of {} points have no normal and are skipped", statistics.dropped_points(),
             index.points());
  run.add_results({{"points", index.points()},
                   {"dropped_points", statistics.dropped_points()},
                   {"cell_size_m", options.surface.reconstruction.cell_size_m}});
  std::vector<libmap::XyTile> tiles;
  std::vector<std::string> names;
  for (const auto& [tile, points] : points_in_tiles) {
    tiles.push_back(tile);
    names.push_back(name_of(tile));
  }
  const auto make = [&](std::size_t n, const fs::path& to) {
    const libmap::XyBox box =
        libmap::xy_box_of(tiles[n], options.surface.tile_m, options.surface.margin_m());
    const libmap::SurfaceTile made = libmap::make_surface_tile(
        index.points_in(box.min(), box.max()), statistics, tiles[n], options.surface);
    if (!made.mesh.triangles.empty()) libmap::write_mesh(to, made.mesh);
    return tile_data_of(made);
  };
  const auto finish = [&](const fs::path& folder) {
    const Totals totals = assemble(options, output, tiles, folder, run);
    run.info("{} points -> {} triangles in {} tiles", index.points(), totals.triangles,
             totals.tiles);
  };
  output.make({names, ".ply", make, finish});
}

void mesh_in_tiles(const MeshOptions& options, Run& run) {
  if (options.report || options.json)
    throw libmap::Error("can only be used if the output is one mesh, not a folder of tiles",
                        {.field = options.json ? "--json" : "--report"});
  if (options.normals == NormalSource::estimate)
    throw libmap::Error("cannot be used with tiles, because orientation needs the whole cloud",
                        {.field = "--normals", .value = "estimate", .bound = "auto or cloud"});
  options.surface.check();
  in_file(options.cloud, [&] {
    run.add_input(options.cloud);
    copy_frame(options.cloud, run);
    TileFolder output(options.output, tile_folder_names(options.output), {options.cloud},
                      libmap::parse_share(options.tile), run);
    if (!output.is_complete()) make_tiles(options, output, run);
  });
}

}  // namespace

int main(int argc, char** argv) {
  MeshOptions options;
  Command command("mesh");
  command.input("CLOUD", options.cloud, "cloud (.pcd, .ply, .csv), or a folder of its tiles");
  command.output(options.output,
                 std::string("mesh (.ply, .vtp, .obj, .stl, .off, .glb)") + or_tile_folder);
  add_share_option(command, options.tile);
  command.flag("--report", options.report,
               "print properties of the surface and the distances of the points from it");
  command.flag("--json", options.json, "print the report as JSON");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) {
    if (is_tile_folder(options.output)) return mesh_in_tiles(options, run);
    require_folder_of_share(options.output, options.tile);
    mesh(options, run);
  });
}
