// Laser scans as RTAB-Map stores them with a node.
#pragma once

#include <string_view>

namespace libmap {

// `scan` is a compressed matrix of float32, a point a column; `info` 76, 60 or 56 bytes of float32
// (0.18.0 on, 0.16.1 to 0.17, 0.11.10 to 0.16.0), or empty before. Where the format is not stored,
// the number of channels says it. Throws Error unless they fit each other and are whole.
void check_laser_scan(std::string_view scan, std::string_view info);

}  // namespace libmap
