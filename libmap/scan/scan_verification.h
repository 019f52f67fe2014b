// Verifies a scan: decodes all stored data and lists the faults.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Checks a laser scan of an RTAB-Map database. `scan` is a compressed matrix of float32 with one
// column per point. `info` is an array of float32: 76 bytes (since version 0.18.0), 60 (0.16.1 to
// 0.17), 56 (0.11.10 to 0.16.0), or empty before. If `info` has no format, 2 to 7 channels are
// valid. Throws Error if `scan` or `info` is damaged, or they are inconsistent.
void check_laser_scan(std::string_view scan, std::string_view info);

struct ScanFault {
  int node = 0;          // 0: the whole file
  std::string part{};    // table and column, e.g. "Data.depth"; or "frame", "graph" or "file"
  std::string reason{};  // message of the error
};

struct ScanVerificationResult {
  std::size_t nodes = 0;            // nodes whose frames were checked
  std::size_t blobs = 0;            // checked blobs of an RTAB-Map database; 0 for other scans
  std::uint64_t bytes = 0;          // total size of the checked blobs
  std::vector<ScanFault> faults{};  // ascending by node, part and reason
};

// Decodes all blobs of all tables of an RTAB-Map database and checks SQLite's integrity, or decodes
// all frames of another scan. Each thread has one node's images in memory. The scan's warnings are
// faults too, except on tables and columns of a later version. Faults do not throw.
ScanVerificationResult verify_scan(const ScanSource& scan, Progress& progress = no_progress());

}  // namespace libmap
