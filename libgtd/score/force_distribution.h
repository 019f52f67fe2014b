// Predicts the distribution of a gripper's holding force at a voxel over trials and parameter sets
// from the capacities of the resting columns. Private to libgtd/score.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "libgtd/gripper/closing_path.h"
#include "libgtd/score/tiling.h"

namespace libgtd {

// Bounds the capacities C (force in total closing forces) of `sets` parameter sets by that of
// lateral pulls, and computes their logarithms: 0 if C is not above the floor of capacities.
void bound_capacities(float* capacities, float* logs, std::size_t sets);

// Weighted sums over the resting columns of a voxel.
struct RestSums {
  double contact = 0.0;  // fraction of the azimuths with spine contact on the weakest side
  double rise_m = 0.0;   // height of the palm above the voxel
  double tilt_m = 0.0;   // imbalance of the depths of the contacts
  double weights = 0.0;  // > 0
};

// Sums over columns per parameter set: weights, ln C and its square of columns with a capacity, and
// C of all columns.
struct SetSums {
  std::vector<float> weights, logs, squares, capacities;

  explicit SetSums(std::size_t sets) : weights(sets), logs(sets), squares(sets), capacities(sets) {}
  void clear() {
    for (auto* sums : {&weights, &logs, &squares, &capacities})
      std::fill(sums->begin(), sums->end(), 0.0F);
  }
};

// Distribution of the force per set: > 0 with `probability`; its logarithm is then beta(4, 2).
struct SetForces {
  std::vector<float> probability, log_force, spread, scale;  // scale: beta_spread / spread
};

// Logarithms of forces, or values at these forces.
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
  std::vector<float> weights_;    // of the parameter sets
  std::vector<float> log_scale_;  // ln of the closing force of all fingers, N
  ForceGrid log_forces_{};        // of equally spaced forces, then of the load
  SetSums sums_;
  SetForces forces_;
};

}  // namespace libgtd
