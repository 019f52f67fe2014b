// Reader of COLMAP's text models as written by this project.
#pragma once

#include <filesystem>

#include "libmap/poses/colmap_io.h"

namespace graspmap_test {

// Reads the folder returned by find_colmap_model.
libmap::ColmapModel read_colmap_model(const std::filesystem::path& path);

}  // namespace graspmap_test
