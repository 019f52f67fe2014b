// Describes scans and camera files as JSON, for `graspmap info`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_verification.h"

namespace graspmap_tools {

// Returns true for *.db, a folder or an SQLite file: kinds of paths that can be scans.
bool may_be_scan(const std::string& path);

struct ScanInfo {
  nlohmann::ordered_json json;
  std::vector<libmap::ScanFault> faults;  // found with `verify`
};
// Return the description of a camera file and of a scan. Throw Error if the file cannot be read.
// `verify` checks all data of the scan and lists the faults.
nlohmann::ordered_json camera_info(const std::string& path);
ScanInfo scan_info(const std::string& path, bool verify, libmap::Progress& progress);

}  // namespace graspmap_tools
