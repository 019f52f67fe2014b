// Data of a report, which report_reader.h reads from files and report_page.h writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "libmap/core/manifest.h"
#include "libmap/core/table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/report/map_view.h"

namespace libmap {

// A PNG, JPEG or SVG image for embedding.
struct ReportImage {
  std::string file{};  // path relative to the run's folder
  std::string label{};
  std::string bytes{};
  std::string media_type{};
  int width = 0;  // pixels at full size; 0: unknown
  int height = 0;
  std::string change{};  // difference from the file, e.g. "JPEG, quality 90"; empty: none
};

// Shown columns of a table, with headings; empty: all.
using TableColumns = std::vector<std::pair<std::string, std::string>>;

struct ReportTable {
  Table table{};                         // shown columns and rows
  std::vector<std::string> headings{};   // one per column
  std::optional<std::uint64_t> lines{};  // lines of the file, if not all rows are shown
};

struct ReportMap {
  MapView view{};
  std::optional<ReportTable> locations{};  // look-ups; row n corresponds to marker n
  std::optional<ReportImage> preview{};    // shown where there is no 3-D view
};

// A colored mesh and the meaning of the colors.
struct ReportScene {
  TriangleMesh mesh{};
  std::vector<std::pair<Color, std::string>> legend{};
};

struct ReportParameters {
  std::vector<std::pair<std::string, Manifest>> outputs{};  // column heading and manifest
};

// Running times per step and case, as in tables 4-2 and 4-3 of the thesis.
struct TimingRow {
  std::string command;
  std::string step;
  std::vector<std::optional<double>> seconds;  // one per case
};

struct TimingTable {
  std::vector<std::string> cases;              // column headings
  std::vector<TimingRow> rows;                 // by command and step, in order of appearance
  std::vector<std::vector<unsigned>> threads;  // distinct numbers of threads per case
  // True if a step that occurs in several manifests of a case was summed.
  bool sums = false;
};

struct ReportListing {
  std::string text{};  // first lines of a file
  std::size_t omitted_lines = 0;
};

// A file that cannot be shown.
struct ReportGap {
  std::string file{};
  std::string reason{};
};

using ReportImages = std::vector<ReportImage>;
using ReportBody = std::variant<std::monostate, ReportImages, ReportTable, ReportMap, ReportScene,
                                ReportParameters, TimingTable, ReportListing>;

struct ReportItem {
  std::string caption{};
  std::string source{};  // shown file, if there is exactly one
  std::vector<ReportGap> gaps{};
  ReportBody body{};
};

struct ReportSection {
  std::string heading{};
  std::string folder{};  // relative to the run's folder
  std::vector<ReportItem> items{};
  std::vector<ReportSection> sections{};
};

// An output of the run with its manifest, or the error if the manifest cannot be read.
struct ReportSource {
  std::string output{};  // path
  Manifest manifest{};
  std::string error{};  // empty if the manifest was read
};

// The heading is the report's title.
struct ReportContent : ReportSection {
  std::vector<ReportSource> sources{};
  std::size_t more_sources = 0;  // number of unlisted outputs
};

}  // namespace libmap
