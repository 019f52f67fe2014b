// `graspmap compare SITE --edges`: height errors along the four edges of a site.
#pragma once

namespace graspmap_tools {

int compare_edges(int argc, char** argv);

}  // namespace graspmap_tools
