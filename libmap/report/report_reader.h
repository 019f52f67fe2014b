// Plans a report on the folder of a run (sections and their files), and reads the files.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// Type of an item's content.
enum class ItemKind { image, table, map, scene, parameters, timings, listing };

struct PlannedItem {
  ItemKind kind = ItemKind::listing;
  std::vector<std::filesystem::path> files{};  // shown files; kind parameters: outputs
  std::vector<std::string> labels{};           // one per file, or empty
  std::string caption{};
  std::filesystem::path lookup{};  // kind map: table of look-ups; may be empty
  TableColumns columns{};          // kind map: columns of `lookup` to show
  std::filesystem::path image{};   // kind map: still image of the map; may be empty
  // Kind timings: heading of each column, and the outputs whose times it contains.
  std::vector<std::pair<std::string, std::vector<std::filesystem::path>>> cases{};
};

struct PlannedSection {
  std::string heading{};
  std::filesystem::path folder{};
  std::vector<PlannedItem> items{};  // before the first inner section
  std::vector<PlannedSection> sections{};

  // Number of items of a kind in this section and all inner sections.
  std::size_t count(ItemKind kind) const;
};

// Plans the report on `folder`: parameters of all maps; one section per inner folder with its maps,
// scenes, images, tables and texts; the running times. The heading is the report's title. Throws
// Error if the folder does not exist or contains nothing to show.
PlannedSection plan_report(const std::filesystem::path& folder);

// Returns the outputs that have a manifest, in `folder` and its subfolders (12 levels), in natural
// order. Folders named "tiles" are searched only if `tiles` is true, tile stores (*.tiles) never.
std::vector<ReportSource> manifests_below(const std::filesystem::path& folder, bool tiles);

// True if `a` is before `b` in natural order, which compares digits as numbers: "2_a" < "10_b".
bool natural_less(const std::string& a, const std::string& b);

struct ReportReadOptions {
  std::filesystem::path folder{};    // folder of the run
  std::filesystem::path excluded{};  // the report's file, which is not listed as an output
  std::size_t max_rows = 1000;       // maximum number of rows of a table
  std::size_t max_lines = 200;       // maximum number of lines of a text file
  std::size_t max_sources = 400;     // maximum number of outputs in the list of all outputs
};

// Function that reads a map, with a marker for each row of the table `lookup`, if given. It must
// throw Error if the map cannot be shown.
using MapLoader = std::function<MapView(const std::filesystem::path& map,
                                        const std::optional<std::filesystem::path>& lookup)>;

// Function that reads the mesh of a scene. It must throw Error if the scene cannot be shown.
using SceneLoader = std::function<ReportScene(const std::filesystem::path& scene)>;

struct ReportReadResult {
  ReportContent content;
  std::vector<std::filesystem::path> files;  // shown files in order of appearance, each once
};

// Reads all planned files. A file that cannot be shown becomes a ReportGap.
ReportReadResult read_report_content(const PlannedSection& plan, const ReportReadOptions& options,
                                     const MapLoader& load_map, const SceneLoader& load_scene);

// Reads the first `max_rows` rows of a CSV file of any size, from its first 4 MiB. Throws Error for
// an unreadable file, a file that is not a table, or a missing column.
ReportTable read_report_table(const std::filesystem::path& path, const TableColumns& columns,
                              std::size_t max_rows);

// Returns the running times in the manifests of each case. Times of equal steps are summed.
TimingTable timing_table(const std::vector<std::pair<std::string, std::vector<Manifest>>>& cases);

}  // namespace libmap
