#include "libgtd/evaluate/hold_model_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

#include "libgtd/evaluate/roc_tables.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr Eigen::Index weights = 5;  // of the constant and of each term
constexpr double ridge = 1e-6;

struct FitSample {
  std::vector<Eigen::Matrix<double, weights, 1>> terms;  // signs as in HoldModel
  std::vector<double> labels;                            // 0 or 1
};

using Weights = Eigen::Matrix<double, weights, 1>;
using Square = Eigen::Matrix<double, weights, weights>;

// The weights that are not `free` are 0.
Weights fit(const FitSample& sample, const std::array<bool, weights>& free) {
  const auto count = static_cast<double>(sample.terms.size());
  Weights found = Weights::Zero();
  constexpr int max_steps = 100;
  for (int step = 0; step < max_steps; ++step) {
    Square hessian = Square::Identity() * (ridge * count);
    Weights gradient = -ridge * count * found;
    for (std::size_t n = 0; n < sample.terms.size(); ++n) {
      const double expected = 1.0 / (1.0 + std::exp(-sample.terms[n].dot(found)));
      gradient += (sample.labels[n] - expected) * sample.terms[n];
      hessian += expected * (1.0 - expected) * sample.terms[n] * sample.terms[n].transpose();
    }
    for (Eigen::Index n = 0; n < weights; ++n) {
      if (free[static_cast<std::size_t>(n)]) continue;
      gradient[n] = 0.0;
      hessian.row(n).setZero();
      hessian.col(n).setZero();
      hessian(n, n) = 1.0;
    }
    const Weights change = hessian.ldlt().solve(gradient);
    found += change;
    if (change.cwiseAbs().maxCoeff() < 1e-10) break;
  }
  return found;
}

// Four digits: more would say nothing of such a fit.
double rounded(double value) {
  if (value == 0.0) return 0.0;
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

}  // namespace

HoldModelFit fit_hold_model(const libmap::Table& table, const std::string& label_column,
                            double load_n) {
  const std::size_t target = table.column(label_column);
  const std::array columns = {table.column("closing_contact"), table.column("closing_bearing"),
                              table.column("closing_rise"), table.column("closing_depth")};
  HoldModelFit result;
  FitSample sample;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::optional<bool> label = label_at(table, row, target);
    Weights terms = Weights::Ones();
    bool is_whole = label.has_value();
    for (std::size_t n = 0; n < columns.size(); ++n) {
      const auto value = table.optional_number(row, columns[n]);
      is_whole &= value.has_value();
      const double sign = n < 2 ? 1.0 : -1.0;
      terms[static_cast<Eigen::Index>(n) + 1] = sign * value.value_or(0.0);
    }
    if (!is_whole || !terms.allFinite()) {
      ++result.left_out;
      continue;
    }
    sample.terms.push_back(terms);
    sample.labels.push_back(*label ? 1.0 : 0.0);
  }
  result.places = sample.terms.size();
  constexpr std::size_t min_places = 10;
  if (result.places < min_places)
    throw libmap::Error(
        "too few places for a fit",
        {.file = table.file, .value = std::to_string(result.places), .bound = ">= 10"});
  std::array<bool, weights> free{true, true, true, true, true};
  Weights found = fit(sample, free);
  for (bool changed = true; changed;) {
    changed = false;
    for (Eigen::Index n = 1; n < weights; ++n)
      if (found[n] < 0.0) {
        free[static_cast<std::size_t>(n)] = false;
        changed = true;
      }
    if (changed) found = fit(sample, free);
  }
  result.model = {.load_n = load_n,
                  .intercept = rounded(found[0]),
                  .contact = rounded(found[1]),
                  .bearing = rounded(found[2]),
                  .rise = rounded(found[3]),
                  .depth = rounded(found[4])};
  return result;
}

std::string to_yaml_section(const HoldModel& model) {
  std::string text = "hold_model:\n";
  for (const auto& [key, value] : {std::pair{"load_n", model.load_n},
                                   {"intercept", model.intercept},
                                   {"contact", model.contact},
                                   {"bearing", model.bearing},
                                   {"rise", model.rise},
                                   {"depth", model.depth}})
    text += std::string("  ") + key + ": " + libmap::to_text(value) + "\n";
  return text;
}

}  // namespace libgtd
