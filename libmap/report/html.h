// The parts of a report as HTML: escaped text, tables, manifests, 3-D views.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// Text as it may stand between tags and in quoted attributes: & < > " ' escaped, control characters
// other than tab and newline replaced by U+FFFD.
std::string escape_html(std::string_view text);

// The same of a name: it may be broken after '_', '/' and '.'.
std::string breakable_html(std::string_view name);

// JSON as it may stand in a <script>: every '<' as \u003c.
std::string escape_json_in_script(std::string json);

// A script or style sheet as it may stand between its tags: "</script", "</style" and "<!--" are
// broken up, carriage returns left out, so that the bytes are those that a browser hashes.
std::string escape_code(std::string_view code);

// RFC 4648, section 4.
std::string to_base64(std::string_view bytes);

// "'sha256-...'" of `code`, as a Content-Security-Policy names it.
std::string csp_hash(std::string_view code);

// ` name="value"`, or nothing if the value is empty.
std::string attribute(std::string_view name, std::string_view value);

// Format of the numbers of a column.
struct NumberStyle {
  bool numeric = false;   // every cell is empty or a number
  int decimals = 0;       // behind the point, the same in all cells
  bool as_given = false;  // whole numbers, and what fits no common number of decimals
};

// Three decimals at most: the longest cell of a column says how many. Columns whose largest value
// is smaller than 0.01 keep three significant digits each.
NumberStyle number_style(const std::vector<std::string>& cells);

// A cell as it is shown: "0.98214889" as "0.982".
std::string shown_number(const std::string& cell, const NumberStyle& style);

// Three significant digits, e.g. of seconds or of a value alone.
std::string short_number(double value);

struct CellText {
  std::string text;
  std::string title;  // the full value, if it is more than the text
};

// <td> with the class "number" if it is one.
std::string cell_html(const CellText& cell, bool numeric);

// <table> of all rows, the first column as the heads of the rows. Rows after the first 40 are
// folded away, unless `row_attribute` is given: each row then has an attribute of that name with
// its number.
std::string table_html(const ReportTable& table, const std::string& row_attribute = {});

// A box that scrolls by itself, named for screen readers.
std::string scroll_box(const std::string& table, const std::string& name);

// Parameters, inputs and results of one output as lists. For several outputs, differing values side
// by side, then the values that are equal in all.
std::string parameters_html(const ReportParameters& parameters);

// All outputs of a run, each folded: command, parameters, results and inputs.
std::string sources_html(const ReportContent& content);

// Milliseconds of each step and case, with sums per command and in total.
std::string timings_html(const TimingTable& table);

// Legend, picture, canvas, looked-up points and data. Canvas and data only if `with_view`. `still`
// is the picture that replaces the view, as <img>, or empty.
std::string map_html(const ReportMap& map, const std::string& still, bool with_view);

// Colors of the classes and flags, for the page's script.
std::string palette_json();

// Rules of the legend's swatches, a class each.
std::string palette_style();

// Legend, canvas and data. Canvas and data only if `with_view`.
std::string scene_html(const ReportScene& scene, bool with_view);

// Approximate number of bytes that the mesh takes in the page.
std::size_t scene_bytes(const TriangleMesh& mesh);

}  // namespace libmap
