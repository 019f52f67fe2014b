// Finds the content of a report in the folder of a run: sections and files of sections.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// Type of an item's content.
enum class ItemKind { image, table, map, scene, parameters, timings, listing };

struct PlannedItem {
  ItemKind kind = ItemKind::listing;
  std::vector<std::filesystem::path> files{};  // parameters: outputs
  std::vector<std::string> labels{};           // empty, or one per file
  std::string caption{};
  // Maps: table of look-ups, shown columns with headings, image of the map.
  std::filesystem::path lookup{};
  TableColumns columns{};
  std::filesystem::path image{};
  // Timings: heading and outputs of each column.
  std::vector<std::pair<std::string, std::vector<std::filesystem::path>>> cases{};
};

struct PlannedSection {
  std::string heading{};
  std::filesystem::path folder{};
  std::vector<PlannedItem> items{};  // before the first inner section
  std::vector<PlannedSection> sections{};

  // Number of items of a kind, including inner sections.
  std::size_t count(ItemKind kind) const;
};

// Plans the report on `folder`: parameters of all maps, one section per inner folder with its maps,
// scenes, images, tables and texts, and the running times. The heading is the report's title.
// Throws Error if the folder does not exist or contains nothing to show.
PlannedSection plan_report(const std::filesystem::path& folder);

// Outputs with a manifest in `folder` and subfolders (12 levels), in natural order. Folders of
// tiles are included only with `tiles`, tile stores never.
std::vector<ReportSource> manifests_below(const std::filesystem::path& folder, bool tiles);

// Natural order: digits are compared as numbers, "2_slopes" comes before "10_walls".
bool natural_less(const std::string& a, const std::string& b);

}  // namespace libmap
