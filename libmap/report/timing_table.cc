#include "libmap/report/timing_table.h"

#include <algorithm>
#include <map>

namespace libmap {

namespace {

std::optional<std::string> name_for(const OutlinePublishedTimes& outline, const std::string& step) {
  for (const auto& [ours, theirs] : outline.rows)
    if (ours == step) return theirs;
  if (outline.rows.empty()) return step;
  return std::nullopt;
}

}  // namespace

TimingTable timing_table(const std::vector<TimingCase>& cases) {
  TimingTable table;
  for (const TimingCase& one : cases) table.cases.push_back(one.name);
  std::map<std::pair<std::string, std::string>, std::size_t> place_of;  // by command and step
  std::map<std::string, std::size_t> rank_of;                           // of a command
  for (std::size_t n = 0; n < cases.size(); ++n) {
    table.manifests.push_back(cases[n].manifests.size());
    std::vector<unsigned>& threads = table.threads.emplace_back();
    for (const Manifest& manifest : cases[n].manifests) {
      if (std::find(threads.begin(), threads.end(), manifest.threads) == threads.end())
        threads.push_back(manifest.threads);
      for (const auto& [step, seconds] : manifest.timings_s) {
        const auto [place, is_new] =
            place_of.try_emplace({manifest.command, step}, table.rows.size());
        rank_of.try_emplace(manifest.command, rank_of.size());
        if (is_new)
          table.rows.push_back(
              {manifest.command, step, std::vector<std::optional<double>>(cases.size()), {}});
        std::optional<double>& cell = table.rows[place->second].seconds[n];
        table.sums = table.sums || cell.has_value();
        cell = cell.value_or(0.0) + seconds;
      }
    }
    std::sort(threads.begin(), threads.end());
  }
  // Those of a command together.
  std::stable_sort(table.rows.begin(), table.rows.end(), [&](const auto& a, const auto& b) {
    return rank_of.at(a.command) < rank_of.at(b.command);
  });
  return table;
}

void add_published_times(const Table& published, const OutlinePublishedTimes& outline,
                         TimingTable& table) {
  constexpr double seconds_a_microsecond = 1e-6;
  const std::size_t names = outline.name_column.empty() ? 0 : published.column(outline.name_column);
  std::vector<std::size_t> columns;
  for (const auto& [name, heading] : outline.columns) {
    columns.push_back(published.column(name));
    table.published.push_back(heading);
  }
  for (TimingRow& row : table.rows) {
    const auto name = name_for(outline, row.step);
    const auto found =
        std::find_if(published.rows.begin(), published.rows.end(),
                     [&](const auto& cells) { return name && cells[names] == *name; });
    for (const std::size_t column : columns) {
      std::optional<double>& cell = row.published_seconds.emplace_back();
      if (found == published.rows.end()) continue;
      cell = published.optional_number(static_cast<std::size_t>(found - published.rows.begin()),
                                       column);
      if (cell) *cell *= seconds_a_microsecond;
    }
  }
}

double total_seconds(const TimingTable& table, std::size_t which, const std::string& command) {
  double sum = 0.0;
  for (const TimingRow& row : table.rows)
    if (command.empty() || row.command == command) sum += row.seconds[which].value_or(0.0);
  return sum;
}

}  // namespace libmap
