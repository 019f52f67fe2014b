#include "libmap/raster/raster_module.h"

#include <dlfcn.h>

#include <string>

#include "libmap/core/error.h"

namespace libmap {

namespace {

// The module is next to this library in any installation.
std::filesystem::path module_path() {
  Dl_info library;
  if (dladdr(reinterpret_cast<void*>(&raster_module), &library) == 0) return {};
  std::error_code code;
  return std::filesystem::canonical(library.dli_fname, code).parent_path() /
         "libgraspmap_raster_gdal.so";
}

}  // namespace

const RasterModule& raster_module() {
#ifndef GRASPMAP_HAS_GDAL
  throw Error("GeoTIFF: graspmap was built without GDAL; install libgdal-dev and rebuild", {},
              ErrorKind::failed);
#endif
  static void* const library = dlopen(module_path().c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const symbol = library == nullptr ? nullptr : dlsym(library, raster_module_symbol);
  if (symbol == nullptr)
    throw Error("GeoTIFF: " + module_path().string() + " cannot be loaded", {}, ErrorKind::failed);
  return *static_cast<const RasterModule*>(symbol);
}

}  // namespace libmap
