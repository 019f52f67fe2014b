// Plans a report (its sections and their files) on the folder of a run, and reads the files.
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

// Returns the outputs with a manifest in `folder` and subfolders (12 levels), in natural order.
// Folders of tiles are included only with `tiles`, tile stores never.
std::vector<ReportSource> manifests_below(const std::filesystem::path& folder, bool tiles);

// True if `a` is before `b` in natural order, with digits as numbers: "2_slopes", "10_walls".
bool natural_less(const std::string& a, const std::string& b);

struct ReportReadOptions {
  std::filesystem::path folder{};    // folder of the run
  std::filesystem::path excluded{};  // the report itself, which is not listed
  std::size_t max_rows = 1000;       // per table
  std::size_t max_lines = 200;       // per text file
  std::size_t max_sources = 400;     // in the list of all outputs
};

// Reads a map, with one positioned marker per row of the look-ups, if there are any. Must throw
// Error if the map cannot be shown.
using MapLoader = std::function<MapView(const std::filesystem::path& map,
                                        const std::optional<std::filesystem::path>& lookup)>;

// Reads the mesh of a scene. Must throw Error if the scene cannot be shown.
using SceneLoader = std::function<ReportScene(const std::filesystem::path& scene)>;

struct ReportReadResult {
  ReportContent content;
  std::vector<std::filesystem::path> files;  // shown files in order of appearance, each once
};

// Reads all planned files. A file that cannot be shown becomes a ReportGap.
ReportReadResult read_report_content(const PlannedSection& plan, const ReportReadOptions& options,
                                     const MapLoader& load_map, const SceneLoader& load_scene);

// Reads the first `max_rows` rows of a CSV file of any size (at most 4 MiB of it). Throws Error: an
// unreadable file, not a table, a missing column.
ReportTable read_report_table(const std::filesystem::path& path, const TableColumns& columns,
                              std::size_t max_rows);

// Returns the running times of each case's manifests. Equal steps of a command are summed.
TimingTable timing_table(const std::vector<std::pair<std::string, std::vector<Manifest>>>& cases);

}  // namespace libmap
