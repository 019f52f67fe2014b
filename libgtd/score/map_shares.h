// Checks and joins shares of a map: files that several runs of `graspmap score --tile K/N` wrote.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/manifest.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Returns true if the manifest describes one of several shares.
bool is_map_share(const libmap::Manifest& manifest);

// Throws Error naming one of `files` unless they are all shares of one map, each exactly once.
void require_shares_of_one_map(const std::vector<libmap::Manifest>& manifests,
                               const std::vector<std::string>& files);

// Copies common content of all shares to the manifest of the whole map: parameters, frame,
// transforms, and results such as the plane's.
void copy_common_entries(const libmap::Manifest& part, libmap::Manifest& whole);

// Adds obstacles to the merged map `whole` with the parameters of a share, and returns the number
// of obstacle points. Throws like add_obstacles.
std::size_t add_obstacles_of(const libmap::Manifest& part, libmap::PointCloud& whole);

// Returns the number of points with field `flag` equal to 1; 0 if the map has no such field.
std::int64_t count_set(const libmap::PointCloud& map, const char* flag);

}  // namespace libgtd
