// Shares of a map in files of their own, as `graspmap score --tile K/N` writes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/manifest.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Whether the manifest is that of one of several shares.
bool is_map_share(const libmap::Manifest& manifest);

// Throws Error naming one of `files`, unless they are all shares of one map, each once.
void require_shares_of_one_map(const std::vector<libmap::Manifest>& manifests,
                               const std::vector<std::string>& files);

// Parameters, frame, transforms and those results of a share or tile that the whole map has, too.
void copy_common_facts(const libmap::Manifest& part, libmap::Manifest& whole);

// Adds obstacles with the parameters of a share, and returns their number.
std::size_t add_obstacles_of(const libmap::Manifest& part, libmap::PointCloud& whole);

// Points whose flag is set.
std::int64_t count_set(const libmap::PointCloud& map, const char* flag);

}  // namespace libgtd
