#include "libgtd/evaluate/roc_tables.h"

#include <algorithm>
#include <array>

#include "libgtd/evaluate/named_cells.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {
namespace {

using libgtd::json_of;
using libmap::Table;
using libmap::to_fixed_text;

std::string text_or_empty(std::optional<double> value) {
  return value ? libmap::to_text(*value) : std::string();
}

struct NamedRate {
  const char* name;
  const char* symbol;
  Rate rate;
};

std::vector<NamedRate> named_rates(const Confusion& counts) {
  return {{"true_positive_rate", "TPR", counts.true_positive_rate()},
          {"true_negative_rate", "TNR", counts.true_negative_rate()},
          {"false_positive_rate", "FPR", counts.false_positive_rate()},
          {"false_negative_rate", "FNR", counts.false_negative_rate()},
          {"positive_predictive_value", "PPV", counts.positive_predictive_value()},
          {"accuracy", "ACC", counts.accuracy()}};
}

bool ends_with_length(std::string_view name) {
  for (const std::string_view unit : {"_m", "_mm", "_cm"})
    if (name.ends_with(unit)) return true;
  return false;
}

bool is_number_column(const Table& table, std::size_t column) {
  bool any = false;
  for (const std::vector<std::string>& row : table.rows) {
    if (libmap::trim(row[column]).empty()) continue;
    if (!libmap::parse_double(row[column])) return false;
    any = true;
  }
  return any;
}

std::vector<std::optional<bool>> read_labels(const Table& table, const std::string& name) {
  const std::size_t column = table.column(name);
  std::vector<std::optional<bool>> labels;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    labels.push_back(label_at(table, row, column));
  return labels;
}

std::vector<std::optional<double>> read_scores(const Table& table, const std::string& name) {
  const std::size_t column = table.column(name);
  std::vector<std::optional<double>> scores;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    scores.push_back(table.optional_number(row, column));
  return scores;
}

void add_roc_row(const std::string& name, const char* at, const RocPoint& point,
                 std::optional<double> fraction, Table& table) {
  const Confusion& counts = point.counts;
  append({{"scores", name},
          {"at", at},
          {"cutoff", libmap::to_text(point.cutoff)},
          {"predicted_positives", std::to_string(counts.predicted_positives())},
          {"predicted_negatives", std::to_string(counts.predicted_negatives())},
          {"true_positives", std::to_string(counts.true_positives)},
          {"false_positives", std::to_string(counts.false_positives)},
          {"true_negatives", std::to_string(counts.true_negatives)},
          {"false_negatives", std::to_string(counts.false_negatives)},
          {"true_positive_rate", text_or_empty(counts.true_positive_rate().value())},
          {"false_positive_rate", text_or_empty(counts.false_positive_rate().value())},
          {"upper_sum_share", text_or_empty(fraction)}},
         table);
}

Json json_of(const RocResult& result) {
  const Confusion& counts = result.at_rate_cutoff.counts;
  Json json;
  json["locations"] = counts.size();
  json["positives"] = counts.positives();
  json["negatives"] = counts.negatives();
  json["without_score"] = result.without_score;
  json["without_label"] = result.without_label;
  Json auc;
  if (const auto& found = result.auc) {
    auc["trapezoid"] = found->trapezoid;
    auc["trapezoid_bootstrap_95"] = json_of(found->trapezoid_bootstrap_95);
    auc["upper_sum"] = found->upper_sum;
    auc["upper_sum_terms"] = found->upper_sum_terms;
    auc["upper_sum_width"] = found->upper_sum_width;
  } else {
    auc["trapezoid"] = auc["trapezoid_bootstrap_95"] = auc["upper_sum"] = nullptr;
    auc["note"] = result.auc_note;
  }
  json["auc"] = std::move(auc);
  const auto optional = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  json["precision_at_half_recall"] = optional(result.precision_at_half_recall);
  json["calibration_error"] = optional(result.calibration_error);
  Json rates;
  for (const NamedRate& named : named_rates(counts)) rates[named.name] = json_of(named.rate);
  json["rates"] = std::move(rates);
  return json;
}

std::string markdown_cell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    if (c == '|') cell += '\\';
    cell += c == '\n' || c == '\r' ? ' ' : c;
  }
  return cell;
}

