// Several scans as one, such as those of different days: each session stays in a frame of its own.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "libmap/scan/scan_source.h"

namespace libmap {

// Nodes of the n-th scan, from 0, are numbered n * step higher, where step is the lowest power of
// ten above all numbers: node 12 of the second of two small scans is 112. Sessions and landmarks
// are told apart in the same way; optimized poses are left out, since each scan's are in another
// frame. A single scan is returned as it is. Throws Error: no scan, too large numbers, or the same
// file twice.
std::unique_ptr<ScanSource> join_scans(std::vector<std::unique_ptr<ScanSource>> scans);

// Opens and joins all; of one path as open_scan does.
std::unique_ptr<ScanSource> open_scans(const std::vector<std::filesystem::path>& paths);

}  // namespace libmap
