// How far two yes/no evaluations of the same places agree, beyond what chance alone would give.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "libgtd/evaluate/roc.h"

namespace libgtd {

// Counts of two series of one length, where not 0 is yes: `reference` is what Confusion calls
// positive and negative, `evaluated` what it calls predicted. Throws libmap::Error if the lengths
// differ.
Confusion confusion_of(std::span<const std::uint8_t> evaluated,
                       std::span<const std::uint8_t> reference);

// Cohen's kappa: 1 all agree, 0 as many as chance gives, negative fewer.
struct Kappa {
  double value = 0.0;
  // Of the estimate, for large samples; 0 where all agree or one says the same everywhere. It takes
  // places for independent: neighboring voxels of a map are not, and their kappa is less certain
  // than it says.
  double standard_error = 0.0;
  Interval normal_95;  // value -+ 1.96 standard errors, within -1..1
};

// (po - pe) / (1 - pe), po the share that agrees and pe the one expected of independent
// evaluations with the same shares of yes (Cohen 1960, eq. 1). Its variance (Fleiss, Cohen and
// Everitt 1969, without weights), p_ij the shares of the table, p_i. and p_.j the sums of its rows
// and columns:
//   n (1 - pe)^4 var = sum_i p_ii ((1 - pe) - (p_.i + p_i.) (1 - po))^2
//                      + (1 - po)^2 sum_(i != j) p_ij (p_.i + p_j.)^2 - (po pe - 2 pe + po)^2.
// Nothing where pe is 1 (nothing was evaluated, or both say one and the same everywhere).
std::optional<Kappa> cohens_kappa(const Confusion& counts);

}  // namespace libgtd
