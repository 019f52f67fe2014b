// Reads digital elevation models (DEM) from GeoTIFF files in blocks, by GDAL.
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

// True if the extension is .tif or .tiff, in any case.
bool is_dem_path(const std::filesystem::path& path);

struct DemInfo {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  std::string band_type;      // GDAL's type of the height band, e.g. "Float32"
  Georeference georeference;  // of the local frame: x east, y north, z up, m
  // Maps (column, row, 1) to local x and y, m; the center of the first pixel is (0.5, 0.5). It can
  // be any invertible affine transform, also rotated, sheared or mirrored.
  Eigen::Matrix<double, 2, 3> local_from_pixel = Eigen::Matrix<double, 2, 3>::Zero();

  std::uint64_t pixels() const { return static_cast<std::uint64_t>(columns * rows); }
};

// A window of pixels in row-major order.
struct DemBlock {
  std::int64_t column = 0;  // first column
  std::int64_t row = 0;     // first row
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  // Local heights; NaN for nodata. -infinity for customary nodata values that the file does not
  // declare (-9999, -99999, -999999, -32767, -32768), if heights are in m without scale or offset.
  std::vector<double> heights_m;
};

// Reads a file sequentially in blocks: one tile or strip of the file, or several small ones with
// about 65536 pixels. Memory is proportional to a block. GDAL runs in a child process.
//
// The height band is the band named height, elevation, dem, dsm, dtm or z, else the only band.
// Scale, offset, unit (m, ft, us-ft), nodata and mask of the band are applied. The local origin is
// the origin of `frame`, else x and y of the raster's center rounded to 1000 m, and the first
// height rounded to 100 m. Files next to the DEM (.tfw, .aux.xml) are ignored.
//
// Throws Error naming the file if it is not a GeoTIFF or damaged; has no affine transform, or a
// geographic or geocentric CRS; has no height band, or one of 8 bits or complex numbers; has more
// than 2^33 pixels or blocks of more than 2^24; has heights beyond 1e6 m; has another CRS than
// `frame`; or if graspmap was built without GDAL (failed).
class DemReader {
 public:
  // Positions are in the local frame of `frame`, else in that of the file.
  explicit DemReader(const std::filesystem::path& path,
                     const std::optional<Georeference>& frame = std::nullopt);
  ~DemReader();
  DemReader(DemReader&&) noexcept;

  // Properties of the whole raster by the header.
  const DemInfo& info() const;
  // Reads the next block. Returns false after the last one.
  bool next(DemBlock& block);

 private:
  class Process;
  std::unique_ptr<Process> process_;
};

// Returns the local position, m, of the center of a pixel; `pixel` is the index in the block.
Eigen::Vector3d point_of(const DemInfo& info, const DemBlock& block, std::size_t pixel);

// Reads a DEM as a cloud of the centers of pixels with a height, in the order of blocks, in
// the local frame of `frame`, else in that of the file. Adds to
// `undeclared` the number of pixels whose height is -infinity in DemBlock. Throws as DemReader
// does, and if the points need more than half of the machine's memory.
PointCloud read_dem_cloud(const std::filesystem::path& path, std::size_t* undeclared = nullptr,
                          const std::optional<Georeference>& frame = std::nullopt);

// Returns the georeference of a DEM, of the first DEM in a folder (in the order of names), or of
// another output by the manifest; nullopt if there is none.
std::optional<Georeference> read_georeference(const std::filesystem::path& path);

// Reads a DEM as a mesh. Vertices are the centers of pixels with a height, in row-major order. Four
// neighbors form two triangles, split along the diagonal with the smaller height difference; three
// form one. Normals point up. Throws as DemReader does, and if it needs half of the memory.
TriangleMesh read_dem_mesh(const std::filesystem::path& path);

}  // namespace libmap
