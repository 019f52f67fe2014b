// Running times of a run: each step by each case, as the tables 4-2 and 4-3 of the thesis.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libmap/core/manifest.h"
#include "libmap/core/table.h"
#include "libmap/report/outline.h"

namespace libmap {

struct TimingRow {
  std::string command;
  std::string step;
  std::vector<std::optional<double>> seconds;            // one a case
  std::vector<std::optional<double>> published_seconds;  // one a published column
};

struct TimingTable {
  std::vector<std::string> cases;
  std::vector<std::string> published;  // headings
  std::vector<TimingRow> rows;         // by command and step, as they first came
  // For each case: the number of manifests, and the numbers of threads that they ran with.
  std::vector<std::size_t> manifests;
  std::vector<std::vector<unsigned>> threads;
  // Steps that several manifests of one case name were added up.
  bool sums = false;
};

struct TimingCase {
  std::string name;
  std::vector<Manifest> manifests;
};

// The steps of the manifests, those of one name and command in one case added up.
TimingTable timing_table(const std::vector<TimingCase>& cases);

// Adds columns of microseconds of `published`. Throws Error naming the table's file: a column that
// is not there, a cell that is no number.
void add_published_times(const Table& published, const OutlinePublishedTimes& outline,
                         TimingTable& table);

// The sum of a case over the rows of `command`, or of all for an empty name.
double total_seconds(const TimingTable& table, std::size_t which, const std::string& command = {});

}  // namespace libmap
