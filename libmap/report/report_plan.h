// The content of a report, found in the folder of a run: sections and the files that they show.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// What an item shows.
enum class ItemKind { picture, table, map, scene, parameters, timings, listing };

struct PlannedItem {
  ItemKind kind = ItemKind::listing;
  std::vector<std::filesystem::path> files{};  // of parameters: outputs
  std::vector<std::string> labels{};           // none, or one per file
  std::string caption{};
  // Of a map: a table of looked-up points, its columns with their headings, a picture of the map.
  std::filesystem::path lookup{};
  TableColumns columns{};
  std::filesystem::path picture{};
  // Of timings: outputs whose running times make one column, by its heading.
  std::vector<std::pair<std::string, std::vector<std::filesystem::path>>> cases{};
};

struct PlannedSection {
  std::string heading{};
  std::filesystem::path folder{};
  std::vector<PlannedItem> items{};  // before the first inner section
  std::vector<PlannedSection> sections{};

  // Number of items of that kind, those of inner sections included.
  std::size_t count(ItemKind kind) const;
};

// The plan of what is in `folder`, under the report's title: a section for each inner folder, with
// its maps, scenes, pictures, tables and texts; the parameters of all maps side by side; the
// running times. Throws Error: no such folder, or nothing in it that a report can show.
PlannedSection plan_report(const std::filesystem::path& folder);

// The outputs below `folder` that have a manifest, in natural order. Those in folders of tiles only
// with `tiles`, those in tile stores never. No deeper than 12 levels.
std::vector<ReportSource> manifests_below(const std::filesystem::path& folder, bool tiles);

// "2_slopes" before "10_walls": digits are compared as numbers.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace libmap
