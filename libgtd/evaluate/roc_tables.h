// Evaluates columns of scores against a column of labels (ROC curves, rates), and writes the
// results as tables, JSON and Markdown. For `graspmap evaluate`.
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
  std::vector<std::string> score_columns;  // empty: default_score_columns()
  RocOptions roc;
};
// Binds all fields except score_columns.
void bind(libmap::ParameterTable& table, TableEvaluationOptions& options);

struct ColumnEvaluation {
  std::string name;
  RocResult result;
};

struct TableEvaluation {
  TableEvaluationOptions options;  // score_columns is never empty
  std::size_t rows = 0;
  std::vector<ColumnEvaluation> columns;
};

// Parses a label: true/false, yes/no, on/off, 1/0 (also 1.0, 0.0), graspable/not graspable (also
// non-, un-, with '-', '_' or a space). Returns nullopt for any other text.
std::optional<bool> parse_label(std::string_view text);

// Returns the label in a cell; nullopt for an empty cell. Throws Error naming file, row and column
// if the cell contains another text.
std::optional<bool> label_at(const libmap::Table& table, std::size_t row, std::size_t column);

// Returns the columns with at least one number and otherwise only numbers and empty cells, in the
// order of the table. Skips the label, ids (id, place, region, point, hold, i, j, k), positions and
// lengths (x, y, z, *_m, *_mm, *_cm), found, border, edge, trial_spread, parameter_spread.
std::vector<std::string> default_score_columns(const libmap::Table& table,
                                               std::string_view label_column);

// Evaluates the score columns of a table. For each score column, rows without a label or score
// (e.g. a location that is not visible) are omitted. Throws Error naming file, row and column for a
// missing column, a cell that is no label or number, and a table without score columns.
TableEvaluation evaluate_table(const libmap::Table& table, const TableEvaluationOptions& options);

// Returns one row per score column and cutoff. The column `at` is "cutoff" for a given cutoff, or
// "score" for a distinct score (then without upper_sum_share). Undefined values are empty cells.
libmap::Table roc_table(const TableEvaluation& evaluation);

// Returns one row per score column and rate: count, total, value, and the Wilson 95 % interval.
libmap::Table rates_table(const TableEvaluation& evaluation);

// Returns one row per score column: case (name of the score column), locations, cutoff, and the
// rates of rates_table with four decimals, as in tables 5-4 and 5-5 of the thesis.
libmap::Table accuracy_table(const TableEvaluation& evaluation);

// Returns all results except the ROC points. Undefined values are null.
std::string to_json(const TableEvaluation& evaluation);

// Returns a summary page: areas with intervals, rates at the cutoff, and numbers of omitted rows.
std::string to_markdown(const TableEvaluation& evaluation, const std::string& title);

}  // namespace libgtd
