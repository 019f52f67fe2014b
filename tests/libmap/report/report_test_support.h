// Files of a run for the tests of its report.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/manifest.h"
#include "tests/support/test_support.h"

namespace report_test_support {

namespace fs = std::filesystem;
using graspmap_test::scratch_folder;

inline void put(const std::string& name, const std::string& text) {
  fs::create_directories((scratch_folder() / name).parent_path());
  graspmap_test::write_text(scratch_folder() / name, text);
}

inline void put_manifest(const std::string& output, const std::string& command,
                         const std::vector<libmap::ManifestInput>& inputs = {},
                         bool is_map = false) {
  libmap::Manifest manifest;
  manifest.command = command;
  manifest.version = "0";
  manifest.inputs = inputs;
  manifest.timings_s = {{"read", 0.5}};
  if (is_map) manifest.results.emplace_back("scored_voxels", std::int64_t{9});
  put(output + ".json", libmap::to_json(manifest));
}

}  // namespace report_test_support
