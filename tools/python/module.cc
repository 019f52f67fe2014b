// The extension module graspmap._core: the stages on arrays. Its Python interface is in graspmap/.
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "tools/python/values.h"

namespace {

const graspmap_python::Stage& stage_of(const std::string& name) {
  std::vector<std::string> names;
  for (const graspmap_python::Stage& stage : graspmap_python::stages()) {
    if (stage.name == name) return stage;
    names.push_back(stage.name);
  }
  throw libmap::Error("no stage of this name has options" + libmap::did_you_mean(name, names),
                      {.field = "stage", .value = name, .bound = graspmap_python::one_of(names)});
}

pybind11::list options(const std::string& stage) { return stage_of(stage).options(); }
pybind11::list results(const std::string& stage) { return stage_of(stage).results(); }

}  // namespace

PYBIND11_MODULE(_core, module) {
  graspmap_python::translate_errors();
  graspmap_python::add_shapes(module);
  graspmap_python::add_scans(module);
  graspmap_python::add_surfaces(module);
  graspmap_python::add_maps(module);
  graspmap_python::add_grasps(module);
  graspmap_python::add_images(module);
  graspmap_python::define(module, "options", &options, {"stage"});
  graspmap_python::define(module, "results", &results, {"stage"});
  module.def("check_names", &graspmap_python::check_names);
  module.def("stages", [] {
    std::vector<std::string> names;
    for (const graspmap_python::Stage& stage : graspmap_python::stages())
      names.push_back(stage.name);
    return names;
  });
}
