// What `graspmap info` says of a scan.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_verification.h"

namespace graspmap_tools {

// Whether the path can only be a scan: *.db, a folder, or an SQLite file.
bool may_be_scan(const std::string& path);

struct ScanInfo {
  nlohmann::ordered_json json;
  std::vector<libmap::ScanFault> faults;  // found with `verify`
};
// Of a camera file.
nlohmann::ordered_json camera_info(const std::string& path);
ScanInfo scan_info(const std::string& path, bool verify, libmap::Progress& progress);

}  // namespace graspmap_tools
