// The extension module graspmap._core: the libraries on arrays. The face of it is in graspmap/.
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "tools/python/values.h"

namespace {

pybind11::list options_of(const std::string& stage) {
  std::vector<std::string> names;
  for (const auto& [name, describe] : graspmap_python::stages()) {
    if (name == stage) return describe();
    names.push_back(name);
  }
  std::string known;
  for (const std::string& name : names) known += (known.empty() ? "" : ", ") + name;
  throw libmap::Error("takes no options" + libmap::did_you_mean(stage, names),
                      {.field = "stage", .value = stage, .bound = "one of " + known});
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  graspmap_python::translate_errors();
  graspmap_python::add_shapes(module);
  graspmap_python::add_scans(module);
  graspmap_python::add_surfaces(module);
  graspmap_python::add_maps(module);
  graspmap_python::add_grasps(module);
  graspmap_python::add_pictures(module);
  module.def("options", &options_of);
  module.def("stages", [] {
    std::vector<std::string> names;
    for (const auto& [name, describe] : graspmap_python::stages()) names.push_back(name);
    return names;
  });
}
