// graspmap mesh: a cloud of points -> a clean surface.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/cloud_io.h"
#include "libmap/cloud/normals.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_report.h"
#include "libmap/surface/poisson_reconstruction.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"

namespace {

using graspmap_tools::Run;
using Json = nlohmann::ordered_json;

// Whose normals the surface is made from.
enum class NormalSource { automatic, cloud, estimate };

struct MeshOptions {
  std::string cloud;
  std::string output;
  NormalSource normals = NormalSource::automatic;
  bool report = false;
  bool json = false;
  libmap::NormalEstimationOptions estimation;
  libmap::PoissonReconstructionOptions reconstruction;
  libmap::MeshCleaningOptions cleaning;
};

void bind(libmap::ParameterTable& table, MeshOptions& options) {
  table.add(
      "normals", options.normals,
      {{"auto", NormalSource::automatic},
       {"cloud", NormalSource::cloud},
       {"estimate", NormalSource::estimate}},
      "auto: the cloud's, estimated if it has none; cloud: an error if it has none; estimate: "
      "always estimated");
  libmap::bind(table, options.estimation);
  libmap::bind(table, options.reconstruction);
  libmap::bind(table, options.cleaning);
}

libmap::PointCloud read_points(const std::string& file, Run& run) {
  libmap::CloudReadResult read = libmap::read_cloud(file);
  if (read.dropped_points > 0)
    run.warn(fmt::format("{}: {} points without a finite position are left out", file,
                         read.dropped_points));
  if (read.cloud.empty()) throw libmap::Error("the cloud has no points", {.file = file});
  return std::move(read.cloud);
}

void prepare_normals(const MeshOptions& options, libmap::PointCloud& cloud, Run& run) {
  const bool has_any = std::any_of(
      cloud.normals.begin(), cloud.normals.end(),
      [](const Eigen::Vector3f& normal) { return normal.allFinite() && !normal.isZero(0.0F); });
  if (options.normals != NormalSource::estimate && cloud.has_normals()) {
    if (has_any) return;
    throw libmap::Error(
        "none of the cloud's normals says a direction; --normals estimate makes "
        "others",
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
  run.say(fmt::format(
      "normals estimated{}, their sides chosen by {}",
      options.normals == NormalSource::automatic ? ", since the cloud has none" : "", way));
  run.manifest().results.emplace_back("normals_oriented_by", way);
  run.manifest().results.emplace_back("normals_undefined",
                                      static_cast<std::int64_t>(estimated.undefined));
}

class Results {
 public:
  explicit Results(libmap::Manifest& manifest) : manifest_(manifest) {}
  void count(const char* name, std::size_t value) {
    manifest_.results.emplace_back(name, static_cast<std::int64_t>(value));
  }
  void number(const char* name, double value) { manifest_.results.emplace_back(name, value); }
  void yes_or_no(const char* name, bool value) { manifest_.results.emplace_back(name, value); }

 private:
  libmap::Manifest& manifest_;
};

void add_timings(const std::string& stage,
                 const std::vector<std::pair<std::string, double>>& timings_s, Run& run) {
  for (const auto& [name, seconds] : timings_s) {
    run.manifest().timings_s.emplace_back(fmt::format("{}: {}", stage, name), seconds);
    run.detail(fmt::format("{}: {}: {:.3f} s", stage, name, seconds));
  }
}

libmap::TriangleMesh reconstructed(const MeshOptions& options, const libmap::PointCloud& cloud,
                                   Run& run) {
  libmap::PoissonReconstructionResult made =
      libmap::reconstruct_surface(cloud, options.reconstruction, run.progress());
  if (made.dropped_points > 0)
    run.warn(fmt::format("{} of {} points have no normal and are left out", made.dropped_points,
                         cloud.size()));
  Results results(run.manifest());
  results.count("points", cloud.size());
  results.count("dropped_points", made.dropped_points);
  results.number("cell_size_m", made.cell_size_m);
  results.number("spacing_m", made.spacing_m);
  results.count("samples", made.samples);
  results.count("octree_depth", static_cast<std::size_t>(made.octree_depth));
  results.count("trimmed_triangles", made.trimmed_triangles);
  add_timings("reconstruction", made.timings_s, run);
  run.say(fmt::format("{} points, cells of {:.4g} m -> {} triangles", cloud.size(),
                      made.cell_size_m, made.mesh.triangles.size()));
  if (!made.mesh.triangles.empty()) return std::move(made.mesh);
  if (made.trimmed_triangles == 0)
    throw libmap::Error("no surface was found: the points are too few, or their normals cancel",
                        {.file = options.cloud});
  throw libmap::Error("no surface is so near the points",
                      {.file = options.cloud,
                       .field = "trim_distance_cells",
                       .value = libmap::to_text(options.reconstruction.trim_distance_cells)});
}

libmap::TriangleMesh cleaned(const MeshOptions& options, const libmap::TriangleMesh& mesh,
                             Run& run) {
  libmap::MeshCleaningResult made = libmap::clean_mesh(mesh, options.cleaning, run.progress());
  Results results(run.manifest());
  results.count("cut_edges", made.cut_edges);
  results.count("split_vertices", made.split_vertices);
  results.count("degenerate_triangles", made.degenerate_triangles);
  results.count("islands", made.islands);
  results.number("island_area_m2", made.island_area_m2);
  results.count("intersecting_triangles", made.intersecting_triangles);
  results.count("remaining_intersecting_triangles", made.remaining_intersecting_triangles);
  results.count("filled_holes", made.filling.holes);
  results.count("filled_triangles", made.filling.triangles);
  results.number("filled_area_m2", made.filling.area_m2);
  results.count("unfilled_holes", made.filling.unfilled);
  results.count("decimated_triangles", made.decimation.removed_triangles);
  results.count("vertices", made.mesh.vertices.size());
  results.count("triangles", made.mesh.triangles.size());
  results.number("area_m2", libmap::surface_area(made.mesh));
  add_timings("cleaning", made.timings_s, run);
  run.say(fmt::format("{} islands dropped, {} holes filled -> {} triangles", made.islands,
                      made.filling.holes, made.mesh.triangles.size()));
  return std::move(made.mesh);
}

Json quality(const libmap::PointCloud& cloud, const libmap::TriangleMesh& mesh) {
  const libmap::MeshReport report = libmap::report_mesh(mesh);
  const auto distances =
      libmap::distance_statistics(libmap::distances_to_surface(cloud.positions, mesh));
  std::vector<double> boundaries;
  for (const libmap::MeshBoundary& boundary : report.boundaries)
    boundaries.push_back(boundary.length_m);
  Json json = {{"watertight", report.is_watertight()},
               {"manifold", report.is_manifold()},
               {"oriented", report.is_oriented()},
               {"components", report.components},
               {"genus", report.genus},
               {"boundaries", boundaries.size()},
               {"boundary_lengths_m", boundaries},
               {"area_m2", report.area_m2},
               {"non_manifold_edges", report.non_manifold_edges},
               {"non_manifold_vertices", report.non_manifold_vertices},
               {"self_intersections", report.self_intersections},
               {"median_edge_m", report.edge_lengths.median_m},
               {"cloud_to_mesh_rmse_m", distances.rmse_m},
               {"cloud_to_mesh_mean_m", distances.mean_m},
               {"cloud_to_mesh_median_m", distances.median_m},
               {"cloud_to_mesh_p95_m", distances.p95_m},
               {"cloud_to_mesh_max_m", distances.max_m}};
  return json;
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
  const Json found = run.timed("report", [&] { return quality(cloud, mesh); });
  for (const auto& [key, value] : found.items()) {
    libmap::ManifestValue kept;
    if (value.is_boolean())
      kept = value.get<bool>();
    else if (value.is_array())
      kept = value.get<std::vector<double>>();
    else if (value.is_number_float())
      kept = value.get<double>();
    else
      kept = value.get<std::int64_t>();
    if (run.manifest().find_result(key) == nullptr)
      run.manifest().results.emplace_back(key, std::move(kept));
  }
  if (options.json)
    std::cout << found.dump(2) << "\n";
  else
    print_text(found);
}

void mesh(const MeshOptions& options, Run& run) {
  libmap::require_mesh_format(options.output);
  run.claim_output(options.output, {options.cloud});
  libmap::PointCloud cloud = run.timed("read", [&] { return read_points(options.cloud, run); });
  libmap::TriangleMesh surface;
  try {
    prepare_normals(options, cloud, run);
    surface = reconstructed(options, cloud, run);
    surface = cleaned(options, surface, run);
  } catch (const libmap::Error& error) {
    throw error.in_file(options.cloud);
  }
  if (options.report || options.json) report(options, cloud, surface, run);
  run.add_input(options.cloud);
  if (const auto source = libmap::read_manifest_of(options.cloud))
    run.manifest().frame = source->frame;
  graspmap_tools::carry_transforms(options.cloud, run);
  run.write_output(options.output,
                   [&](const auto& temporary) { libmap::write_mesh(temporary, surface); });
}

}  // namespace

int main(int argc, char** argv) {
  MeshOptions options;
  graspmap_tools::Command command("mesh");
  command.input("CLOUD", options.cloud, "cloud (.pcd, .ply, .csv)");
  command.output(options.output, "mesh (.ply, .vtp, .obj, .stl, .off, .glb)");
  command.flag("--report", options.report,
               "print what the mesh is as a surface, and how far the points lie from it");
  command.flag("--json", options.json, "that report as JSON");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { mesh(options, run); });
}
