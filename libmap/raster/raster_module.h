// What libgraspmap_raster_gdal.so offers. It alone links GDAL, which brings some 140 libraries: it
// is loaded when a GeoTIFF is read or written.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "libmap/raster/dem_reader.h"
#include "libmap/raster/map_raster.h"

namespace libmap {

struct RasterModule {
  // Calls head once, then block for each block. Throws Error.
  void (*read_dem)(const std::filesystem::path& path, const std::optional<Georeference>& frame,
                   const std::function<void(const DemInfo&)>& head,
                   const std::function<void(const DemBlock&)>& block);
  // Throws Error (failed).
  void (*write_raster)(const std::filesystem::path& path, const MapRaster& raster);
};

// The name of its only symbol, a `const RasterModule`.
inline constexpr const char* raster_module_symbol = "graspmap_raster_module";

// Loads it, once. Throws Error (failed) saying what is missing: GDAL when graspmap was built, or
// now.
const RasterModule& raster_module();

}  // namespace libmap
