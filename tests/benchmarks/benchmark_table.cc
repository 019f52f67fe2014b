// main() of bench_score: Google Benchmark's own output, and with --table=FILE a table in Markdown.
#include "tests/benchmarks/benchmark_table.h"

#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <string>

namespace {

// A row for each benchmark that ran, from its name, label and counters.
class TableReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.error_occurred) continue;
      const auto cell = [&](const char* name, const char* format) {
        const auto found = run.counters.find(name);
        return found == run.counters.end()
                   ? std::string()
                   : fmt::format(fmt::runtime(format), static_cast<double>(found->second));
      };
      const std::string name = run.run_name.function_name;
      rows_ += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", name, run.report_label,
                           cell("pivots", "{:.0f}"), cell("min_ms", "{:.2f}"),
                           cell("processor_ms", "{:.2f}"), cell("author_ms", "{:.0f}"),
                           cell("speedup", "{:.0f} x"), cell("peak_percent", "{:.0f} %"));
    }
  }
  std::string table() const {
    return "| what | how | pivots | min ms | CPU ms | author's CPU ms | speedup | of peak |\n"
           "|---|---|---|---|---|---|---|---|\n" +
           rows_;
  }

 private:
  std::string rows_;
};

}  // namespace

int main(int argc, char** argv) {
  std::string table_file;
  const std::string flag = "--table=";
  int kept = 0;
  for (int n = 0; n < argc; ++n) {
    if (std::string(argv[n]).rfind(flag, 0) == 0)
      table_file = std::string(argv[n]).substr(flag.size());
    else
      argv[kept++] = argv[n];
  }
  argc = kept;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  TableReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  if (table_file.empty()) return 0;
  std::ofstream out(table_file);
  out << reporter.table();
  if (out) return 0;
  std::cerr << "bench_score: error: " << table_file << ": cannot be written\n";
  return 1;
}
