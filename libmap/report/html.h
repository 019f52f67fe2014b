// Generates the parts of a report as HTML: escaped text, tables, manifests, 3-D views.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/markup.h"
#include "libmap/report/report_content.h"

namespace libmap {

// Escapes a name and allows line breaks after '_', '/' and '.'.
std::string breakable_html(std::string_view name);

// Escapes JSON for a <script> element: every '<' becomes \u003c.
std::string escape_json_in_script(std::string json);

// Escapes a script or style sheet for inclusion in an element: "</script", "</style" and "<!--" are
// escaped. Removes carriage returns, so that the bytes equal the bytes that a browser hashes.
std::string escape_code(std::string_view code);

// Base64 by RFC 4648, section 4. Throws Error for 1 GiB or more.
std::string to_base64(std::string_view bytes);

// Returns the hash source of `code` for a Content-Security-Policy: "'sha256-...'".
std::string csp_hash(std::string_view code);

// Returns the HTML attribute ` name="value"`; nothing if the value is empty.
std::string attribute(std::string_view name, std::string_view value);

// Format of the numbers of a column.
struct NumberStyle {
  bool numeric = false;   // every cell is empty or a number
  int decimals = 0;       // of all cells; -1: three significant digits in each cell
  bool as_given = false;  // true: all numbers are integers, shown unchanged
};

// Returns the format of a column: the maximum number of decimals of its cells, at most three; three
// significant digits if there are fractions and the largest value is below 0.01 or at least 1e9.
NumberStyle number_style(const std::vector<std::string>& cells);

// Formats a cell, e.g. "0.98214889" as "0.982".
std::string shown_number(const std::string& cell, const NumberStyle& style);

// Formats a number with three significant digits, or as integer if it is one or is at least 1000,
// up to 1e9; a dash if it is not finite.
std::string short_number(double value);

struct CellText {
  std::string text;
  std::string title;  // full value if it differs from the text
};

// <td> element, with the class "number" if `numeric`.
std::string cell_html(const CellText& cell, bool numeric);

// <table> element; the first column contains the row headers. Of more than 45 rows, those after the
// first 40 are folded, unless `row_attribute` is set: the name of an attribute with the row index.
std::string table_html(const ReportTable& table, const std::string& row_attribute = {});

// Scrollable box with the HTML `table`; `name` is read out by screen readers.
std::string scroll_box(const std::string& table, const std::string& name);

// Parameters, inputs and results of one output as tables. For several outputs: a table of differing
// values (without inputs) with one column per output, then the common values.
std::string parameters_html(const ReportParameters& parameters);

// Command, parameters, results and inputs of each output of a run, folded, grouped by folder.
std::string sources_html(const ReportContent& content);

// Table of milliseconds per step and case, with sums per command and in total.
std::string timings_html(const TimingTable& table);

// Legend, still image, canvas, look-ups and data of a map; canvas and data only if `with_view`.
// `preview` is the HTML that is shown where there is no view, e.g. without JavaScript.
std::string map_html(const ReportMap& map, const std::string& preview, bool with_view);

// Colors of classes and flags, for the page's script.
std::string palette_json();

// CSS rules of the legend's swatches, one class per color.
std::string palette_style();

// Legend, canvas and data of a scene; canvas and data only if `with_view`.
std::string scene_html(const ReportScene& scene, bool with_view);

// Returns the approximate number of bytes that the mesh takes in the page.
std::size_t scene_bytes(const TriangleMesh& mesh);

}  // namespace libmap
