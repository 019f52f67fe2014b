// Tables as HTML.
#pragma once

#include <string>
#include <vector>

#include "libmap/report/report_content.h"

namespace libmap {

// How the numbers of a column are shown.
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

// <table> of all rows, the first column as the rows' heads. Beyond `open_rows` they are folded
// away. With `row_attribute` each row has an attribute of that name with its number.
std::string table_html(const ReportTable& table, const std::string& row_attribute = {});

// A box that scrolls by itself, named for screen readers.
std::string scroll_box(const std::string& table, const std::string& name);

}  // namespace libmap
