// Generates the parts of a report as HTML: escaped text, tables, manifests, 3-D views.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/markup.h"
#include "libmap/report/report_content.h"

namespace libmap {

// Escapes a name for HTML and allows line breaks after '_', '/' and '.'.
std::string breakable_html(std::string_view name);
// Escapes JSON for a <script> element: every '<' becomes \u003c.
std::string escape_json_in_script(std::string json);
// Escapes "</script", "</style" and "<!--" in an embedded script or style sheet. Removes
// carriage returns, so that a browser hashes the same bytes as csp_hash.
std::string escape_code(std::string_view code);
// Encodes bytes in base64 (RFC 4648, section 4). Throws Error for 1 GiB or more.
std::string to_base64(std::string_view bytes);
// Returns the source expression "'sha256-...'" of `code` for a Content-Security-Policy.
std::string csp_hash(std::string_view code);
// Returns the HTML attribute ` name="value"`; empty for an empty value.
std::string attribute(std::string_view name, std::string_view value);

// Format of the numbers in a column of a table.
struct NumberStyle {
  bool numeric = false;   // true if every cell is empty, "nan" or a number
  int decimals = 0;       // number of decimals; -1: three significant digits in each cell
  bool as_given = false;  // true: all numbers are integers, shown unchanged
};
// Returns the format of a column: the largest number of decimals in its cells, at most three; three
// significant digits if there are fractions and the largest magnitude is < 0.01 or >= 1e9.
NumberStyle number_style(const std::vector<std::string>& cells);
// Formats a cell, e.g. "0.98214889" as "0.982"; a number that is not finite as a dash.
std::string shown_number(const std::string& cell, const NumberStyle& style);
// Formats a number: integers, and magnitudes from 1000 to 1e9, without decimals; other numbers with
// three significant digits; a dash if it is not finite.
std::string short_number(double value);

struct CellText {
  std::string text;
  std::string title;  // tooltip: the full value if it differs from `text`; else empty
};

// Returns a <td> element, with the class "number" if `numeric`.
std::string cell_html(const CellText& cell, bool numeric);
// Returns a <table> element; the first column contains the row headers. In a table of more than 45
// rows, the rows after the first 40 are folded. With `row_attribute`, each row has an HTML
// attribute of this name with the row index, and no rows are folded.
std::string table_html(const ReportTable& table, const std::string& row_attribute = {});
// Returns a scrollable box with the HTML `table`; screen readers read out `name`.
std::string scroll_box(const std::string& table, const std::string& name);

// Returns tables of parameters, inputs and results. For several outputs: a table of the values that
// differ, with one column per output and without inputs, then a table of the common values.
std::string parameters_html(const ReportParameters& parameters);
// Returns command, parameters, results and inputs of each output of a run, folded, by folder.
std::string sources_html(const ReportContent& content);
// Returns a table of milliseconds per step and case, with sums per command and in total.
std::string timings_html(const TimingTable& table);

// Returns the HTML of a map: legend, still image, canvas, look-ups and data; canvas and data only
// if `with_view`. `preview` is the HTML that is shown without a 3-D view, e.g. without JavaScript.
std::string map_html(const ReportMap& map, const std::string& preview, bool with_view);
// Returns the colors of score classes and flags as JSON, for the page's script.
std::string palette_json();
// Returns CSS rules for the colors of legends, one class per color.
std::string palette_style();
// Returns the HTML of a scene: legend, canvas and data; canvas and data only if `with_view`.
std::string scene_html(const ReportScene& scene, bool with_view);
// Returns the approximate number of bytes of a mesh in the page.
std::size_t scene_bytes(const TriangleMesh& mesh);

}  // namespace libmap
