// Verification of a scan: decodes all stored data and lists the faults.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Checks a laser scan. `scan` is a compressed matrix of float32 with one column per point; `info`
// is 76, 60 or 56 bytes of float32 (from 0.18.0, 0.16.1 to 0.17, 0.11.10 to 0.16.0), or empty
// before. If the format is not stored, the number of channels determines it. Throws Error if `scan`
// and `info` are truncated or inconsistent.
void check_laser_scan(std::string_view scan, std::string_view info);

struct ScanFault {
  int node = 0;        // 0: the whole file
  std::string part{};  // table and column, e.g. "Data.depth"
  std::string reason{};
};

struct ScanVerificationResult {
  std::size_t nodes = 0;            // nodes with decoded frames
  std::size_t blobs = 0;            // decoded blobs of a database, without NULLs
  std::uint64_t bytes = 0;          // total size of the blobs
  std::vector<ScanFault> faults{};  // by node, then by part
};

// Verifies all blobs of all tables of a database, with SQLite's integrity check, or all frames of
// another scan. Each thread has one node's images in memory. Data that the graph dropped
// (warnings()) are faults too, except tables and columns of a later version. Throws Error if the
// file cannot be read further; faults do not throw.
ScanVerificationResult verify_scan(const ScanSource& scan, Progress& progress = no_progress());

}  // namespace libmap
