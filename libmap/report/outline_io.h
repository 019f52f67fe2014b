// Outlines of reports from YAML files.
#pragma once

#include <filesystem>
#include <string>

#include "libmap/report/outline.h"

namespace libmap {

// Throws Error naming `file`, the line and the key: no YAML, a key that is not known (with the
// nearest known one), an item without a kind or with two, something of another type.
Outline parse_outline(const std::string& yaml, const std::string& file);
Outline read_outline(const std::filesystem::path& path);

}  // namespace libmap
