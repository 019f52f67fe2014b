// graspmap simulate terrain: rocky ground of any size, as a folder of pieces.
#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/simulate/terrain_pieces.h"
#include "tools/support/command_line.h"
#include "tools/support/simulate_commands.h"

namespace {

namespace fs = std::filesystem;
using graspmap_tools::Run;

struct SimulateTerrainOptions {
  std::string output;
  std::string size = "100";
  libmap::TerrainPiecesOptions pieces;
};

// "100" or "100x30".
void parse_size(const std::string& text, libmap::TerrainPiecesOptions& options) {
  const std::size_t cross = text.find('x');
  const auto x = libmap::parse_double(text.substr(0, cross));
  const auto y = cross == std::string::npos ? x : libmap::parse_double(text.substr(cross + 1));
  if (!x || !y || !(*x > 0.0) || !(*y > 0.0))
    throw libmap::Error("not a size",
                        {.field = "--size", .value = text, .bound = "M or XxY, meters, > 0"});
  options.size_x_m = *x;
  options.size_y_m = *y;
}

// The names of this terrain's pieces, and of those of an earlier one that it replaces.
std::vector<std::string> folder_names(const fs::path& folder,
                                      const std::vector<libmap::TerrainPiece>& pieces) {
  std::vector<std::string> names;
  names.reserve(pieces.size());
  for (const libmap::TerrainPiece& piece : pieces) names.push_back(libmap::piece_file_name(piece));
  if (!fs::is_directory(folder)) return names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (libmap::is_piece_file_name(name)) names.push_back(name);
  }
  return names;
}

// Each piece is made, written and forgotten. Returns the number of points.
std::size_t write_pieces(const SimulateTerrainOptions& options,
                         const std::vector<libmap::TerrainPiece>& pieces, const fs::path& folder,
                         Run& run) {
  run.progress().begin("pieces", pieces.size());
  std::vector<std::size_t> points(pieces.size());
  libmap::parallel_for(pieces.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const libmap::PointCloud cloud = libmap::sample_piece(options.pieces, pieces[n]);
      libmap::write_cloud(folder / libmap::piece_file_name(pieces[n]), cloud);
      points[n] = cloud.size();
      run.progress().advance(1);
    }
  });
  run.progress().end();
  std::size_t sum = 0;
  for (const std::size_t count : points) sum += count;
  return sum;
}

void simulate(SimulateTerrainOptions& options, Run& run) {
  parse_size(options.size, options.pieces);
  const std::vector<libmap::TerrainPiece> pieces = libmap::terrain_pieces(options.pieces);
  const std::vector<std::string> names = folder_names(options.output, pieces);
  run.claim_output_tree(options.output, names);
  run.manifest().frame = "terrain";
  run.write_output_tree(options.output, names, [&](const fs::path& folder) {
    if (folder.empty()) return;  // --dry-run
    const std::size_t points = write_pieces(options, pieces, folder, run);
    run.manifest().results.emplace_back("pieces", static_cast<std::int64_t>(pieces.size()));
    run.manifest().results.emplace_back("points", static_cast<std::int64_t>(points));
    run.say(fmt::format("{} points in {} pieces", points, pieces.size()));
  });
}

}  // namespace

int graspmap_tools::simulate_terrain(int argc, char** argv) {
  SimulateTerrainOptions options;
  Command command("simulate terrain", "Rocky ground of any size, as a folder of clouds.");
  command.output(options.output, "folder: piece_I_J.pcd, one a square of the plan");
  command.parameters().add("size", options.size, "of the whole: M or XxY, m");
  bind(command.parameters(), options.pieces);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
