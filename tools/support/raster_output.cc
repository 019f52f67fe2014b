#include "tools/support/raster_output.h"

#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

namespace graspmap_tools {

namespace {

// Direction of columns: the lattice's x or y axis, whichever is nearer to horizontal.
Eigen::Vector2d column_axis_of(const Eigen::Matrix3d& frame_from_lattice) {
  const Eigen::Vector2d x = frame_from_lattice.col(0).head<2>();
  const Eigen::Vector2d y = frame_from_lattice.col(1).head<2>();
  return x.norm() >= y.norm() ? x.normalized() : Eigen::Vector2d(y.y(), -y.x()).normalized();
}

}  // namespace

libmap::MapRaster raster_of(const libmap::CloudParts& parts, const libmap::Manifest& manifest,
                            double pixel_size_m) {
  libmap::RasterGrid grid;
  grid.pixel_size_m = pixel_size_m;
  if (manifest.georeference)
    grid.frame_from_points =
        site_from_map_of(manifest).value_or(libmap::Pose::Identity()).inverse();
  if (const auto index = index_of(manifest)) {
    if (pixel_size_m == 0.0) grid.pixel_size_m = index->lattice.voxel_size_m;
    const libmap::Pose frame_from_lattice =
        grid.frame_from_points * terrain_from_map(manifest).inverse();
    grid.column_axis = column_axis_of(frame_from_lattice.linear());
    grid.corner_m = (frame_from_lattice * index->lattice.origin_m).head<2>();
  }
  if (grid.pixel_size_m == 0.0)
    throw libmap::Error("is required, because the manifest of the input has no voxel size",
                        {.field = "--pixel-size"});
  libmap::MapRaster raster = libmap::make_map_raster(parts, grid);
  if (manifest.georeference) raster.georeference = *manifest.georeference;
  return raster;
}

void write_raster(const std::string& output, const libmap::MapRaster& raster, Run& run) {
  libmap::Manifest& manifest = run.manifest();
  if (manifest.georeference) {
    manifest.frame = "input";
    manifest.transforms.clear();
  }
  run.add_results({{"columns", raster.columns}, {"rows", raster.rows}});
  run.info("{} x {} pixels, {} bands", raster.columns, raster.rows, 1 + raster.bands.size());
  run.write_output(output,
                   [&](const auto& temporary) { libmap::write_map_raster(temporary, raster); });
}

}  // namespace graspmap_tools
