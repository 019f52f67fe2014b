// Reader and writer of cloud files. The extension (upper or lower case) selects the format.
//
//          fields and their types   viewpoint   encodings
//   .pcd   all                      yes         ascii, binary, binary_compressed
//   .ply   all                      comment     ascii, binary (little- or big-endian)
//   .vtp   all                      field data  ascii, binary, binary_compressed (zlib); not read
//   .csv   all, without types       no          text
//   .tif   DEM, read as the centers of its pixels; not written (see libmap/raster)
//
// Coordinates are doubles in memory. They are written as float32, or as float64 if float32 would
// move a coordinate by more than 1e-5 m; normals as float32, colors as three bytes, fields in their
// type. CSV has a header line and columns x y z, optionally nx ny nz and red green blue. Its
// columns of integers are read as int32, others as float64, empty cells as NaN. A float32 is
// written to CSV with the fewest digits that parse to the same float32. The float64 that is read
// from these digits can differ from the float32 by half a unit of the last digit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/point_cloud.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

struct CloudReadResult {
  PointCloud cloud;
  std::size_t dropped_points = 0;  // points that are not finite; in DEMs also -9999 etc. (DemBlock)
  GeometryFileInfo info;
};

// Returns the file itself, or the cloud files of a folder in the order of names, without hidden
// files. Throws Error if the file is missing or not a cloud, or the folder contains no cloud file
// or both DEMs and other clouds.
std::vector<std::filesystem::path> cloud_tiles(const std::filesystem::path& file_or_folder);

// Reads a file, or all files of a folder into one cloud with the info of the last file. A file
// without points is an empty cloud. A DEM is read in the local frame of `frame`, by default in its
// own local frame; all DEMs of a folder are read in the local frame of the first DEM. Throws Error
// naming the file if it cannot be read, is invalid or truncated, has no fields x, y and z, or if
// only some files of a folder are DEMs.
CloudReadResult read_cloud(const std::filesystem::path& path,
                           const std::optional<Georeference>& frame = std::nullopt);

// Reads the header only, except for CSV, which is read completely. Throws as read_cloud does.
GeometryFileInfo read_cloud_info(const std::filesystem::path& path);

// Writes directly to `path`; for atomic output, pass the temporary path of an OutputFile. Throws
// Error for an unknown extension, or a field name that the format cannot store or that would be
// read back as a position, normal or color. Throws Error (failed) if the write fails.
void write_cloud(const std::filesystem::path& path, const PointCloud& cloud,
                 const GeometryWriteOptions& options = {});

// Throws Error unless the extension is a format that write_cloud supports.
void require_cloud_format(const std::filesystem::path& path);

// Throws Error unless `path` is a readable file of a format that read_cloud supports.
void require_cloud_file(const std::filesystem::path& path);

// Throws Error with the readable formats if `path` is a .vtp file, which can be written only.
void refuse_vtp(const std::filesystem::path& path);

// Returns the extension in lower case, e.g. ".ply".
std::string format_of(const std::filesystem::path& path);

// Returns the first MiB of a file, or all of a shorter file. Headers of valid files are shorter.
std::string read_head(const std::filesystem::path& path);

// Returns the content of a file. Throws Error if it is missing, a folder, unreadable or empty.
std::shared_ptr<const std::string> read_geometry_bytes(const std::filesystem::path& path);

// Creates the file `path` and calls write(stream). Adds `path` to Errors of `write`. Throws Error
// (failed) if the file was not written completely.
void write_geometry_file(const std::filesystem::path& path,
                         const std::function<void(std::ostream&)>& write);

struct PcdPartsOptions {
  std::uint64_t points = 1;        // number of points of all parts, at least 1
  bool float64_positions = false;  // need_float64(all points), cloud_columns.h; false: float32
};

// Writes a binary PCD part by part, so that only one part is in memory. The file is identical to
// that of write_cloud for one cloud of all parts. All functions can throw Error (failed).
class PcdPartsWriter {
 public:
  // Creates the file and writes directly to it, as write_cloud does.
  PcdPartsWriter(std::filesystem::path path, const PcdPartsOptions& options);

  // Appends a part; empty parts are skipped. Throws Error if fields, normals, colors or viewpoint
  // differ from the first part, or if the parts have more than `points` points.
  void append(const PointCloud& part);
  // Closes the file after the last part. Throws Error if the parts have fewer than `points` points.
  void finish();

 private:
  void require_good() const;

  std::filesystem::path path_;
  PcdPartsOptions options_;
  std::ofstream file_;
  std::string header_;  // empty before the first part
  std::uint64_t written_ = 0;
};

}  // namespace libmap
