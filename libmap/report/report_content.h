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
  std::string file{};   // path relative to the run's folder
  std::string label{};  // caption of this image; may be empty
  std::string bytes{};
  std::string media_type{};  // e.g. "image/png"
  int width = 0;             // pixels; 0: unknown
  int height = 0;            // pixels; 0: unknown
  std::string change{};      // difference from the file, e.g. "JPEG, quality 90"; empty: none
};

// Columns to show: name in the file, heading. Empty: all columns.
using TableColumns = std::vector<std::pair<std::string, std::string>>;

struct ReportTable {
  Table table{};                         // shown rows and columns
  std::vector<std::string> headings{};   // one per shown column
  std::optional<std::uint64_t> lines{};  // lines of the file; nullopt: all rows are shown
};

struct ReportMap {
  MapView view{};
  std::optional<ReportTable> locations{};  // table of look-ups; row n has marker n of the view
  std::optional<ReportImage> preview{};    // shown if no 3-D view is, e.g. without JavaScript
};

// A colored mesh, and the meaning of its colors.
struct ReportScene {
  TriangleMesh mesh{};
  std::vector<std::pair<Color, std::string>> legend{};  // colors and their meanings
};

// Parameters of one or several outputs.
struct ReportParameters {
  std::vector<std::pair<std::string, Manifest>> outputs{};  // column heading and manifest
};

// Running times of a step of a command.
struct TimingRow {
  std::string command;
  std::string step;
  std::vector<std::optional<double>> seconds;  // one per case of TimingTable; nullopt: not executed
};

struct TimingTable {
  std::vector<std::string> cases;              // column headings
  std::vector<TimingRow> rows;                 // by command and step, in order of appearance
  std::vector<std::vector<unsigned>> threads;  // distinct numbers of threads per case
  // True if any time is the sum over several manifests of a case.
  bool sums = false;
};

struct ReportListing {
  std::string text{};             // first lines of a file
  std::size_t omitted_lines = 0;  // number of further lines
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
  std::string source{};           // shown file; empty if there are several
  std::vector<ReportGap> gaps{};  // files that cannot be shown
  ReportBody body{};              // content; std::monostate: nothing can be shown
};

struct ReportSection {
  std::string heading{};
  std::string folder{};  // relative to the run's folder
  std::vector<ReportItem> items{};
  std::vector<ReportSection> sections{};
};

// An output of the run.
struct ReportSource {
  std::string output{};  // path; in ReportContent, relative to the run's folder
  Manifest manifest{};
  std::string error{};  // reason why the manifest cannot be read; empty if it was read
};

// The section's heading is the title of the report.
struct ReportContent : ReportSection {
  std::vector<ReportSource> sources{};
  std::size_t more_sources = 0;  // number of outputs that `sources` omits
};

}  // namespace libmap
