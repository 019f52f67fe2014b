// graspmap resample: Poisson-disk samples of a surface.
#include <fmt/format.h>

#include <cmath>
#include <string>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/poisson_disk.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

namespace {

using graspmap_tools::Run;

struct ResampleOptions {
  std::string mesh;
  std::string output;
  libmap::PoissonDiskOptions sampling;
};

void add_results(const libmap::PoissonDiskResult& result, libmap::Manifest& manifest) {
  manifest.results.emplace_back("points", static_cast<std::int64_t>(result.cloud.size()));
  manifest.results.emplace_back("area_m2", result.area_m2);
  manifest.results.emplace_back("radius_m", result.radius_m);
  manifest.results.emplace_back("smallest_distance_m", result.smallest_distance_m);
  manifest.results.emplace_back("relative_radius", result.relative_radius);
  manifest.results.emplace_back("radii_tried", static_cast<std::int64_t>(result.tries));
  manifest.timings_s.insert(manifest.timings_s.end(), result.timings_s.begin(),
                            result.timings_s.end());
}

void say_result(const libmap::PoissonDiskResult& result, std::uint64_t wanted, Run& run) {
  for (const auto& [name, seconds] : result.timings_s)
    run.detail(fmt::format("{}: {:.3f} s", name, seconds));
  run.detail(fmt::format("radii tried: {}", result.tries));
  run.say(fmt::format("{:.2f} m2 -> {} points, radius {:.4g} mm, relative radius {:.3f}",
                      result.area_m2, result.cloud.size(), 1e3 * result.radius_m,
                      result.relative_radius));
  if (!result.count_reached)
    run.warn(fmt::format("no radius was found that yields {} points; {} are the nearest", wanted,
                         result.cloud.size()));
}

void resample(const ResampleOptions& options, Run& run) {
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output, {options.mesh});
  const libmap::PoissonDiskOptions& sampling = options.sampling;
  if (sampling.count > 0 && sampling.radius_m != libmap::PoissonDiskOptions().radius_m)
    throw libmap::Error(
        "the number of samples follows from their radius: one of --radius and "
        "--count",
        {.file = {}, .field = "count", .value = std::to_string(sampling.count), .bound = {}});
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  run.add_input(options.mesh);
  libmap::PoissonDiskResult result;
  try {
    result = libmap::sample_poisson_disk(mesh, sampling, run.progress());
  } catch (const libmap::Error& error) {
    throw error.in_file(options.mesh);
  }
  if (const auto source = libmap::read_manifest_of(options.mesh))
    run.manifest().frame = source->frame;
  graspmap_tools::carry_transforms(options.mesh, run);
  add_results(result, run.manifest());
  say_result(result, sampling.count, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, result.cloud); });
}

}  // namespace

int main(int argc, char** argv) {
  ResampleOptions options;
  graspmap_tools::Command command("resample");
  command.input("MESH", options.mesh, "surface (.ply, .obj, .stl, .off, .glb)");
  command.output(options.output, "cloud with normals (.pcd, .ply, .vtp, .csv)");
  libmap::bind(command.parameters(), options.sampling);
  return command.run(argc, argv, [&](Run& run) { resample(options, run); });
}
