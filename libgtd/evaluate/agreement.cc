#include "libgtd/evaluate/agreement.h"

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

Confusion sum_of(Confusion a, const Confusion& b) {
  a.true_positives += b.true_positives;
  a.false_positives += b.false_positives;
  a.true_negatives += b.true_negatives;
  a.false_negatives += b.false_negatives;
  return a;
}

double squared(double value) { return value * value; }

}  // namespace

Confusion confusion_of(std::span<const std::uint8_t> evaluated,
                       std::span<const std::uint8_t> reference) {
  if (evaluated.size() != reference.size())
    throw libmap::Error("the series differ in length", {.field = "evaluated",
                                                        .value = std::to_string(evaluated.size()),
                                                        .bound = std::to_string(reference.size())});
  return libmap::parallel_reduce(
      evaluated.size(), 1 << 16, Confusion{},
      [&](std::size_t begin, std::size_t end) {
        Confusion part;
        for (std::size_t n = begin; n < end; ++n) part.add(reference[n] != 0, evaluated[n] != 0);
        return part;
      },
      sum_of);
}

std::optional<Kappa> cohens_kappa(const Confusion& counts) {
  const Rate evaluated_yes{counts.predicted_positives(), counts.size()};
  const Rate reference_yes{counts.positives(), counts.size()};
  const auto says_one_thing = [](const Rate& yes) {
    return yes.count == 0 || yes.count == yes.total;
  };
  if (says_one_thing(evaluated_yes) && says_one_thing(reference_yes) &&
      (evaluated_yes.count == 0) == (reference_yes.count == 0))
    return std::nullopt;
  const double n = static_cast<double>(counts.size());
  const auto share = [n](std::size_t count) { return static_cast<double>(count) / n; };
  // Cells p[evaluated][reference] and their sums over rows and columns; 1 is yes.
  const double p[2][2] = {{share(counts.true_negatives), share(counts.false_negatives)},
                          {share(counts.false_positives), share(counts.true_positives)}};
  const double evaluated[2] = {share(counts.predicted_negatives()), *evaluated_yes.value()};
  const double reference[2] = {share(counts.negatives()), *reference_yes.value()};
  const double po = share(counts.true_positives + counts.true_negatives);
  const double pe = evaluated[0] * reference[0] + evaluated[1] * reference[1];
  double sum = -squared(po * pe - 2.0 * pe + po);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      sum += p[i][j] * (i == j ? squared((1.0 - pe) - (reference[i] + evaluated[i]) * (1.0 - po))
                               : squared((1.0 - po) * (reference[i] + evaluated[j])));
  Kappa kappa;
  // Where the result is known, rounding shall not blur it.
  if (counts.false_positives + counts.false_negatives == 0) {
    kappa.value = 1.0;
  } else if (!says_one_thing(evaluated_yes) && !says_one_thing(reference_yes)) {
    kappa.value = (po - pe) / (1.0 - pe);
    kappa.standard_error = std::sqrt(std::max(0.0, sum) / n) / squared(1.0 - pe);
  }
  const double half = 1.959963984540054 * kappa.standard_error;
  kappa.normal_95 = {std::max(-1.0, kappa.value - half), std::min(1.0, kappa.value + half)};
  return kappa;
}

}  // namespace libgtd
