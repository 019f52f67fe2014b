// Nodes, links and optimized poses of an RTAB-Map database.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/rtabmap_schema.h"

namespace libmap {

class SqliteFile;

struct RtabmapGraph {
  PoseGraph graph;
  // What was left out, and why: nodes and links that cannot be used, poses that are broken. At most
  // 100, then how many more.
  std::vector<std::string> warnings;
};

// Each link once: where both directions are stored, the one from the lower node; where one is, that
// one. Throws Error naming the file.
RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns);

}  // namespace libmap