std::string interval_text(const std::optional<Interval>& interval, int decimals) {
  if (!interval) return "";
  return " (" + to_fixed_text(interval->low, decimals) + " to " +
         to_fixed_text(interval->high, decimals) + ")";
}

std::string areas_markdown(const TableEvaluation& evaluation) {
  std::string text =
      "| scores | locations | graspable | not visible | AUC, trapezoid | AUC, upper sum | "
      "precision at half of the recall | calibration error |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const ColumnEvaluation& column : evaluation.columns) {
    const RocResult& result = column.result;
    const Confusion& counts = result.at_rate_cutoff.counts;
    text += "| " + markdown_cell(column.name) + " | " + std::to_string(counts.size()) + " | " +
            std::to_string(counts.positives()) + " | " + std::to_string(result.without_score) +
            " | ";
    if (result.auc) {
      text += to_fixed_text(result.auc->trapezoid, 3) +
              interval_text(result.auc->trapezoid_bootstrap_95, 3) + " | " +
              to_fixed_text(result.auc->upper_sum, 3) +
              (result.auc->upper_sum_width < 1.0 ? " (incomplete, see below) |" : " |");
    } else {
      text += "not defined | not defined |";
    }
    for (const auto& value : {result.precision_at_half_recall, result.calibration_error})
      text += value ? " " + to_fixed_text(*value, 3) + " |" : " |";
    text += '\n';
  }
  return text;
}

std::string rates_markdown(const TableEvaluation& evaluation) {
  std::string text = "| scores |", rule = "|---|";
  for (const NamedRate& named : named_rates({})) {
    text += std::string(" ") + named.symbol + " |";
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const ColumnEvaluation& column : evaluation.columns) {
    text += "| " + markdown_cell(column.name) + " |";
    for (const NamedRate& named : named_rates(column.result.at_rate_cutoff.counts)) {
      const std::optional<double> value = named.rate.value();
      text += " " +
              (value ? to_fixed_text(*value, 4) + interval_text(named.rate.wilson_95(), 2)
                     : std::string("not defined")) +
              " |";
    }
    text += "\n";
  }
  return text;
}

std::string notes_markdown(const TableEvaluation& evaluation) {
  std::string text;
  for (const ColumnEvaluation& column : evaluation.columns) {
    const RocResult& result = column.result;
    if (!result.auc) text += "- " + markdown_cell(column.name) + ": " + result.auc_note + ".\n";
    if (result.without_label > 0)
      text += "- " + markdown_cell(column.name) + ": " + std::to_string(result.without_label) +
              " locations have a score and no label and are skipped.\n";
    if (result.auc && result.auc->upper_sum_width < 1.0)
      text += "- " + markdown_cell(column.name) +
              ": some locations that are not graspable score below the first cutoff or reach the "
              "last one; the upper sum covers only " +
              to_fixed_text(result.auc->upper_sum_width, 3) +
              " of the false positive rate and can be below the trapezoid.\n";
  }
  return text.empty() ? text : text + "\n";
}

}  // namespace

std::optional<bool> parse_label(std::string_view text) {
  if (const std::optional<bool> truth = libmap::parse_bool(text)) return truth;
  if (const std::optional<double> number = libmap::parse_double(text)) {
    if (*number == 1.0) return true;
    if (*number == 0.0) return false;
    return std::nullopt;
  }
  std::string letters;
  for (const char c : text) {
    if (c >= 'A' && c <= 'Z') letters += static_cast<char>(c - 'A' + 'a');
    if (c >= 'a' && c <= 'z') letters += c;
    if (static_cast<unsigned char>(c) >= 0x80) return std::nullopt;
  }
  if (letters == "graspable") return true;
  if (letters == "notgraspable" || letters == "nongraspable" || letters == "ungraspable")
    return false;
  return std::nullopt;
}

