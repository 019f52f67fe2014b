// `graspmap convert SCAN -o FOLDER`: a scan as plain files, for MeshLab (Bundler) or for COLMAP.
#pragma once

#include <string>

namespace graspmap_tools {

// A database, or a folder of frames.
bool is_scan_path(const std::string& path);

int convert_scan(int argc, char** argv);

}  // namespace graspmap_tools
