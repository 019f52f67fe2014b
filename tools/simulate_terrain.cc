// graspmap simulate terrain: makes rocky ground of any size as a folder of tiles.
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/simulate/terrain_tiles.h"
#include "tools/support/command_line.h"
#include "tools/support/option_values.h"
#include "tools/support/subcommands.h"
#include "tools/support/tile_folder.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct SimulateTerrainOptions {
  std::string output;
  std::string size = "100";
  libmap::TerrainTilesOptions tiles;
};

// Makes and writes the tiles one by one. Returns the number of points.
std::size_t write_tiles(const SimulateTerrainOptions& options,
                        const std::vector<libmap::XyTile>& tiles, const fs::path& folder,
                        Run& run) {
  run.progress().begin("tiles", tiles.size());
  std::vector<std::size_t> points(tiles.size());
  libmap::parallel_each(tiles.size(), [&](std::size_t n) {
    const libmap::PointCloud cloud = libmap::sample_tile(options.tiles, tiles[n]);
    libmap::write_cloud(folder / libmap::tile_file_name(tiles[n], ".pcd"), cloud);
    points[n] = cloud.size();
    run.progress().advance(1);
  });
  run.progress().end();
  std::size_t sum = 0;
  for (const std::size_t count : points) sum += count;
  return sum;
}

void simulate(SimulateTerrainOptions& options, Run& run) {
  const auto size = split_size(options.size);
  if (!size)
    throw libmap::Error(
        "not a size", {.field = "--size", .value = options.size, .bound = "M or XxY, meters, > 0"});
  options.tiles.size_x_m = size->x();
  options.tiles.size_y_m = size->y();
  const std::vector<libmap::XyTile> tiles = libmap::terrain_tiles(options.tiles);
  const std::vector<std::string> names = tile_folder_names(options.output);
  run.claim_output_tree(options.output, names);
  run.manifest().frame = "terrain";
  run.write_output_tree(options.output, names, [&](const fs::path& folder) {
    if (folder.empty()) return;  // --dry-run
    const std::size_t points = write_tiles(options, tiles, folder, run);
    run.add_results({{"tiles", tiles.size()}, {"points", points}});
    run.info("{} points in {} tiles", points, tiles.size());
  });
}

}  // namespace

int graspmap_tools::simulate_terrain(int argc, char** argv) {
  SimulateTerrainOptions options;
  Command command("simulate terrain", "Generates rocky ground of any size as a folder of clouds.");
  command.output(options.output, "folder of clouds piece_I_J.pcd, one per tile of the x-y plane");
  command.parameters().add("size", options.size, "size of the terrain in m: XxY, or M for M x M");
  bind(command.parameters(), options.tiles);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
