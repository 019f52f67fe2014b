#include "libmap/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "libmap/core/text.h"

namespace libmap {

namespace {

struct Value {
  std::string text;
  std::string title;
  bool numeric = false;
  bool operator==(const Value&) const = default;
};

Value number_value(double number) {
  const std::string full = to_text(number);
  const std::string text = full.size() <= 7 ? full : short_number(number);
  return {text, text == full ? "" : full, true};
}

Value to_value(const ManifestValue& value) {
  if (const bool* on = std::get_if<bool>(&value)) return {*on ? "yes" : "no", "", false};
  if (const auto* whole = std::get_if<std::int64_t>(&value)) return {to_text(*whole), "", true};
  if (const double* number = std::get_if<double>(&value)) return number_value(*number);
  if (const auto* text = std::get_if<std::string>(&value))
    return {text->empty() ? "\xE2\x80\x93" : *text, "", false};
  std::string list;
  for (const double number : std::get<std::vector<double>>(value))
    list += (list.empty() ? "" : ", ") + number_value(number).text;
  return {list, "", true};
}

std::string value_cell(const Value& value) {
  return cell_html({value.text, value.title}, value.numeric);
}

using Values = std::vector<std::pair<std::string, ManifestValue>>;

std::string pair_rows(const Values& values) {
  std::string html;
  for (const auto& [name, value] : values)
    html += "<tr><th scope=\"row\">" + escape_html(name) + "</th>" + value_cell(to_value(value)) +
            "</tr>\n";
  return html;
}

std::string pair_table(const std::string& caption, const Values& values) {
  if (values.empty()) return "";
  return "<table class=\"pairs\"><caption>" + escape_html(caption) + "</caption><tbody>\n" +
         pair_rows(values) + "</tbody></table>\n";
}

std::string inputs_table(const std::vector<ManifestInput>& inputs) {
  if (inputs.empty()) return "";
  std::string html =
      "<table class=\"inputs\"><caption>Inputs</caption><thead><tr><th scope=\"col\">file</th>"
      "<th scope=\"col\" class=\"number\">bytes</th><th scope=\"col\">SHA-256</th></tr></thead>"
      "<tbody>\n";
  for (const ManifestInput& input : inputs)
    html += "<tr><th scope=\"row\">" + escape_html(input.path) + "</th><td class=\"number\">" +
            std::to_string(input.bytes) + "</td><td><code>" + escape_html(input.sha256) +
            "</code></td></tr>\n";
  return html + "</tbody></table>\n";
}

std::string manifest_html(const Manifest& manifest) {
  Values made = {{"command", "graspmap " + manifest.command}, {"version", manifest.version}};
  if (!manifest.frame.empty()) made.emplace_back("frame", manifest.frame);
  return pair_table("Made by", made) + pair_table("Parameters", manifest.parameters) +
         pair_table("Results", manifest.results) + inputs_table(manifest.inputs);
}

// Command, version, parameters and results; each name occurs once.
Values all_values(const Manifest& manifest) {
  Values values = {{"command", manifest.command}, {"version", manifest.version}};
  values.insert(values.end(), manifest.parameters.begin(), manifest.parameters.end());
  std::unordered_set<std::string> known;
  for (const auto& [name, value] : manifest.parameters) known.insert(name);
  for (const auto& [name, value] : manifest.results)
    if (!known.contains(name)) values.emplace_back(name, value);
  return values;
}

std::string side_by_side(const ReportParameters& parameters) {
  // Values of all manifests by name, in order of appearance; nullopt if a manifest has no value.
  using Cells = std::vector<std::optional<ManifestValue>>;
  std::vector<std::pair<std::string, Cells>> rows;
  std::unordered_map<std::string, std::size_t> row_of;
  for (std::size_t n = 0; n < parameters.outputs.size(); ++n)
    for (auto& [name, value] : all_values(parameters.outputs[n].second)) {
      const auto [row, is_new] = row_of.try_emplace(name, rows.size());
      if (is_new) rows.emplace_back(name, Cells(parameters.outputs.size()));
      std::optional<ManifestValue>& cell = rows[row->second].second[n];
      if (!cell) cell = std::move(value);
    }
  std::string differ;
  Values same;
  for (const auto& [name, values] : rows) {
    std::vector<Value> cells;
    for (const auto& value : values) cells.push_back(value ? to_value(*value) : Value{});
    if (std::all_of(cells.begin(), cells.end(), [&](const Value& c) { return c == cells[0]; })) {
      same.emplace_back(name, *values[0]);
      continue;
    }
    differ += "<tr><th scope=\"row\">" + escape_html(name) + "</th>";
    for (const Value& cell : cells) differ += cell_html({cell.text, cell.title}, true);
    differ += "</tr>\n";
  }
  std::string html = "<table><thead><tr><td></td>";
  for (const auto& [head, manifest] : parameters.outputs)
    html += "<th scope=\"col\" class=\"number\">" + breakable_html(head) + "</th>";
  html += "</tr></thead><tbody>\n" + differ + "</tbody></table>\n";
  html = differ.empty() ? "" : scroll_box(html, "Differences");
  return html + "<details class=\"more\"><summary>Equal in all " +
         std::to_string(parameters.outputs.size()) + " outputs</summary>\n" +
         scroll_box(pair_table("", same), "Equal in all") + "</details>\n";
}

std::string milliseconds(const std::optional<double>& seconds) {
  if (!seconds) return "<td class=\"number\"></td>";
  return cell_html({to_fixed_text(*seconds * 1e3, 1), to_text(*seconds) + " s"}, true);
}

// Total of a case over the rows of `command`, or over all rows if it is empty.
double total_seconds(const TimingTable& table, std::size_t which, const std::string& command) {
  double sum = 0.0;
  for (const TimingRow& row : table.rows)
    if (command.empty() || row.command == command) sum += row.seconds[which].value_or(0.0);
  return sum;
}

std::string sum_row(const TimingTable& table, const std::string& name, const std::string& command) {
  std::string html = "<tr class=\"sum\"><th scope=\"row\">" + escape_html(name) + "</th>";
  for (std::size_t n = 0; n < table.cases.size(); ++n) {
    const double sum = total_seconds(table, n, command);
    html += milliseconds(sum > 0.0 ? std::optional(sum) : std::nullopt);
  }
  return html + "</tr>\n";
}

std::string thread_row(const TimingTable& table) {
  std::string html = "<tr><th scope=\"row\">threads</th>";
  for (const std::vector<unsigned>& threads : table.threads) {
    std::string text;
    for (const unsigned one : threads) text += (text.empty() ? "" : ", ") + std::to_string(one);
    html += cell_html({text, ""}, true);
  }
  return html + "</tr>\n";
}

std::string source_html(const ReportSource& source) {
  if (!source.error.empty())
    return "<p class=\"gap\">" + escape_html(source.output) +
           ": the manifest cannot be read: " + escape_html(source.error) + "</p>\n";
  double seconds = 0.0;
  for (const auto& [step, taken] : source.manifest.timings_s) seconds += taken;
  return "<details><summary><code>" + escape_html(source.output) + "</code> <span>graspmap " +
         escape_html(source.manifest.command) +
         (seconds > 0.0 ? ", " + short_number(seconds) + " s" : "") + "</span></summary>\n" +
         scroll_box(manifest_html(source.manifest), source.output) + "</details>\n";
}

}  // namespace

std::string parameters_html(const ReportParameters& parameters) {
  if (parameters.outputs.size() > 1) return side_by_side(parameters);
  const auto& [head, manifest] = parameters.outputs.front();
  return "<details class=\"more\"><summary>Parameters, results and inputs of " + escape_html(head) +
         "</summary>\n" + scroll_box(manifest_html(manifest), head) + "</details>\n";
}

std::string sources_html(const ReportContent& content) {
  // Outputs are grouped by top-level folder of the run.
  std::vector<std::pair<std::string, std::vector<const ReportSource*>>> groups;
  for (const ReportSource& source : content.sources) {
    const std::size_t slash = source.output.find('/');
    const std::string folder = source.output.substr(0, slash == std::string::npos ? 0 : slash);
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const auto& one) { return one.first == folder; });
    if (group == groups.end()) group = groups.insert(group, {folder, {}});
    group->second.push_back(&source);
  }
  std::string html;
  for (const auto& [folder, sources] : groups) {
    const bool fold = !folder.empty() && groups.size() > 1;
    if (fold)
      html += fmt::format(
          "<details class=\"folder\"><summary><code>{}/</code> <span>{} "
          "output{}</span></summary>\n",
          escape_html(folder), sources.size(), sources.size() == 1 ? "" : "s");
    for (const ReportSource* source : sources) html += source_html(*source);
    if (fold) html += "</details>\n";
  }
  if (content.more_sources > 0)
    html +=
        fmt::format("<p class=\"gap\">{} more outputs are not listed.</p>\n", content.more_sources);
  return html;
}

