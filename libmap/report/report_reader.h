// The files of a report, read.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "libmap/report/report_plan.h"

namespace libmap {

struct ReportReadOptions {
  std::filesystem::path folder{};    // of the run
  std::filesystem::path left_out{};  // the report itself
  std::size_t max_rows = 1000;       // of a table
  std::size_t max_lines = 200;       // of a listing
  std::size_t max_sources = 400;     // in the list of all outputs
};

// Maps are read by the caller: with a marker for each row of the looked-up points, if there are
// any, its position set. Throws Error if the map cannot be shown.
using MapLoader = std::function<MapView(const std::filesystem::path& map,
                                        const std::optional<std::filesystem::path>& lookup)>;

// And the meshes of scenes. Throws Error if the scene cannot be shown.
using SceneLoader = std::function<ReportScene(const std::filesystem::path& scene)>;

struct ReportReadResult {
  ReportContent content;
  std::vector<std::filesystem::path> files;  // that were shown, in their order, each once
};

// A damaged file is a gap in the content.
ReportReadResult read_report_content(const PlannedSection& plan, const ReportReadOptions& options,
                                     const MapLoader& load_map, const SceneLoader& load_scene);

// The first `max_rows` rows of a CSV file, however large it is. Throws Error: no table, a column
// that does not exist.
ReportTable read_report_table(const std::filesystem::path& path, const TableColumns& columns,
                              std::size_t max_rows);

// The steps of each case's manifests; those of one name and command are added up.
TimingTable timing_table(const std::vector<std::pair<std::string, std::vector<Manifest>>>& cases);

}  // namespace libmap