std::optional<bool> label_at(const Table& table, std::size_t row, std::size_t column) {
  const std::string& cell = table.rows[row][column];
  if (libmap::trim(cell).empty()) return std::nullopt;
  if (const std::optional<bool> label = parse_label(cell)) return label;
  throw libmap::Error(
      "not a label",
      {.file = table.file,
       .field = "row " + std::to_string(row + 1) + ", column '" + table.columns[column] + "'",
       .value = "'" + cell + "'",
       .bound = "1/0, true/false, yes/no, graspable/not graspable or empty"});
}

std::vector<std::string> default_score_columns(const Table& table, std::string_view label_column) {
  static constexpr std::array<std::string_view, 16> known = {"id",
                                                             "place",
                                                             "region",
                                                             "point",
                                                             "hold",
                                                             "x",
                                                             "y",
                                                             "z",
                                                             "i",
                                                             "j",
                                                             "k",
                                                             "found",
                                                             "border",
                                                             "edge",
                                                             "trial_spread",
                                                             "parameter_spread"};
  std::vector<std::string> names;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const std::string& name = table.columns[c];
    if (name == label_column || ends_with_length(name)) continue;
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    if (is_number_column(table, c)) names.push_back(name);
  }
  return names;
}

void bind(libmap::ParameterTable& table, TableEvaluationOptions& options) {
  table.add("label", options.label_column,
            "name of the column of true labels: 1/0, true/false, yes/no, graspable/not graspable");
  table.add("cutoff", options.roc.rate_cutoff, libmap::any_number,
            "minimum score of a location that is predicted graspable (accuracy and other rates)");
  table.add("bootstrap", options.roc.bootstrap_replicates, libmap::Range{0, 1e7},
            "number of bootstrap replicates for the confidence interval of the AUC; 0: none");
  table.add("seed", options.roc.bootstrap_seed, libmap::not_negative,
            "random seed of the bootstrap");
}

TableEvaluation evaluate_table(const Table& table, const TableEvaluationOptions& options) {
  options.roc.check();
  TableEvaluation evaluation;
  evaluation.options = options;
  evaluation.rows = table.rows.size();
  const std::vector<std::optional<bool>> labels = read_labels(table, options.label_column);
  std::vector<std::string>& names = evaluation.options.score_columns;
  if (names.empty()) names = default_score_columns(table, options.label_column);
  if (names.empty())
    throw libmap::Error("not recognized; name the columns with --score",
                        {.file = table.file, .field = "score columns"});
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(n), names[n]) !=
        names.begin() + static_cast<std::ptrdiff_t>(n))
      throw libmap::Error("is named twice",
                          {.file = table.file, .field = "column '" + names[n] + "'"});
    evaluation.columns.push_back(
        {names[n], evaluate_roc(labels, read_scores(table, names[n]), options.roc)});
  }
  return evaluation;
}

Table roc_table(const TableEvaluation& evaluation) {
  Table table;
  for (const ColumnEvaluation& column : evaluation.columns) {
    const RocResult& result = column.result;
    for (std::size_t k = 0; k < result.at_cutoffs.size(); ++k) {
      std::optional<double> fraction;
      if (result.auc) fraction = result.auc->upper_sum_terms[k];
      add_roc_row(column.name, "cutoff", result.at_cutoffs[k], fraction, table);
    }
    for (const RocPoint& point : result.at_scores)
      add_roc_row(column.name, "score", point, std::nullopt, table);
  }
  return table;
}

