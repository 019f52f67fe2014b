// Describes scans and camera files as JSON, for `graspmap info`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_verification.h"

namespace graspmap_tools {

// Returns true for a path that can be a scan: a name ending in .db, a folder or an SQLite file.
bool may_be_scan(const std::string& path);

struct ScanInfo {
  nlohmann::ordered_json json;
  std::vector<libmap::ScanFault> faults;  // damaged data; empty without `verify`
};
// Return the description of a camera file and of a scan. Throw Error if the file cannot be read.
// With `verify`, scan_info reads all data of the scan and lists the damaged data.
nlohmann::ordered_json camera_info(const std::string& path);
ScanInfo scan_info(const std::string& path, bool verify, libmap::Progress& progress);

}  // namespace graspmap_tools
