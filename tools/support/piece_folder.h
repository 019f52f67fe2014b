// Outputs that are folders of pieces.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/plan_tiles.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// What an output's help says of them.
inline constexpr const char* or_piece_folder = ", or a folder of pieces (no extension)";

// Whether the output is one: its name has no extension.
inline bool is_piece_folder(const std::string& output) {
  return std::filesystem::path(without_trailing_slash(output)).extension().empty();
}

// The names that it may hold: of an earlier run's pieces, and of those to come.
inline std::vector<std::string> piece_folder_names(
    const std::string& output, const std::vector<std::filesystem::path>& pieces = {},
    const std::string& extension = {}) {
  std::vector<std::string> names = libmap::piece_file_names(output);
  for (const std::filesystem::path& piece : pieces)
    names.push_back(piece.stem().string() + extension);
  return names;
}

}  // namespace graspmap_tools
