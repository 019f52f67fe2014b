// graspmap resample: Poisson-disk samples of a surface.
#include "libmap/cloud/cloud_io.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/poisson_disk.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

using namespace graspmap_tools;

namespace {

struct ResampleOptions {
  std::string mesh;
  std::string output;
  libmap::PoissonDiskOptions sampling;
};

void tell_results(const libmap::PoissonDiskResult& result, std::uint64_t wanted, Run& run) {
  run.add_results({{"points", result.cloud.size()},
                   {"area_m2", result.area_m2},
                   {"radius_m", result.radius_m},
                   {"smallest_distance_m", result.smallest_distance_m},
                   {"relative_radius", result.relative_radius},
                   {"radii_tried", result.tries}});
  run.add_timings(result.timings_s);
  run.detail("radii tried: {}", result.tries);
  run.say("{:.2f} m2 -> {} points, radius {:.4g} mm, relative radius {:.3f}", result.area_m2,
          result.cloud.size(), 1e3 * result.radius_m, result.relative_radius);
  if (!result.count_reached)
    run.warn("no radius was found that yields {} points; {} are the nearest", wanted,
             result.cloud.size());
}

void resample(const ResampleOptions& options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.mesh});
  const libmap::PoissonDiskOptions& sampling = options.sampling;
  if (sampling.count > 0 && sampling.radius_m != libmap::PoissonDiskOptions().radius_m)
    throw libmap::Error(
        "the number of samples follows from their radius: one of --radius and --count",
        {.field = "count", .value = std::to_string(sampling.count)});
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  run.add_input(options.mesh);
  const libmap::PoissonDiskResult result = in_file(
      options.mesh, [&] { return libmap::sample_poisson_disk(mesh, sampling, run.progress()); });
  carry_frame(options.mesh, run);
  tell_results(result, sampling.count, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, result.cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  ResampleOptions options;
  Command command("resample");
  command.input("MESH", options.mesh, "surface (.ply, .obj, .stl, .off, .glb)");
  command.output(options.output, "cloud with normals (.pcd, .ply, .vtp, .csv)");
  libmap::bind(command.parameters(), options.sampling);
  return command.run(argc, argv, [&](Run& run) { resample(options, run); });
}
