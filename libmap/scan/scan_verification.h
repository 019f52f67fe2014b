// Everything that a scan stores, decoded to find what is broken.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// `scan` is a compressed matrix of float32, a point a column; `info` 76, 60 or 56 bytes of float32
// (0.18.0 on, 0.16.1 to 0.17, 0.11.10 to 0.16.0), or empty before. Where the format is not stored,
// the number of channels says it. Throws Error unless they fit each other and are whole.
void check_laser_scan(std::string_view scan, std::string_view info);

struct ScanFault {
  int node = 0;        // 0: of the whole file
  std::string part{};  // table and column, e.g. "Data.depth"
  std::string reason{};
};

struct ScanVerificationResult {
  std::size_t nodes = 0;            // whose frames were decoded
  std::size_t blobs = 0;            // decoded, of a database; NULLs are not counted
  std::uint64_t bytes = 0;          // in them
  std::vector<ScanFault> faults{};  // by node, then by part
};

// In parallel, one node's images a thread in memory. Of a database every blob of every table, and
// SQLite's own check of the file; of any other scan every frame. What the scan's graph had to
// leave out (warnings()) is a fault too, but for tables and columns of a later version. A fault is
// no Error; Error means that the file cannot be read any further.
ScanVerificationResult verify_scan(const ScanSource& scan, Progress& progress = no_progress());

}  // namespace libmap
