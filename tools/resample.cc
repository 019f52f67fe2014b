// graspmap resample: samples a surface by Poisson disks.
#include <limits>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/poisson_disk.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/tile_folder.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct ResampleOptions {
  std::string mesh;
  std::string output;
  libmap::PoissonDiskOptions sampling;
};

void tell_results(const libmap::PoissonDiskResult& result, std::uint64_t wanted, Run& run) {
  run.add_results(libmap::described(result));
  run.add_timings(result.timings_s);
  run.detail("radii tried: {}", result.tried_radii);
  run.info("{:.2f} m2 -> {} points, radius {:.4g} mm, relative radius {:.3f}", result.area_m2,
           result.cloud.size(), 1e3 * result.radius_m, result.relative_radius);
  if (!result.count_reached)
    run.warn("no radius gives {} points; the nearest number is {}", wanted, result.cloud.size());
}

void require_one_of_radius_and_count(const libmap::PoissonDiskOptions& sampling) {
  if (sampling.count > 0 && sampling.radius_m != libmap::PoissonDiskOptions().radius_m)
    throw libmap::Error("cannot be combined with --radius, which determines the number of samples",
                        {.field = "--count", .value = std::to_string(sampling.count)});
}

void resample(const ResampleOptions& options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.mesh});
  const libmap::PoissonDiskOptions& sampling = options.sampling;
  require_one_of_radius_and_count(sampling);
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  run.add_input(options.mesh);
  const libmap::PoissonDiskResult result = in_file(
      options.mesh, [&] { return libmap::sample_poisson_disk(mesh, sampling, run.progress()); });
  copy_frame(options.mesh, run);
  tell_results(result, sampling.count, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, result.cloud); });
}

// Samples and writes the mesh tile by tile.
void write_tiles(const std::vector<fs::path>& tiles, libmap::TileSampler& sampler,
                 const fs::path& folder, Run& run) {
  std::size_t points = 0;
  double area_m2 = 0.0;
  double smallest_m = std::numeric_limits<double>::infinity();
  run.progress().begin("tiles", tiles.size());
  for (std::size_t n = 0; n < tiles.size(); ++n) {
    const libmap::PoissonDiskResult result = in_file(
        tiles[n].string(), [&] { return sampler.sample(libmap::read_mesh(tiles[n]).mesh, n); });
    run.progress().advance(1);
    points += result.cloud.size();
    area_m2 += result.area_m2;
    if (result.smallest_distance_m > 0.0)
      smallest_m = std::min(smallest_m, result.smallest_distance_m);
    if (!result.cloud.empty())
      libmap::write_cloud(folder / (tiles[n].stem().string() + ".pcd"), result.cloud);
  }
  run.add_results({{"tiles", tiles.size()},
                   {"points", points},
                   {"area_m2", area_m2},
                   {"smallest_distance_m", smallest_m}});
  run.info("{:.2f} m2 in {} tiles -> {} points", area_m2, tiles.size(), points);
}

void resample_tiles(const ResampleOptions& options, Run& run) {
  require_one_of_radius_and_count(options.sampling);
  const std::vector<fs::path> tiles = libmap::mesh_tiles(options.mesh);
  const std::vector<std::string> names = tile_folder_names(options.output, tiles, ".pcd");
  run.claim_output_tree(options.output, names, {options.mesh});
  std::vector<libmap::Bounds3d> boxes;
  for (const fs::path& tile : tiles)
    boxes.push_back(libmap::bounds_of(libmap::read_mesh(tile).mesh.vertices));
  run.add_input(options.mesh);
  libmap::TileSampler sampler(std::move(boxes), options.sampling);
  copy_frame(options.mesh, run);
  run.write_output_tree(options.output, names, [&](const fs::path& folder) {
    if (!folder.empty()) write_tiles(tiles, sampler, folder, run);
  });
}

}  // namespace

int main(int argc, char** argv) {
  ResampleOptions options;
  Command command("resample");
  command.input("MESH", options.mesh,
                "mesh to sample (.ply, .obj, .stl, .off, .glb), or a folder of its tiles");
  command.output(options.output,
                 std::string("cloud with normals (.pcd, .ply, .vtp, .csv)") + or_tile_folder);
  libmap::bind(command.parameters(), options.sampling);
  return command.run(argc, argv, [&](Run& run) {
    is_tile_folder(options.output) ? resample_tiles(options, run) : resample(options, run);
  });
}
