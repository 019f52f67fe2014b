// Maps and clouds as GeoTIFF.
#pragma once

#include <string>

#include "libmap/raster/map_raster.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// The raster of a map or cloud whose points `parts` visits and whose manifest is `manifest`.
//
// With a georeference, it lies in its CRS, else in the frame of the points. Pixels are columns of
// voxels: their axes are the lattice's x and y axes, laid into the horizontal plane. pixel_size_m
// 0: the map's voxel size. Throws Error if there is none, and as make_map_raster.
libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m);

// Writes it to `output`, claimed before; facts and inputs are in the run's manifest already. What
// its frame is: in a CRS, no transform leads to it.
void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run);

}  // namespace graspmap_tools
