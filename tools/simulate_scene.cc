// graspmap simulate scene: samples scenes of primitive shapes with closed-form truth.
#include "libmap/core/data_folder.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/scenes/primitive_scene.h"
#include "libmap/scenes/scene_mesh.h"
#include "libmap/scenes/scene_sampling.h"
#include "tools/support/command_line.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

struct SimulateOptions {
  std::string output;
  std::string scene = "primitive_shapes";
  bool mesh = false;
  libmap::SceneSamplingOptions sampling;
  libmap::SceneMeshOptions meshing;
};

using libmap::not_negative;
using libmap::positive;

void bind_cloud(libmap::ParameterTable& table, SimulateOptions& options) {
  table.add("spacing_m", options.sampling.spacing_m, positive, "mean distance between samples, m");
  table.add("count", options.sampling.count, not_negative,
            "number of samples, reached within 2 %, instead of --spacing; 0: use --spacing");
  table.add("jitter", options.sampling.jitter, libmap::zero_to_one,
            "random offset of the samples from their grid, as a share of a cell");
  table.add("noise_m", options.sampling.noise_m, not_negative,
            "standard deviation of the samples' noise along the surface normal, m");
  table.add("seed", options.sampling.seed, not_negative, "random seed of jitter and noise");
}

void bind_mesh(libmap::ParameterTable& table, SimulateOptions& options) {
  table.add("edge_length_m", options.meshing.edge_length_m, positive,
            "maximum edge length of the mesh, m");
  table.add("chord_error_m", options.meshing.chord_error_m, positive,
            "maximum distance of the mesh from a round shape, m");
}

void bind(libmap::ParameterTable& table, SimulateOptions& options) {
  table.add("scene", options.scene, "scene: a name in data/scenes, or a scene file (.yaml)");
  table.add("mesh", options.mesh, "write a mesh instead of a cloud");
  bind_cloud(table, options);
  bind_mesh(table, options);
}

void write_samples(const libmap::PrimitiveScene& scene, const SimulateOptions& options, Run& run) {
  const libmap::SceneSamples samples =
      run.timed("sampling", [&] { return libmap::sample_scene(scene, options.sampling); });
  run.add_results({{"points", samples.cloud.size()}, {"spacing_m", samples.spacing_m}});
  run.info("{} points, {} m apart", samples.cloud.size(),
           libmap::to_text(static_cast<float>(samples.spacing_m)));
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_cloud(temporary, samples.cloud); });
}

void write_surface(const libmap::PrimitiveScene& scene, const SimulateOptions& options, Run& run) {
  const libmap::TriangleMesh mesh =
      run.timed("meshing", [&] { return libmap::scene_mesh(scene, options.meshing); });
  run.add_results({{"vertices", mesh.vertices.size()}, {"triangles", mesh.triangles.size()}});
  run.info("{} vertices, {} triangles", mesh.vertices.size(), mesh.triangles.size());
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_mesh(temporary, mesh); });
}

void simulate(const SimulateOptions& options, Run& run) {
  reject_changed(options, options.mesh ? bind_cloud : bind_mesh,
                 options.mesh ? "cannot be combined with --mesh" : "requires --mesh");
  if (options.mesh)
    libmap::require_mesh_format(options.output);
  else
    libmap::require_cloud_format(options.output);
  run.claim_output(options.output);
  const auto file = libmap::find_data_file("scenes", options.scene);
  const libmap::PrimitiveScene scene =
      libmap::parse_scene(libmap::read_whole_file(file, libmap::max_yaml_bytes), file.string());
  run.add_input(file);
  run.manifest().frame = "scene";
  if (options.mesh)
    write_surface(scene, options, run);
  else
    write_samples(scene, options, run);
}

}  // namespace

int graspmap_tools::simulate_scene(int argc, char** argv) {
  SimulateOptions options;
  Command command("simulate scene", "Generates primitive shapes with ground truth.");
  command.output(options.output, "cloud with true normals and curvatures, or mesh");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
