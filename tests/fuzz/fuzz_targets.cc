#include "tests/fuzz/fuzz_targets.h"

#include <algorithm>
#include <stdexcept>

#include "libmap/core/file_output.h"
#include "tests/fuzz/target_support.h"

namespace graspmap_fuzz {

const std::vector<FuzzTarget>& fuzz_targets() {
  static const std::vector<FuzzTarget> targets = [] {
    std::vector<FuzzTarget> all;
    for (const auto& part : {scan_targets(), cloud_targets(), mesh_targets(), text_targets(),
                             map_targets(), feature_targets(), bag_targets()})
      all.insert(all.end(), part.begin(), part.end());
    std::sort(all.begin(), all.end(), [](const FuzzTarget& a, const FuzzTarget& b) {
      return std::string_view(a.name) < b.name;
    });
    return all;
  }();
  return targets;
}

const FuzzTarget& fuzz_target(std::string_view name) {
  const auto& targets = fuzz_targets();
  const auto found = std::find_if(targets.begin(), targets.end(),
                                  [&](const FuzzTarget& target) { return name == target.name; });
  if (found == targets.end()) throw std::out_of_range("no fuzz target " + std::string(name));
  return *found;
}

void write_seeds(const FuzzTarget& target, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::size_t number = 0;
  for (const std::string& seed : target.seeds())
    libmap::write_text(folder / ("seed_" + std::to_string(number++)), seed);
}

}  // namespace graspmap_fuzz