Table rates_table(const TableEvaluation& evaluation) {
  Table table;
  table.columns = {"scores", "cutoff", "rate", "count", "total", "value", "low_95", "high_95"};
  for (const ColumnEvaluation& column : evaluation.columns) {
    const RocPoint& point = column.result.at_rate_cutoff;
    for (const NamedRate& named : named_rates(point.counts)) {
      const std::optional<Interval> interval = named.rate.wilson_95();
      table.rows.push_back({column.name, libmap::to_text(point.cutoff), named.name,
                            std::to_string(named.rate.count), std::to_string(named.rate.total),
                            text_or_empty(named.rate.value()),
                            interval ? libmap::to_text(interval->low) : std::string(),
                            interval ? libmap::to_text(interval->high) : std::string()});
    }
  }
  return table;
}

Table accuracy_table(const TableEvaluation& evaluation) {
  Table table;
  table.columns = {"case", "locations", "cutoff", "tpr", "tnr", "fpr", "fnr", "ppv", "acc"};
  for (const ColumnEvaluation& column : evaluation.columns) {
    const RocPoint& point = column.result.at_rate_cutoff;
    std::vector<std::string> row = {column.name, std::to_string(point.counts.size()),
                                    libmap::to_text(point.cutoff)};
    for (const NamedRate& named : named_rates(point.counts)) {
      const std::optional<double> value = named.rate.value();
      row.push_back(value ? to_fixed_text(*value, 4) : std::string());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string to_json(const TableEvaluation& evaluation) {
  const TableEvaluationOptions& options = evaluation.options;
  Json json;
  json["rows"] = evaluation.rows;
  json["label_column"] = options.label_column;
  json["cutoff"] = options.roc.rate_cutoff;
  json["upper_sum_cutoffs"] = options.roc.cutoffs;
  json["bootstrap"] = {{"method", "percentile, positives and negatives resampled separately"},
                       {"replicates", options.roc.bootstrap_replicates},
                       {"seed", options.roc.bootstrap_seed}};
  Json scores = Json::array();
  for (const ColumnEvaluation& column : evaluation.columns) {
    Json entry;
    entry["name"] = column.name;
    entry.update(json_of(column.result));
    scores.push_back(std::move(entry));
  }
  json["scores"] = std::move(scores);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string to_markdown(const TableEvaluation& evaluation, const std::string& title) {
  const RocOptions& roc = evaluation.options.roc;
  std::string text;
  if (!title.empty()) text += "# " + markdown_cell(title) + "\n\n";
  text += "Label: column `" + evaluation.options.label_column + "`, " +
          std::to_string(evaluation.rows) + " rows.\n\n## Area under the ROC curve\n\n" +
          areas_markdown(evaluation) + "\n";
  text +=
      "The trapezoid equals the Mann-Whitney statistic, the probability that a graspable location "
      "scores higher than one that is not; ties count one half";
  if (roc.bootstrap_replicates > 0)
    text += "; in brackets its 95 % percentile interval of " +
            std::to_string(roc.bootstrap_replicates) + " bootstrap replicates (seed " +
            std::to_string(roc.bootstrap_seed) +
            ", graspable and other locations resampled separately, so each replicate has both)";
  text +=
      ". The AUC that the thesis published (0.84, 0.75, 0.72) is the upper sum over its ten "
      "cutoffs, the sum of (FPR_k - FPR_k+1) * TPR_k, and not the trapezoid (0.745, 0.642, 0.650 "
      "on the same scores). If the cutoffs span the scores of all locations that are not "
      "graspable, the upper sum is never less than the trapezoid. Do not use it for comparison "
      "with other work.\n\n";
  text += notes_markdown(evaluation);
  text += "## Rates at cutoff " + libmap::to_text(roc.rate_cutoff) + "\n\n" +
          rates_markdown(evaluation) +
          "\nA location is predicted graspable if its score reaches the cutoff. In brackets the "
          "Wilson 95 % interval.\n";
  return text;
}

}  // namespace libgtd
