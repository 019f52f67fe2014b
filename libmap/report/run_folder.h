// What lies in the folder of a run.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// "2_slopes" before "10_walls": runs of digits are compared as numbers.
bool natural_less(std::string_view a, std::string_view b);

inline constexpr int max_folder_depth = 12;  // below a run's folder

struct FolderListing {
  std::vector<std::filesystem::path> files;
  std::vector<std::filesystem::path> folders;
};

// In natural order. Hidden names are left out, and links to folders, which may lead in circles; a
// folder that cannot be read is empty.
FolderListing list_folder(const std::filesystem::path& folder);

// Whether it holds the tiles of a map: a store, or the shares that were merged to one.
bool is_folder_of_tiles(const std::filesystem::path& folder);

// The outputs below `folder` that have a manifest, each with what it says, as they come in natural
// order. Those in folders of tiles only with `shares`, and stores' never. No deeper than 12 levels.
std::vector<ReportSource> manifests_below(const std::filesystem::path& folder, bool shares);

}  // namespace libmap
