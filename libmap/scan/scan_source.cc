#include "libmap/scan/scan_source.h"

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

std::unique_ptr<ScanSource> open_scan(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) return open_frame_folder(path);
  require_readable_file(path);
  if (std::filesystem::file_size(path) == 0)
    throw Error("is empty: 0 bytes", {.file = path.string()});
  if (!is_sqlite_file(path))
    throw Error("is no scan: neither a database of RTAB-Map nor a folder of images",
                {.file = path.string()});
  return std::make_unique<RtabmapDatabase>(path);
}

}  // namespace libmap
