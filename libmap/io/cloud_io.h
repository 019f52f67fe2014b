// Clouds from and to files. The extension, in any case, says the format: .pcd .ply .vtp .csv.
//
//          fields and their types   viewpoint   encodings
//   .pcd   all                      yes         ascii, binary, binary_compressed
//   .ply   all                      comment     ascii, binary (little- or big-endian)
//   .vtp   all                      field data  ascii, binary, binary_compressed (zlib); not read
//   .csv   all, without types       no          text
//   .tif   not written (a map: libmap/raster); a DEM is read as the centers of its pixels
//
// Coordinates are doubles in memory. They are written as float32 unless that moves some coordinate
// by more than 1e-5 m, then as float64; normals as float32, colors as three bytes, integers as
// their type. CSV: a header line; columns x y z, optionally nx ny nz and red green blue; a column
// of integers is read as int32, any other as float64, an empty cell as NaN. Its numbers are the
// shortest that read back as the float32 written; as doubles they may differ from it by half a unit
// of its last digit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

struct CloudReadResult {
  PointCloud cloud;
  std::size_t dropped_points = 0;  // those with a position that is NaN or infinite
  GeometryFileInfo info;
};

// The file itself, or the cloud files of a folder in the order of their names; hidden files are
// passed over. Throws Error: nothing there, or a folder without a cloud file.
std::vector<std::filesystem::path> cloud_pieces(const std::filesystem::path& file_or_folder);

// Of a folder all pieces together, and the last one's info. Throws Error naming the file: it cannot
// be read, is not of its format, promises more than it holds, or has no fields x, y and z. A file
// of no points is an empty cloud.
CloudReadResult read_cloud(const std::filesystem::path& path);

// The same of the header alone where the format has one (PCD, PLY); CSV is read whole.
GeometryFileInfo read_cloud_info(const std::filesystem::path& path);

// Writes straight to `path`; callers that need the file whole or not at all pass an OutputFile's
// temporary path. Throws Error: unknown extension, a field's name that the format cannot hold or
// that would be read back as something else, a failed write (ErrorKind::failed).
void write_cloud(const std::filesystem::path& path, const PointCloud& cloud,
                 const GeometryWriteOptions& options = {});

// Throws Error unless clouds are written in the format that the extension names.
void require_cloud_format(const std::filesystem::path& path);

// Throws Error unless `path` is a readable file of a format that clouds are read from.
void require_cloud_file(const std::filesystem::path& path);

// Throws Error, with the formats that can be read, for a .vtp file: VTP is written only.
void refuse_vtp(const std::filesystem::path& path);

// The extension in lower case, e.g. ".ply".
std::string format_of(const std::filesystem::path& path);

// The file's first MiB: more than any header.
std::string read_head(const std::filesystem::path& path);

// The file's bytes, for the codecs. Throws Error: no such file, a folder, not readable, empty.
std::shared_ptr<const std::string> read_geometry_bytes(const std::filesystem::path& path);

// Opens `path`, calls write(stream) and sees that all of it was written; names the file in Errors.
void write_geometry_file(const std::filesystem::path& path,
                         const std::function<void(std::ostream&)>& write);

struct PcdPartsOptions {
  std::uint64_t points = 1;        // of all parts together, at least 1
  bool float64_positions = false;  // else float32: what write_cloud would choose for the whole
};

// A binary PCD written part by part, so that no more than one part is in memory. The file is that
// of write_cloud for all parts in one cloud, byte for byte.
class PcdPartsWriter {
 public:
  // Writes straight to `path`, as write_cloud does. Throws Error (failed).
  PcdPartsWriter(std::filesystem::path path, const PcdPartsOptions& options);

  // All parts have the fields of the first, and normals and colors if it has; empty ones are
  // passed over. Throws Error: one has others, more points than promised, a failed write
  // (ErrorKind::failed).
  void append(const PointCloud& part);
  // After the last part. Throws Error: fewer points than promised, a failed write.
  void finish();

 private:
  void require_good() const;

  std::filesystem::path path_;
  PcdPartsOptions options_;
  std::ofstream file_;
  std::string header_;  // once the first part is written
  std::uint64_t written_ = 0;
};

}  // namespace libmap
