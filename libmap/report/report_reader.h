// Reads the files that a planned report (report_plan.h) shows.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "libmap/report/report_plan.h"

namespace libmap {

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

// Running times of each case's manifests; steps of equal command and name are summed.
TimingTable timing_table(const std::vector<std::pair<std::string, std::vector<Manifest>>>& cases);

}  // namespace libmap
