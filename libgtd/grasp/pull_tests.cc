#include <optional>
#include <utility>

#include "libgtd/grasp/pull_fit.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

libmap::Error wrong_row(const libmap::Table& table, std::size_t row, const std::string& column,
                        const std::string& value, const std::string& reason,
                        const std::string& bound) {
  return libmap::Error(reason, {.file = table.file,
                                .field = "row " + std::to_string(row + 1) + ", " + column,
                                .value = value,
                                .bound = bound});
}

// Reads one row of a table of pull tests.
class PullReader {
 public:
  explicit PullReader(const libmap::Table& table) : table_(table) {}

  PullTest read(std::size_t row) const {
    PullTest test;
    test.row = row + 1;
    test.on_level_ground = is_level(row);
    if (!test.on_level_ground)
      for (const auto& [name, axis] : {std::pair{"x", 0}, {"y", 1}, {"z", 2}})
        test.location[axis] = required(row, name);
    test.tilt_deg = within(row, "tilt_deg", 0.0, 90.0).value_or(0.0);
    test.azimuth_deg = within(row, "azimuth_deg", -360.0, 360.0).value_or(0.0);
    test.force_n = within(row, "force_n", 0.0, 1e5);
    const auto load = within(row, "load_n", 0.0, 1e5);
    const auto held = within(row, "held", 0.0, 1.0);
    if (test.force_n) {
      if (held)
        throw wrong_row(table_, row, "held", libmap::to_text(*held),
                        "force_n and held exclude each other", "empty");
      return test;
    }
    if (!held)
      throw wrong_row(table_, row, "force_n", "", "no result", "force_n, or load_n and held");
    if (!load || !(*load > 0.0))
      throw wrong_row(table_, row, "load_n", load ? libmap::to_text(*load) : "",
                      "held requires a load", "> 0");
    test.load_n = *load;
    test.held = *held >= 0.5;
    return test;
  }

 private:
  bool is_level(std::size_t row) const {
    const auto column = table_.find_column("ground");
    const std::string text = column ? table_.rows[row][*column] : "";
    if (text.empty() || text == "level") return text == "level";
    throw wrong_row(table_, row, "ground", text, "unknown", "level, or empty");
  }
  std::optional<double> within(std::size_t row, const char* name, double low, double high) const {
    const auto column = table_.find_column(name);
    const auto value = column ? table_.optional_number(row, *column) : std::nullopt;
    if (value && !(*value >= low && *value <= high))
      throw wrong_row(table_, row, name, libmap::to_text(*value), "out of range",
                      libmap::describe(libmap::Range{low, high}));
    return value;
  }
  double required(std::size_t row, const char* name) const {
    const auto value = within(row, name, -1e9, 1e9);
    if (!value) throw wrong_row(table_, row, name, "", "no location", "x, y, z, or ground = level");
    return *value;
  }

  const libmap::Table& table_;
};

}  // namespace

std::vector<PullTest> pull_tests_of(const libmap::Table& table) {
  if (table.rows.empty()) throw libmap::no_elements("pull tests", table.file);
  const PullReader reader(table);
  std::vector<PullTest> tests;
  for (std::size_t row = 0; row < table.rows.size(); ++row) tests.push_back(reader.read(row));
  return tests;
}

}  // namespace libgtd
