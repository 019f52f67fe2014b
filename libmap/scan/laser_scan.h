// Laser scans as RTAB-Map stores them with a node.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace libmap {

// RTAB-Map's numbers.
enum class LaserScanFormat {
  unknown = 0,
  xy = 1,
  xy_intensity = 2,
  xy_normal = 3,
  xy_intensity_normal = 4,
  xyz = 5,
  xyz_intensity = 6,
  xyz_rgb = 7,
  xyz_normal = 8,
  xyz_intensity_normal = 9,
  xyz_rgb_normal = 10,
  xyz_intensity_time = 11,
  xyz_intensity_ring_time = 12
};
std::string to_text(LaserScanFormat format);
int channels_of(LaserScanFormat format);  // 0 where unknown

struct LaserScan {
  LaserScanFormat format = LaserScanFormat::unknown;
  int max_points = 0;
  // 0 where not stored.
  double range_min_m = 0.0;
  double range_max_m = 0.0;
  double angle_min_rad = 0.0;
  double angle_max_rad = 0.0;
  double angle_increment_rad = 0.0;
  Pose base_from_scan = Pose::Identity();
  // In the scan's frame; z is 0 in flat scans. Fields "intensity", "ring", "time" as stored.
  PointCloud points;
  std::size_t dropped_points = 0;  // that are not finite
};

// `scan` is a compressed matrix of float32, a point a column; `info` 76, 60 or 56 bytes of float32
// (0.18.0 on, 0.16.1 to 0.17, 0.11.10 to 0.16.0), or empty before. Where the format is not stored,
// the number of channels says it. Throws Error.
LaserScan decode_laser_scan(std::string_view scan, std::string_view info);

}  // namespace libmap
