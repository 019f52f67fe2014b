#include "libmap/core/error.h"
#include "libmap/fusion/normals.h"
#include "libmap/mesh/poisson_disk.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/surface_reconstruction.h"
#include "tools/python/values.h"

namespace graspmap_python {

namespace {

struct MeshOptions {
  libmap::SurfaceReconstructionOptions reconstruction;
  libmap::MeshCleaningOptions cleaning;
};

void bind(libmap::ParameterTable& table, MeshOptions& options) {
  libmap::bind(table, options.reconstruction);
  libmap::bind(table, options.cleaning);
}

py::dict estimate_normals(const libmap::PointCloud& cloud, const py::dict& values,
                          unsigned threads) {
  const auto options = options_from<libmap::NormalEstimationOptions>(values);
  libmap::PointCloud oriented = cloud;
  const libmap::NormalEstimationResult result =
      run(threads, py::none(),
          [&](libmap::Progress& /*bar*/) { return libmap::estimate_normals(cloud, options); });
  oriented.normals = result.normals;
  py::dict made;
  made["cloud"] = shared(std::move(oriented));
  made["undefined"] = result.undefined;
  made["oriented_by"] = std::string(to_text(result.orientation));
  return made;
}

py::dict mesh(const libmap::PointCloud& cloud, const py::dict& values, const py::object& progress,
              unsigned threads) {
  const auto options = options_from<MeshOptions>(values);
  libmap::SurfaceReconstructionResult raw;
  libmap::MeshCleaningResult clean = run(threads, progress, [&](libmap::Progress& bar) {
    raw = libmap::reconstruct_surface(cloud, options.reconstruction, bar);
    if (raw.mesh.triangles.empty())
      throw libmap::Error(
          "no surface was found: there are too few points, their normals cancel, or trimming "
          "removed all of it",
          {.field = "trim_distance_cells",
           .value = libmap::to_text(options.reconstruction.trim_distance_cells)});
    return libmap::clean_mesh(raw.mesh, options.cleaning, bar);
  });
  libmap::ResultTable table = libmap::described(raw);
  table.append("", libmap::described(clean));
  py::dict made = dict_of(table);
  made["mesh"] = shared(std::move(clean.mesh));
  made["holes_filled"] = clean.filling.holes;
  py::dict timings = numbers_of(raw.timings_s);
  timings.attr("update")(numbers_of(clean.timings_s));
  made["timings_s"] = timings;
  return made;
}

py::dict resample(const libmap::TriangleMesh& mesh, const py::dict& values,
                  const py::object& progress, unsigned threads) {
  const auto options = options_from<libmap::PoissonDiskOptions>(values);
  libmap::PoissonDiskResult result = run(threads, progress, [&](libmap::Progress& bar) {
    return libmap::sample_poisson_disk(mesh, options, bar);
  });
  py::dict made = dict_of(libmap::described(result));
  made["cloud"] = shared(std::move(result.cloud));
  made["count_reached"] = result.count_reached;
  made["timings_s"] = numbers_of(result.timings_s);
  return made;
}

}  // namespace

void add_surfaces(py::module_& module) {
  define(module, "estimate_normals", &estimate_normals, {"cloud", "options", "threads"});
  define(module, "mesh", &mesh, {"cloud", "options", "progress", "threads"});
  define(module, "resample", &resample, {"mesh", "options", "progress", "threads"});
  add_stage<libmap::NormalEstimationOptions>("estimate_normals");
  add_stage<MeshOptions, libmap::SurfaceReconstructionResult, libmap::MeshCleaningResult>("mesh");
  add_stage<libmap::PoissonDiskOptions, libmap::PoissonDiskResult>("resample");
}

}  // namespace graspmap_python
