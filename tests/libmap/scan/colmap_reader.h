// COLMAP's text models as our own writer leaves them, read back.
#pragma once

#include <filesystem>

#include "libmap/poses/colmap_io.h"

namespace graspmap_test {

// The folder that find_colmap_model finds.
libmap::ColmapModel read_colmap_model(const std::filesystem::path& path);

}  // namespace graspmap_test
