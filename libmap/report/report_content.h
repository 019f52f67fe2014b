// What stands in a report, read and ready to be shown.
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

// PNG, JPEG or SVG as they are put into the page.
struct ReportPicture {
  std::string file{};  // as it is named in the report
  std::string label{};
  std::string bytes{};
  std::string media_type{};
  int width = 0;  // as shown at full size; 0: not known
  int height = 0;
  std::string change{};  // how it differs from the file: "JPEG, 1000 px wide"; empty: not at all
};

// Columns of a table that are shown, with their headings; none: all.
using TableColumns = std::vector<std::pair<std::string, std::string>>;

struct ReportTable {
  Table table{};                         // the columns and at most the rows that are shown
  std::vector<std::string> headings{};   // one a column
  std::optional<std::uint64_t> lines{};  // of the whole file, if not all of it was read
};

struct ReportMap {
  MapView view{};
  std::optional<ReportTable> locations{};  // row n belongs to the marker n
  std::optional<ReportPicture> still{};
};

// A colored mesh, and what its colors mean.
struct ReportScene {
  TriangleMesh mesh{};
  std::vector<std::pair<Color, std::string>> legend{};
};

struct ReportParameters {
  std::vector<std::pair<std::string, Manifest>> outputs{};  // by the head of their column
};

// Running times: each step by each case, as in tables 4-2 and 4-3 of the thesis.
struct TimingRow {
  std::string command;
  std::string step;
  std::vector<std::optional<double>> seconds;  // one per case
};

struct TimingTable {
  std::vector<std::string> cases;
  std::vector<TimingRow> rows;                 // by command and step, as they first came
  std::vector<std::vector<unsigned>> threads;  // that the manifests of each case ran with
  // Steps that several manifests of one case name were added up.
  bool sums = false;
};

struct ReportListing {
  std::string text{};
  std::size_t left_out_lines = 0;
};

// A file that cannot be shown.
struct ReportGap {
  std::string file{};
  std::string reason{};
};

using ReportPictures = std::vector<ReportPicture>;
using ReportBody = std::variant<std::monostate, ReportPictures, ReportTable, ReportMap, ReportScene,
                                ReportParameters, TimingTable, ReportListing>;

struct ReportItem {
  std::string caption{};
  std::string source{};  // file that it shows, if that is one
  std::vector<ReportGap> gaps{};
  ReportBody body{};
};

struct ReportSection {
  std::string heading{};
  std::string folder{};  // relative to the run's
  std::vector<ReportItem> items{};
  std::vector<ReportSection> sections{};
};

// An output of the run and what its manifest says, or why that cannot be read.
struct ReportSource {
  std::string output{};
  Manifest manifest{};
  std::string error{};
};

// The heading is the report's title.
struct ReportContent : ReportSection {
  std::vector<ReportSource> sources{};
  std::size_t more_sources = 0;  // that are not listed
};

}  // namespace libmap