std::string timings_html(const TimingTable& table) {
  std::string html = "<table class=\"timings\"><thead><tr><th scope=\"col\">step, ms</th>";
  for (const std::string& name : table.cases)
    html += "<th scope=\"col\" class=\"number\">" + breakable_html(name) + "</th>";
  html += "</tr></thead>\n";
  const std::size_t width = 1 + table.cases.size();
  for (std::size_t n = 0; n < table.rows.size(); ++n) {
    const TimingRow& row = table.rows[n];
    if (n == 0 || table.rows[n - 1].command != row.command)
      html += fmt::format(
          "<tbody><tr class=\"group\"><th scope=\"rowgroup\" colspan=\"{}\">{}</th>"
          "</tr>\n",
          width, escape_html(row.command));
    html += "<tr><th scope=\"row\">" + escape_html(row.step) + "</th>";
    for (const auto& seconds : row.seconds) html += milliseconds(seconds);
    html += "</tr>\n";
    if (n + 1 == table.rows.size() || table.rows[n + 1].command != row.command)
      html += sum_row(table, "sum", row.command) + "</tbody>\n";
  }
  // With one command, its sum is already the total.
  const bool several =
      !table.rows.empty() && table.rows.front().command != table.rows.back().command;
  html += "<tbody>" + (several ? sum_row(table, "all steps", "") : "") + thread_row(table) +
          "</tbody></table>\n";
  return html;
}

}  // namespace libmap
