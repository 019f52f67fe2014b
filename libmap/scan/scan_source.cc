#include "libmap/scan/scan_source.h"

#include <algorithm>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/joined_scan.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"

namespace libmap {

namespace {

std::vector<std::filesystem::path> databases_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> databases;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".db" && entry.is_regular_file())
      databases.push_back(entry.path());
  std::sort(databases.begin(), databases.end());
  return databases;
}

}  // namespace

std::unique_ptr<ScanSource> open_scan(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    const std::vector<std::filesystem::path> databases = databases_in(path);
    return databases.empty() ? open_frame_folder(path) : open_scans(databases);
  }
  require_readable_file(path);
  if (std::filesystem::file_size(path) == 0)
    throw Error("is empty: 0 bytes", {.file = path.string()});
  if (!is_sqlite_file(path))
    throw Error("is no scan: neither a database of RTAB-Map nor a folder of images",
                {.file = path.string()});
  return std::make_unique<RtabmapDatabase>(path);
}

}  // namespace libmap
