// Writes maps and clouds as GeoTIFF.
#pragma once

#include <string>

#include "libmap/raster/map_raster.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Returns the raster of a map or cloud with the points that `parts` visits.
//
// The raster is in the CRS of the manifest's georeference, else in the frame of the points. Pixels
// are columns of voxels: pixel axes are the lattice's x and y axes, projected to the horizontal
// plane. pixel_size_m 0: the map's voxel size. Throws Error if the manifest has no voxel size, and
// the errors of make_map_raster.
libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m);

// Writes the raster to `output`, which must be claimed. The run's manifest must already have frame,
// transforms and inputs; if the raster is in a CRS, the transforms are removed.
void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run);

}  // namespace graspmap_tools
