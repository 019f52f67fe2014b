// Scenes of primitive shapes as YAML:
//
//   shapes:
//     - {shape: plane, size_x_m: 3, size_y_m: 3}
//     - {shape: sphere, name: a hemisphere, radius_m: 0.25, x_m: -1, y_m: -1}
//
// Each entry has `shape`, all sizes of its kind, and as it needs them `name`, x_m, y_m, z_m,
// roll_deg, pitch_deg, yaw_deg (0) and a bump's `profile` (cosine).
#pragma once

#include <filesystem>
#include <string>

#include "libmap/simulate/primitive_scene.h"

namespace libmap {

// Throws Error naming `file`, the entry, the key, the value and the bound, and for unknown keys and
// shapes the nearest known one.
PrimitiveScene parse_scene(const std::string& text, const std::string& file);
PrimitiveScene load_scene(const std::filesystem::path& path);

}  // namespace libmap
