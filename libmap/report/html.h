// Generates the parts of a report as HTML: escaped text, tables, manifests, 3-D views.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// Escapes text for elements and quoted attributes: & < > " ' are escaped, control characters other
// than tab and newline are replaced by U+FFFD.
std::string escape_html(std::string_view text);

// Escapes a name and allows line breaks after '_', '/' and '.'.
std::string breakable_html(std::string_view name);

// Escapes JSON for a <script> element: every '<' becomes \u003c.
std::string escape_json_in_script(std::string json);

// Escapes a script or style sheet for inclusion in an element: "</script", "</style" and "<!--" are
// escaped. Removes carriage returns, so that the bytes equal the bytes that a browser hashes.
std::string escape_code(std::string_view code);

// Base64 by RFC 4648, section 4. Throws Error for 1 GiB or more.
std::string to_base64(std::string_view bytes);

// Hash source of `code` for a Content-Security-Policy: "'sha256-...'".
std::string csp_hash(std::string_view code);

// HTML attribute ` name="value"`; empty if the value is empty.
std::string attribute(std::string_view name, std::string_view value);

// Format of the numbers of a column.
struct NumberStyle {
  bool numeric = false;   // every cell is empty or a number
  int decimals = 0;       // common to all cells; -1: three significant digits each
  bool as_given = false;  // show cells unchanged: integers only
};

// Format of a column: the maximum number of decimals of the cells, at most three. Columns with a
// largest value smaller than 0.01 or at least 1e9 have three significant digits.
NumberStyle number_style(const std::vector<std::string>& cells);

// Formats a cell, e.g. "0.98214889" as "0.982".
std::string shown_number(const std::string& cell, const NumberStyle& style);

// Formats a number with three significant digits; integers below 1e9 completely.
std::string short_number(double value);

struct CellText {
  std::string text;
  std::string title;  // full value if it differs from the text
};

// <td> element, with the class "number" if `numeric`.
std::string cell_html(const CellText& cell, bool numeric);

// <table> element; the first column contains the row headers. Rows after the first 40 are folded
// unless `row_attribute` is set: each row then has an attribute of that name with the row index.
std::string table_html(const ReportTable& table, const std::string& row_attribute = {});

// A scrollable box, named for screen readers.
std::string scroll_box(const std::string& table, const std::string& name);

// Parameters, inputs and results of one output as tables. For several outputs: a table of differing
// values with one column per output, then the common values.
std::string parameters_html(const ReportParameters& parameters);

// Command, parameters, results and inputs of all outputs of a run, each folded.
std::string sources_html(const ReportContent& content);

// Milliseconds per step and case, with sums per command and in total.
std::string timings_html(const TimingTable& table);

// Legend, still image, canvas, look-ups and data of a map; canvas and data only if `with_view`.
// `preview` is an <img> element that replaces the view, or empty.
std::string map_html(const ReportMap& map, const std::string& preview, bool with_view);

// Colors of classes and flags, for the page's script.
std::string palette_json();

// CSS rules of the legend's swatches, one class per color.
std::string palette_style();

// Legend, canvas and data of a scene; canvas and data only if `with_view`.
std::string scene_html(const ReportScene& scene, bool with_view);

// Approximate number of bytes of the mesh in the page.
std::size_t scene_bytes(const TriangleMesh& mesh);

}  // namespace libmap
