// Predicts the distribution of a gripper's holding force at a voxel over trials and parameter sets,
// from capacities of resting columns (near the voxel; the gripper may rest on each). Capacity:
// holding force on the column / closing force of all fingers. Private to libgtd/score.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "libgtd/gripper/closing_path.h"
#include "libgtd/score/tiling.h"

namespace libgtd {

// Replaces the capacities C of a column, one per parameter set, by C / sqrt(1 + (C / 0.55)^2),
// which is below 0.55. Writes ln C to `logs`, or 0 for C <= 0.0005 (no force).
void bound_capacities(float* capacities, float* logs, std::size_t sets);

// Weighted sums over the resting columns of a voxel.
struct RestSums {
  double contact = 0.0;  // fraction of azimuths with spine contact, on the side with the fewest
  double rise_m = 0.0;   // height of the palm above the voxel
  double tilt_m = 0.0;   // norm of the mean of (depth times outward direction) of contacts
  double weights = 0.0;  // sum of the weights, > 0
};

// Weighted sums over the columns, one per parameter set. capacities: sum of C. weights, logs,
// squares: sums of 1, ln C and (ln C)^2 over the columns with C > 0.0005.
struct SetSums {
  std::vector<float> weights, logs, squares, capacities;

  explicit SetSums(std::size_t sets) : weights(sets), logs(sets), squares(sets), capacities(sets) {}
  void clear() {
    for (auto* sums : {&weights, &logs, &squares, &capacities})
      std::fill(sums->begin(), sums->end(), 0.0F);
  }
};

// Distribution of the force F per parameter set: F > 0 with `probability`. ln F then has the mean
// log_force and standard deviation `spread`; scale * ln F + constant is beta(4, 2) distributed.
struct SetForces {
  std::vector<float> probability, log_force, spread, scale;
};

// Logarithms of 48 forces, or values of a function at these forces.
using ForceGrid = std::array<float, 48>;

class ForceDistribution {
 public:
  // Keeps a reference to `path`.
  explicit ForceDistribution(const ClosingPath& path);

  // Removes all columns.
  void clear();
  // Adds a resting column with its bounded capacities and their logarithms, one per parameter set.
  void add_column(const float* capacities, const float* logs, float weight);
  // Returns the distribution over the columns added since clear().
  ForceEstimate estimate(const RestSums& rests);

 private:
  const ClosingPath& path_;
  std::vector<float> weights_;    // weights of the parameter sets
  std::vector<float> log_scale_;  // ln of the closing force of all fingers, N
  ForceGrid log_forces_{};        // 47 equally spaced values, then ln(load)
  SetSums sums_;
  SetForces forces_;
};

}  // namespace libgtd
