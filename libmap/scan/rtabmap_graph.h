// Reader of the nodes, links and optimized poses of an RTAB-Map database.
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
  // Dropped nodes, links and poses with the reason; at most 100, then the number of further ones.
  std::vector<std::string> warnings;
};

// Reads the graph. Each link is contained once; if both directions are stored, the one from the
// lower node. Throws Error naming the file if a table cannot be read.
RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns);

}  // namespace libmap
