// Digital elevation models (DEM) from GeoTIFF files, in blocks, by GDAL.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Whether the extension is .tif or .tiff, in any case.
bool is_dem_path(const std::filesystem::path& path);

struct DemInfo {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  std::string band_type;  // as GDAL names it, e.g. "Float32"
  Georeference georeference;
  // Local x and y, m, of (column, row, 1); the center of the first pixel is at (0.5, 0.5). Any
  // affine transform with an area: rotated, sheared or mirrored.
  Eigen::Matrix<double, 2, 3> local_from_pixel = Eigen::Matrix<double, 2, 3>::Zero();

  std::uint64_t pixels() const { return static_cast<std::uint64_t>(columns * rows); }
};

// A window of pixels, row by row.
struct DemBlock {
  std::int64_t column = 0;
  std::int64_t row = 0;
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  // Local; NaN where the DEM has none, -infinity where only custom says so: -9999, -99999, -999999,
  // -32767, -32768, not declared as nodata.
  std::vector<double> heights_m;
};

// Reads one file from its first block to its last: memory is proportional to a block (a tile, or
// strips of at least 65536 pixels). GDAL runs in a process of its own.
//
// The height band is the one that is called height, elevation, dem, dsm, dtm or z, else the only
// band. Its scale, offset, unit (m or ft), nodata value and mask are applied. The local origin is
// that of `frame` or, without one, the center of the raster to the nearest km, and the first height
// to the nearest 100 m: zero for small coordinates. Only what is inside the file counts: no .tfw,
// no .aux.xml.
//
// Throws Error naming the file: it is no GeoTIFF or damaged; it has no affine transform, or a
// geographic CRS (degrees); no height band, or one of 8 bits or of complex numbers; more than 2^33
// pixels or blocks of more than 2^24; heights beyond 1e6 m; a CRS other than that of `frame`; or
// graspmap was built without GDAL (failed).
class DemReader {
 public:
  // Heights in the frame of `frame`, or in one of the file's own.
  explicit DemReader(const std::filesystem::path& path,
                     const std::optional<Georeference>& frame = std::nullopt);
  ~DemReader();
  DemReader(DemReader&&) noexcept;

  // Of the whole raster, as its header says.
  const DemInfo& info() const;
  // False after the last block.
  bool next(DemBlock& block);

 private:
  class Process;
  std::unique_ptr<Process> process_;
};

// Local position of the center of a pixel, by its number in the block.
Eigen::Vector3d point_of(const DemInfo& info, const DemBlock& block, std::size_t pixel);

// The DEM as a cloud: the centers of pixels that have a height, block by block. Counts undeclared
// nodata. Throws as DemReader, and if there is not enough memory for the points.
PointCloud read_dem_cloud(const std::filesystem::path& path, std::size_t* undeclared = nullptr);

// The georeference of a DEM, of the first DEM in a folder (in the order of names), or of any other
// output by the manifest beside it; nothing if there is none.
std::optional<Georeference> read_georeference(const std::filesystem::path& path);

// Vertices are the centers of pixels that have a height, row by row; four neighbors make two
// triangles, split along the diagonal with the smaller step of height, three make one. Normals
// point up. Throws Error as DemReader, and if there is not enough memory.
TriangleMesh read_dem_mesh(const std::filesystem::path& path);

}  // namespace libmap
