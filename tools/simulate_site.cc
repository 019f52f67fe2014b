// graspmap simulate site: makes test sites with a true mesh and locations for a field test.
#include "libmap/core/data_folder.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"
#include "libmap/io/mesh_io.h"
#include "libmap/simulate/field_points.h"
#include "libmap/simulate/rock_site.h"
#include "libmap/simulate/site_mesh.h"
#include "tools/support/command_line.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

struct SimulateSiteOptions {
  std::string output;
  std::string site = "rocks";
  std::uint64_t seed = 0;
  std::uint64_t field_points = 0;
  libmap::SiteMeshOptions meshing;
};

void bind(libmap::ParameterTable& table, SimulateSiteOptions& options) {
  using libmap::not_negative;
  table.add("site", options.site, "test site: a name in data/sites, or a site file (.yaml)");
  table.add("seed", options.seed, not_negative, "random seed of the site; 0: as in the site file");
  table.add("edge_length_m", options.meshing.edge_length_m, libmap::positive,
            "approximate edge length of the mesh, m");
  table.add("closed", options.meshing.closed,
            "add the sides and base of the ground, so that the mesh is closed");
  table.add_former_key("places", "field_points");
  table.add("field_points", options.field_points, libmap::Range{0.0, 10'000.0},
            "number of locations for the field test; 0: as in the site file");
}

libmap::RockSite load(const SimulateSiteOptions& options, const std::filesystem::path& file) {
  std::optional<std::uint64_t> seed;
  if (options.seed != 0) seed = options.seed;
  libmap::RockSite site = libmap::parse_site(libmap::read_whole_file(file, libmap::max_yaml_bytes),
                                             file.string(), seed);
  if (options.field_points != 0) site.field_points.count = static_cast<int>(options.field_points);
  if (site.rocks.empty())
    throw libmap::Error("a site needs at least one rock",
                        {.file = file.string(), .field = "rocks"});
  return site;
}

void simulate(const SimulateSiteOptions& options, Run& run) {
  const std::string extension = std::filesystem::path(options.output).extension().string();
  if (extension == ".ply" || extension == ".obj" || extension == ".csv" || extension == ".yaml")
    throw libmap::Error(
        "is a file name; the output is a folder with mesh.ply, field_points.csv, site.yaml",
        {.file = options.output});
  run.claim_output_folder(options.output);
  const auto file = libmap::find_data_file("sites", options.site);
  const libmap::RockSite site = load(options, file);
  run.add_input(file);
  run.manifest().frame = "site";
  libmap::TriangleMesh mesh;
  std::vector<libmap::FieldPoint> points;
  in_file(file.string(), [&] {
    mesh = run.timed("meshing", [&] { return libmap::site_mesh(site, options.meshing); });
    points = run.timed("field points", [&] { return libmap::choose_field_points(site, mesh); });
  });
  run.add_results({{"rocks", site.rocks.size()},
                   {"vertices", mesh.vertices.size()},
                   {"triangles", mesh.triangles.size()},
                   {"field_points", points.size()}});
  run.info("{} rocks, {} triangles, {} field points", site.rocks.size(), mesh.triangles.size(),
           points.size());
  const std::string table =
      "# Locations selected by the shape of the rocks only; no field test was made at them.\n" +
      libmap::to_csv(libmap::field_point_table(site, points));
  const std::string yaml =
      "# The site with all random values: graspmap simulate site --site THIS reproduces it.\n" +
      libmap::to_yaml(site);
  run.write_output_folder(
      options.output,
      {{"mesh.ply", [&](const auto& temporary) { libmap::write_mesh(temporary, mesh); }},
       {"field_points.csv", Run::text_writer(table)},
       {"site.yaml", Run::text_writer(yaml)}});
}

}  // namespace

int graspmap_tools::simulate_site(int argc, char** argv) {
  SimulateSiteOptions options;
  Command command("simulate site", "Generates a test site of rocks, slopes or climbing holds.");
  command.output(options.output, "folder: mesh.ply (true surface), field_points.csv, site.yaml");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
