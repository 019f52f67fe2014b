// graspmap evaluate: ROC curves, AUC and rates of scores against labels in a table.
#include <algorithm>
#include <utility>

#include "libgtd/evaluate/roc_tables.h"
#include "libmap/core/table.h"
#include "libmap/view/charts.h"
#include "libmap/view/image_io.h"
#include "tools/support/command_line.h"

using namespace graspmap_tools;

namespace {

using libgtd::ColumnEvaluation;
using libgtd::TableEvaluation;

struct EvaluateOptions {
  std::vector<std::string> tables;
  std::string folder;
  std::string scores;  // names, separated by commas
  std::string title = "ROC";
  libgtd::TableEvaluationOptions evaluation;
};

void bind(libmap::ParameterTable& parameters, EvaluateOptions& options) {
  bind(parameters, options.evaluation);
  parameters.add("score", options.scores,
                 "columns to evaluate as scores, separated by commas; empty: every numeric column "
                 "that is not an id, position or length");
  parameters.add("title", options.title, "title of the chart and of the summary");
}

libmap::Chart chart_of(const TableEvaluation& evaluation, const std::string& title) {
  std::vector<libmap::ChartCurve> curves;
  for (const ColumnEvaluation& column : evaluation.columns) {
    if (!column.result.auc) continue;
    libmap::ChartCurve& curve = curves.emplace_back();
    curve.name = column.name + ", AUC " + libmap::to_fixed_text(column.result.auc->trapezoid, 3) +
                 " (trapezoid)";
    for (const libgtd::RocPoint& point : column.result.at_scores) {
      curve.x.push_back(*point.counts.false_positive_rate().value());
      curve.y.push_back(*point.counts.true_positive_rate().value());
    }
    curve.x.push_back(0.0);
    curve.y.push_back(0.0);
  }
  return libmap::roc_chart(std::move(curves), title);
}

std::string rounded_text(double value) {
  return libmap::to_text(std::round(value * 1000.0) / 1000.0);
}

void note_results(const TableEvaluation& evaluation, Run& run) {
  run.add_results({{"rows", evaluation.rows}});
  for (const ColumnEvaluation& column : evaluation.columns) {
    const libgtd::RocResult& result = column.result;
    const std::size_t locations = result.at_rate_cutoff.counts.size();
    run.add_results({{column.name + ".locations", locations}});
    if (!result.auc) {
      run.warn(column.name + ": " + result.auc_note);
      continue;
    }
    run.add_results({{column.name + ".auc_trapezoid", result.auc->trapezoid},
                     {column.name + ".auc_upper_sum", result.auc->upper_sum}});
    run.info("{}: {} locations, AUC {} (trapezoid), {} (upper sum, as in the thesis)", column.name,
             locations, rounded_text(result.auc->trapezoid), rounded_text(result.auc->upper_sum));
  }
}

void write_results(const EvaluateOptions& options, const TableEvaluation& evaluation, Run& run) {
  const libmap::Chart chart = chart_of(evaluation, options.title);
  const libmap::ColorImage image =
      run.timed("draw", [&] { return libmap::draw_chart(chart, libmap::roc_chart_size); });
  const auto text = &Run::text_writer;
  const auto csv = [](const libmap::Table& table) {
    return Run::text_writer(libmap::to_csv(table));
  };
  run.write_output_folder(options.folder,
                          {{"roc.csv", csv(libgtd::roc_table(evaluation))},
                           {"rates.csv", csv(libgtd::rates_table(evaluation))},
                           {"accuracy.csv", csv(libgtd::accuracy_table(evaluation))},
                           {"summary.json", text(libgtd::to_json(evaluation))},
                           {"summary.md", text(libgtd::to_markdown(evaluation, options.title))},
                           {"roc.svg", text(libmap::chart_svg(chart, libmap::roc_chart_size))},
                           {"roc.png", text(libmap::to_png(image))}});
}

// Joins the rows of all tables, with the columns that all tables have.
libmap::Table join_tables(std::vector<libmap::Table> tables) {
  if (tables.size() == 1) return std::move(tables.front());
  libmap::Table joined;
  for (const std::string& name : tables.front().columns)
    if (std::all_of(tables.begin(), tables.end(),
                    [&](const libmap::Table& table) { return table.find_column(name); }))
      joined.columns.push_back(name);
  joined.file = tables.front().file;
  for (const libmap::Table& table : tables)
    for (const std::vector<std::string>& row : table.rows) {
      std::vector<std::string>& cells = joined.rows.emplace_back();
      for (const std::string& name : joined.columns) cells.push_back(row[table.column(name)]);
    }
  return joined;
}

void evaluate(EvaluateOptions& options, Run& run) {
  run.claim_output_folder(options.folder);
  options.evaluation.score_columns = libmap::split_list(options.scores);
  std::vector<libmap::Table> tables;
  for (const std::string& file : options.tables) {
    tables.push_back(libmap::read_csv(file));
    run.add_input(file);
  }
  const libmap::Table table = join_tables(std::move(tables));
  const TableEvaluation evaluation =
      run.timed("evaluate", [&] { return libgtd::evaluate_table(table, options.evaluation); });
  note_results(evaluation, run);
  write_results(options, evaluation, run);
}

}  // namespace

int main(int argc, char** argv) {
  EvaluateOptions options;
  Command command("evaluate");
  command.former_flag("--hold-model", "not needed: forces need no fit for a gripper");
  command.inputs("TABLE.csv", options.tables,
                 "table of true labels and scores, one row per location; the rows of several "
                 "tables are joined, with their common columns");
  command.output(
      options.folder,
      "output folder: roc.csv, rates.csv, accuracy.csv, summary.json and .md, roc.png and .svg");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { evaluate(options, run); });
}
