// ROC evaluation of the columns of a table, and its results as tables, JSON and Markdown.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libgtd/evaluate/roc.h"
#include "libmap/core/parameters.h"
#include "libmap/core/table.h"

namespace libgtd {

struct TableEvaluationOptions {
  std::string label_column = "graspable";
  // Empty: default_score_columns().
  std::vector<std::string> score_columns;
  RocOptions roc;
};
// All but the columns of scores, which are a list.
void bind(libmap::ParameterTable& table, TableEvaluationOptions& options);

struct ColumnEvaluation {
  std::string name;
  RocResult result;
};

struct TableEvaluation {
  TableEvaluationOptions options;  // the score columns are filled in
  std::size_t rows = 0;
  std::vector<ColumnEvaluation> columns;
};

// true/false, yes/no, on/off, 1/0 (also 1.0, 0.0), graspable/not graspable (also non-, un-, with
// '-', '_' or a space). Nothing for any other text.
std::optional<bool> parse_label(std::string_view text);

// The label in a cell; nothing for an empty one. Throws libmap::Error naming file, row and column.
std::optional<bool> label_at(const libmap::Table& table, std::size_t row, std::size_t column);

// All columns that hold numbers and empty cells alone, at least one number, and are neither the
// label, nor an identity (id, point, hold, i, j, k), nor a position or distance (x, y, z, or a
// name that ends with a unit of length such as "_m"), nor a look-up's flags found and edge.
std::vector<std::string> default_score_columns(const libmap::Table& table,
                                               std::string_view label_column);

// Empty cells are left out: a label that is not known, a location that is not visible. Throws
// libmap::Error naming file, row and column: no such column, a cell that is no label or number, no
// column to evaluate.
TableEvaluation evaluate_table(const libmap::Table& table, const TableEvaluationOptions& options);

// One row a column of scores and cutoff; `at` is "cutoff" for the given cutoffs, with the cutoff's
// share of the upper sum, or "score" for the distinct scores. Undefined rates are empty cells.
libmap::Table roc_table(const TableEvaluation& evaluation);

// One row a column of scores and rate: count, total, value, and the Wilson 95 % interval.
libmap::Table rates_table(const TableEvaluation& evaluation);

// One row a column of scores: case, locations, cutoff, and the same rates with four decimals, as
// the thesis's tables 5-4 and 5-5.
libmap::Table accuracy_table(const TableEvaluation& evaluation);

// Everything but the ROC points. Undefined values are null.
std::string to_json(const TableEvaluation& evaluation);

// The summary as a page: areas with their intervals, rates at the cutoff, and what was left out.
std::string to_markdown(const TableEvaluation& evaluation, const std::string& title);

}  // namespace libgtd
