// Interface of libgraspmap_raster_gdal.so, the only library that links GDAL with 140 dependencies.
// This library is loaded on the first access to a GeoTIFF.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "libmap/raster/dem_reader.h"
#include "libmap/raster/map_raster.h"

namespace libmap {

struct RasterModule {
  // Calls `head` once, then `block` for each block. Throws Error as DemReader does.
  void (*read_dem)(const std::filesystem::path& path, const std::optional<Georeference>& frame,
                   const std::function<void(const DemInfo&)>& head,
                   const std::function<void(const DemBlock&)>& block);
  // Throws Error (failed).
  void (*write_raster)(const std::filesystem::path& path, const MapRaster& raster);
};

// Name of the library's only symbol, a `const RasterModule`.
inline constexpr const char* raster_module_symbol = "graspmap_raster_module";

// Loads the library once. Throws Error (failed) if graspmap was built without GDAL or the library
// cannot be loaded.
const RasterModule& raster_module();

}  // namespace libmap
