// Shared code of the fuzz targets.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/manifest.h"
#include "tests/fuzz/fuzz_targets.h"

namespace graspmap_fuzz {

using Seeds = std::vector<std::string>;

std::vector<FuzzTarget> scan_targets();
std::vector<FuzzTarget> cloud_targets();
std::vector<FuzzTarget> mesh_targets();
std::vector<FuzzTarget> text_targets();
std::vector<FuzzTarget> map_targets();
std::vector<FuzzTarget> feature_targets();
std::vector<FuzzTarget> bag_targets();

// File name in errors.
inline constexpr const char* file_name = "bytes";

// Returns true if `read` completed.
template <typename Read>
bool accepts(const Read& read) {
  try {
    read();
    return true;
  } catch (const libmap::Error&) {
    return false;
  }
}

// Calls all readers. Returns true if at least one completed.
template <typename... Reads>
bool any_accepts(const Reads&... reads) {
  bool any = false;
  ((any = accepts(reads) || any), ...);
  return any;
}

// For several formats in one target: takes the first byte and returns it modulo `count` (0 without
// a byte). with_choice prepends this byte.
std::size_t take_choice(std::string_view& bytes, std::size_t count);
std::string with_choice(std::size_t choice, const std::string& bytes);

// Takes the first file from `bytes`, an input of several files separated by form feeds.
std::string_view take_file(std::string_view& bytes);

// Returns the content that `write` writes to a file of this name.
std::string written(const std::string& name,
                    const std::function<void(const std::filesystem::path&)>& write);

// Adds the files of data/KIND, each with_choice, ascending by name.
void add_data(Seeds& seeds, std::size_t choice, const std::string& kind);

libmap::Manifest small_manifest();

}  // namespace graspmap_fuzz
