// Interface of libgraspmap_raster_gdal.so, the only library that links GDAL and thereby 140 other
// libraries. It is loaded on the first access to a GeoTIFF.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "libmap/raster/dem_reader.h"
#include "libmap/raster/map_raster.h"

namespace libmap {

struct RasterModule {
  // Reads a DEM as DemReader does: calls head(info), then block(pixels) for each block.
  void (*read_dem)(const std::filesystem::path& path, const std::optional<Georeference>& frame,
                   const std::function<void(const DemInfo&)>& head,
                   const std::function<void(const DemBlock&)>& block);
  // Writes a GeoTIFF as write_map_raster does.
  void (*write_raster)(const std::filesystem::path& path, const MapRaster& raster);
};

// Name of the library's only symbol, a `const RasterModule`.
inline constexpr const char* raster_module_symbol = "graspmap_raster_module";

// Returns the module; the first call loads the library. Throws Error (failed) if graspmap was built
// without GDAL or the library cannot be loaded.
const RasterModule& raster_module();

}  // namespace libmap
