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

// True if the extension is .tif or .tiff, in upper or lower case.
bool is_dem_path(const std::filesystem::path& path);

struct DemInfo {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  std::string band_type;      // GDAL's type of the height band, e.g. "Float32"
  Georeference georeference;  // of the local frame: x east, y north, z up, m
  // Maps (column, row, 1) to local x and y, m; the center of the first pixel is (0.5, 0.5). The
  // transform is affine and invertible, possibly with rotation, shear or reflection.
  Eigen::Matrix<double, 2, 3> local_from_pixel = Eigen::Matrix<double, 2, 3>::Zero();

  std::uint64_t pixels() const { return static_cast<std::uint64_t>(columns * rows); }
};

// A window of pixels in row-major order.
struct DemBlock {
  std::int64_t column = 0;  // first column
  std::int64_t row = 0;     // first row
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  // Local heights, m. NaN: nodata. -infinity: undeclared nodata, i.e. -9999, -99999, -999999,
  // -32767 or -32768 in a file in meters that has neither scale nor offset.
  std::vector<double> heights_m;
};

// Reads a file in blocks, one after another: strips or tiles of the file, or several small ones
// with about 65536 pixels. Memory is proportional to a block. GDAL runs in a child process.
//
// The height band is the first band named height, elevation, dem, dsm, dtm or z, else the only
// band. Scale, offset, unit (m, ft, us-ft), nodata and mask of the band are applied. The local
// origin is that of `frame`; by default, it is the raster's center rounded to 1000 m in x and y,
// and the first height rounded to 100 m in z. Files next to the DEM (.tfw, .aux.xml) are ignored.
//
// The constructor and next() throw Error naming the file if
//   - the file is not a GeoTIFF, is damaged, or has no affine transform;
//   - its CRS is geographic or geocentric, or differs from the CRS of `frame`;
//   - it has no height band, or a height band of 8 bits or of complex numbers;
//   - it has more than 2^33 pixels, or a strip or tile of more than 2^24 pixels;
//   - the absolute value of a height exceeds 1e6 m.
// The constructor throws Error (failed) if graspmap was built without GDAL.
class DemReader {
 public:
  // Opens the file and reads its properties.
  explicit DemReader(const std::filesystem::path& path,
                     const std::optional<Georeference>& frame = std::nullopt);
  ~DemReader();
  DemReader(DemReader&&) noexcept;

  const DemInfo& info() const;  // properties of the whole raster
  // Reads the next block. Returns false if no block is left.
  bool next(DemBlock& block);

 private:
  class Process;
  std::unique_ptr<Process> process_;
};

// Returns the local position, m, of a pixel's center; `pixel` is the index in block.heights_m.
Eigen::Vector3d point_of(const DemInfo& info, const DemBlock& block, std::size_t pixel);

// Reads a DEM as a cloud of the centers of pixels with a height, in the order of blocks, in the
// frame of DemReader(path, frame). Adds the number of pixels with undeclared nodata (DemBlock) to
// *undeclared. Throws as DemReader does, and if the points need over half of the machine's memory.
PointCloud read_dem_cloud(const std::filesystem::path& path, std::size_t* undeclared = nullptr,
                          const std::optional<Georeference>& frame = std::nullopt);

// Returns the georeference of a DEM, of the first DEM in a folder (in the order of names), or, for
// other files and folders, the georeference in the manifest; nullopt if there is none.
std::optional<Georeference> read_georeference(const std::filesystem::path& path);

// Reads a DEM as a mesh. Vertices are the centers of pixels with a height, in row-major order. Four
// neighbors form two triangles, split along the diagonal with the smaller height difference; three
// neighbors form one triangle. Triangles are counter-clockwise from above. Throws as DemReader
// does, and if the mesh needs over half of the machine's memory or has 2^32 - 1 pixels or more.
TriangleMesh read_dem_mesh(const std::filesystem::path& path);

}  // namespace libmap
