#include "libgtd/score/closing_force.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "libgtd/gripper/target_clones.h"
#include "libgtd/score/scanned_area.h"
#include "libmap/core/angle.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

constexpr int azimuths = 16;
constexpr int gap_columns = 3;
constexpr int closing_block_columns = 64;
// The open finger rests on the ground. Only ground that is higher by more than this (rounding)
// stops it.
constexpr double palm_clearance_m = 1e-5;
constexpr double unknown = -std::numeric_limits<double>::infinity();
// Standard deviation of the resting position, in finger lengths, of a normal distribution truncated
// at twice this value. It covers pose and tilt of the palm, azimuths of the fingers and width of a
// column. With this value the verdicts of the virtual field test on the fitted sites are nearly as
// likely as with any larger one.
constexpr double spread = 0.25;
constexpr double max_deviations = 2.0;

// Coefficients fitted to trials of the virtual field test (grasp) on simulated rocks, slopes, walls
// and shapes with the three grippers and 16 parameter sets of each, by the likelihood that a trial
// reaches each of nine loads. c is the mean of the capacities C of the columns, p the fraction of
// columns with C > floor_of_capacity; mean and spread of ln C are over these. v is the spread of a
// finger's pull on level ground (FingerPulls::level_spreads):
//   P(force > 0) = logistic(1.234 + 1.623 p + 3.988 contact + 0.679 ln(c + offset) - 1.203 v),
//   mean ln(force / closing forces) = 0.293 + 1.006 mean(ln C) - 0.446 rise + 0.663 tilt - 0.537 v,
//   ln(spread of ln force) = -1.540 + 1.056 spread(ln C) + 0.745 v.
// contact: fraction of the azimuths with spine contact on the weakest side; rise of the palm above
// the voxel, and tilt: imbalance of the depths of the contacts, both in finger lengths. The weakest
// of several random pulls decreases with their spread, hence v.
constexpr float floor_of_capacity = 0.0005F;
constexpr float offset_of_capacity = 0.003F;
constexpr float largest_capacity = 0.55F;
// Distribution of ln(force) between trials: beta(4, 2), skewed to small forces. Its standard
// deviation, and its mean from the upper end.
constexpr float beta_spread = 0.17817416F;
constexpr float beta_mean = 1.0F / 3.0F;
// Number of forces at which the distribution over all sets is computed: from 0.2 N to 1.3 kN, and
// the load.
constexpr std::size_t force_steps = 48;
constexpr float first_log_force = -1.6F;
constexpr float log_force_step = 0.19F;

constexpr std::array<double, 5> dual_steps{0.0, 0.5, 1.0, 2.0, 4.0};  // u of the capacity's dual

// Position relative to a pivot as a column, for one azimuth.
struct RayCell {
  int i = 0;
  int j = 0;
  double depth = 0.0;  // below the palm
  bool has_spines = false;
};

struct Rest {
  RayCell cell;
  double weight = 0.0;
};

struct Rays {
  std::vector<Rest> rests;    // possible resting columns
  std::vector<RayCell> palm;  // depth 0
  std::vector<RayCell> open;  // all azimuths
  std::array<std::vector<RayCell>, azimuths> closing;
  std::array<Eigen::Vector2d, azimuths> outward;
  // Weights per side and azimuth: of the half plane (sum 1), of the duals, of pulls and of pushes.
  using BySide = std::array<float, azimuths>;
  std::array<BySide, azimuths> half{};
  std::array<std::array<BySide, azimuths>, dual_steps.size()> pull{};
  std::array<std::array<BySide, azimuths>, dual_steps.size()> push{};
};

// Returns true if no earlier position in this column is as deep. Otherwise that position would have
// met the ground.
bool is_new(const std::vector<RayCell>& cells, const RayCell& next) {
  return std::none_of(cells.begin(), cells.end(), [&](const RayCell& cell) {
    return cell.i == next.i && cell.j == next.j && cell.depth >= next.depth;
  });
}

int rest_columns(const ClosingPath& path, double voxel_size_m) {
  return static_cast<int>(max_deviations * spread * path.finger_length_m / voxel_size_m);
}

Rays make_rays(const ClosingPath& path, double voxel_size_m) {
  Rays rays;
  const double sigma = spread * path.finger_length_m / voxel_size_m;  // in columns
  const int farthest = rest_columns(path, voxel_size_m);
  for (int i = -farthest; i <= farthest; ++i)
    for (int j = -farthest; j <= farthest; ++j)
      // Every second column, because neighbors are similar.
      if (const double distance = std::hypot(i, j) / sigma;
          distance <= max_deviations && (i + j) % 2 == 0)
        rays.rests.push_back({{i, j}, std::exp(-0.5 * distance * distance)});
  const int palm = static_cast<int>(std::ceil(path.palm_radius_m / voxel_size_m));
  for (int i = -palm; i <= palm; ++i)
    for (int j = -palm; j <= palm; ++j)
      if (std::hypot(i, j) * voxel_size_m <= path.palm_radius_m) rays.palm.push_back({i, j});
  for (int a = 0; a < azimuths; ++a) {
    const double angle = 2.0 * std::numbers::pi * a / azimuths;
    rays.outward[static_cast<std::size_t>(a)] = {std::cos(angle), std::sin(angle)};
    const auto cell = [&](const ClosingPath::PathPoint& point) {
      return RayCell{static_cast<int>(std::lround(point.radius_m * std::cos(angle) / voxel_size_m)),
                     static_cast<int>(std::lround(point.radius_m * std::sin(angle) / voxel_size_m)),
                     point.depth_m, point.has_spines};
    };
    for (const ClosingPath::PathPoint& point : path.open) rays.open.push_back(cell(point));
    for (const ClosingPath::PathPoint& point : path.closing)
      if (const RayCell next = cell(point); is_new(rays.closing[static_cast<std::size_t>(a)], next))
        rays.closing[static_cast<std::size_t>(a)].push_back(next);
  }
  double sum = 0.0;  // of a half plane
  for (int a = 0; a < azimuths; ++a)
    sum += std::max(0.0, std::cos(2.0 * std::numbers::pi * a / azimuths));
  for (std::size_t a = 0; a < azimuths; ++a)
    for (std::size_t side = 0; side < azimuths; ++side) {
      const double from_side = static_cast<double>(a) - static_cast<double>(side);
      const double cosine = std::cos(2.0 * std::numbers::pi * from_side / azimuths);
      rays.half[a][side] = static_cast<float>(std::max(0.0, cosine) / sum);
      for (std::size_t u = 0; u < dual_steps.size(); ++u) {
        const double weight = (1.0 - dual_steps[u] * cosine) / azimuths;
        rays.pull[u][a][side] = static_cast<float>(std::max(0.0, weight));
        rays.push[u][a][side] = static_cast<float>(std::max(0.0, -weight));
      }
    }
  return rays;
}

// Heights and gradients of a rectangle of columns.
class Heights {
 public:
  Heights(const VoxelGrid& grid, const TileBounds& bounds)
      : bounds_(bounds), width_(bounds.j_end - bounds.j_begin) {
    const auto size =
        static_cast<std::size_t>(bounds.i_end - bounds.i_begin) * static_cast<std::size_t>(width_);
    heights_.assign(size, unknown);
    // In voxels from the origin of the lattice. Voxels ascend, so that the highest of a column is
    // last.
    visit_columns(grid, bounds, [&](std::size_t at) {
      const Voxel& voxel = grid.voxels[at];
      heights_[index(voxel.i, voxel.j)] = (voxel.k + 0.5) * grid.lattice.voxel_size_m;
    });
    for (int round = 0; round < gap_columns; ++round) fill_gaps();
    find_falls(grid.lattice.voxel_size_m);
  }

  std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(i - bounds_.i_begin) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(j - bounds_.j_begin);
  }
  std::ptrdiff_t step(const RayCell& cell) const {
    return static_cast<std::ptrdiff_t>(cell.i) * width_ + cell.j;
  }
  std::size_t size() const { return heights_.size(); }
  double height(std::size_t at) const { return heights_[at]; }
  // Fall from the first cell with ground around a column to the lowest cell.
  double fall(std::size_t at, const std::vector<RayCell>& cells) const {
    double first = unknown;
    double lowest = std::numeric_limits<double>::infinity();
    for (const RayCell& cell : cells) {
      const double height = heights_[at + static_cast<std::size_t>(step(cell))];
      if (height == unknown) continue;
      if (first == unknown) first = height;
      lowest = std::min(lowest, height);
    }
    return first == unknown ? 0.0 : first - lowest;
  }
  // dz/dx and dz/dy
  const std::array<double, 2>& rise(std::size_t at) const { return rises_[at]; }

 private:
  void fill_gaps() {
    std::vector<double> filled = heights_;
    const int rows = bounds_.i_end - bounds_.i_begin;
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < width_; ++j) {
        const auto at = static_cast<std::size_t>(i) * static_cast<std::size_t>(width_) +
                        static_cast<std::size_t>(j);
        if (heights_[at] != unknown) continue;
        double sum = 0.0;
        int count = 0;
        for (int di = std::max(i - 1, 0); di <= std::min(i + 1, rows - 1); ++di)
          for (int dj = std::max(j - 1, 0); dj <= std::min(j + 1, width_ - 1); ++dj) {
            const double height =
                heights_[static_cast<std::size_t>(di) * static_cast<std::size_t>(width_) +
                         static_cast<std::size_t>(dj)];
            if (height == unknown) continue;
            sum += height;
            ++count;
          }
        if (count > 0) filled[at] = sum / count;
      }
    heights_ = std::move(filled);
  }

  void find_falls(double voxel_size_m) {
    rises_.assign(heights_.size(), {0.0, 0.0});
    const auto between = [&](std::size_t low, std::size_t high) {
      if (heights_[low] == unknown || heights_[high] == unknown) return 0.0;
      return (heights_[high] - heights_[low]) / (2.0 * voxel_size_m);
    };
    const auto width = static_cast<std::size_t>(width_);
    for (std::size_t at = width + 1; at + width + 1 < heights_.size(); ++at)
      rises_[at] = {between(at - width, at + width), between(at - 1, at + 1)};
  }

  TileBounds bounds_;
  int width_ = 0;
  std::vector<double> heights_;
  std::vector<std::array<double, 2>> rises_;
};

// sums += weight * values
GRASPMAP_CLONED void add_scaled(const float* __restrict values, float weight,
                                float* __restrict sums, std::size_t count) {
  for (std::size_t n = 0; n < count; ++n) sums[n] += weight * values[n];
}

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

// Adds a column. `logs` is 0 if a capacity is not above the floor.
GRASPMAP_CLONED_CHOICE void add_column(const float* __restrict capacities,
                                       const float* __restrict logs, float weight, SetSums& sums) {
  float* __restrict weights = sums.weights.data();
  float* __restrict sum = sums.logs.data();
  float* __restrict squares = sums.squares.data();
  float* __restrict all = sums.capacities.data();
  const std::size_t sets = sums.weights.size();
  for (std::size_t s = 0; s < sets; ++s) {
    weights[s] += capacities[s] > floor_of_capacity ? weight : 0.0F;
    sum[s] += weight * logs[s];
    squares[s] += weight * logs[s] * logs[s];
    all[s] += weight * capacities[s];
  }
}

// Distribution of the force per set: > 0 with `probability`; its logarithm is then beta(4, 2).
struct SetForces {
  std::vector<float> probability, log_force, spread, scale;  // scale: beta_spread / spread
};

// exp and ln with error 2e-4, vectorizable.
[[gnu::always_inline]] inline float quick_exp(float x) {
  const float power = x * 1.44269504F + 127.0F;  // power of 2, biased
  const auto whole = static_cast<std::int32_t>(power);
  const float part = power - static_cast<float>(whole);
  const float scale = std::bit_cast<float>(whole << 23);
  return scale * (1.0F + part * (0.6957F + part * (0.2261F + part * 0.0782F)));
}
[[gnu::always_inline]] inline float quick_log(float x) {
  const auto bits = std::bit_cast<std::int32_t>(x);
  const auto power = static_cast<float>((bits >> 23) - 127);
  const float part = std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000) - 1.0F;
  return 0.69314718F * power +
         part * (0.99949F +
                 part * (-0.49190F + part * (0.28947F + part * (-0.13606F + part * 0.03215F))));
}

// Applies the bound of lateral pulls to capacities. Computes their logarithms, 0 up to the floor.
GRASPMAP_CLONED_CHOICE void bound_capacities(float* __restrict capacities, float* __restrict logs,
                                             std::size_t sets) {
  for (std::size_t s = 0; s < sets; ++s) {
    const float ratio = capacities[s] / largest_capacity;
    const float bounded = capacities[s] / std::sqrt(1.0F + ratio * ratio);
    capacities[s] = bounded;
    logs[s] = bounded > floor_of_capacity ? quick_log(bounded) : 0.0F;
  }
}

// Means over the columns for find_forces, which computes the distribution of the force of each set.
struct MeanTerms {
  float contact = 0.0F;
  float bias = 0.0F;     // terms of rise and tilt in ln(force)
  float weights = 0.0F;  // sum over all columns
};
GRASPMAP_CLONED_CHOICE void find_forces(const SetSums& sums, const MeanTerms& mean,
                                        const float* __restrict log_scale,
                                        const float* __restrict pull_spreads, SetForces& forces) {
  const float* __restrict weights = sums.weights.data();
  const float* __restrict logs = sums.logs.data();
  const float* __restrict squares = sums.squares.data();
  const float* __restrict capacities = sums.capacities.data();
  float* __restrict probability = forces.probability.data();
  float* __restrict log_force = forces.log_force.data();
  float* __restrict level_spreads = forces.spread.data();
  float* __restrict scale = forces.scale.data();
  const std::size_t sets = sums.weights.size();
  for (std::size_t s = 0; s < sets; ++s) {
    const bool has_force = weights[s] > 0.0F;
    const float count = has_force ? weights[s] : 1.0F;
    const float log = logs[s] / count;
    const float variance = squares[s] / count - log * log;
    const float spread = std::sqrt(variance > 0.0F ? variance : 0.0F);
    const float logit = 1.234F + 1.623F * count / mean.weights + 3.988F * mean.contact +
                        0.679F * quick_log(capacities[s] / mean.weights + offset_of_capacity) -
                        1.203F * pull_spreads[s];
    probability[s] = has_force ? 1.0F / (1.0F + quick_exp(-logit)) : 0.0F;
    log_force[s] = log_scale[s] + mean.bias + 1.006F * log - 0.537F * pull_spreads[s];
    const float log_spread = -1.540F + 1.056F * spread + 0.745F * pull_spreads[s];
    const float low = log_spread > -3.0F ? log_spread : -3.0F;
    level_spreads[s] = quick_exp(low < 1.0F ? low : 1.0F);
    scale[s] = beta_spread / level_spreads[s];
  }
}

// P(force >= exp(log_forces[n])) over all sets, for each n.
using ForceGrid = std::array<float, force_steps>;
GRASPMAP_CLONED_CHOICE void find_survivals(const float* weights, const SetForces& forces,
                                           const ForceGrid& log_forces, ForceGrid& survivals) {
  float sums[force_steps] = {};
  float at[force_steps];
  std::copy(log_forces.begin(), log_forces.end(), std::begin(at));
  const std::size_t sets = forces.probability.size();
  for (std::size_t s = 0; s < sets; ++s) {
    const float weight = weights[s] * forces.probability[s];
    const float scale = forces.scale[s];
    const float start = beta_mean + forces.log_force[s] * scale;
    for (std::size_t n = 0; n < force_steps; ++n) {
      const float fraction = start - at[n] * scale;
      const float below_one = fraction < 1.0F ? fraction : 1.0F;
      const float t = below_one > 0.0F ? below_one : 0.0F;
      sums[n] += weight * t * t * (10.0F + t * (-20.0F + t * (15.0F - 4.0F * t)));
    }
  }
  std::copy(std::begin(sums), std::end(sums), survivals.begin());
}

// sums[side] += sum over the azimuths of values * weights
using SideValues = std::array<float, azimuths>;
void add_side_values(const std::array<SideValues, azimuths>& weights, const SideValues& values,
                     SideValues& sums) {
  for (std::size_t a = 0; a < azimuths; ++a)
    if (values[a] != 0.0F) add_scaled(weights[a].data(), values[a], sums.data(), azimuths);
}

// Follows the fingers at the pivots of one block.
class BlockCloser {
 public:
  BlockCloser(const Heights& heights, const Rays& rays, const ClosingPath& path)
      : heights_(heights),
        rays_(rays),
        path_(path),
        sets_(path.pulls.sets),
        met_(heights.size()),
        sums_(sets_) {
    for (const RayCell& cell : rays.palm) palm_.push_back(heights.step(cell));
    for (const RayCell& cell : rays.open) open_.push_back(heights.step(cell));
    for (std::size_t a = 0; a < azimuths; ++a)
      for (const RayCell& cell : rays.closing[a]) closing_[a].push_back(heights.step(cell));
    for (auto* values : {&forces_.probability, &forces_.log_force, &forces_.spread, &forces_.scale})
      values->resize(sets_);
    scratch_.resize(sets_);
    for (const double force : path.pulls.total_closing_forces_n)
      log_scale_.push_back(static_cast<float>(std::log(force)));
    for (std::size_t n = 0; n < force_steps; ++n)
      log_forces_[n] = first_log_force + static_cast<float>(n) * log_force_step;
    log_forces_.back() = static_cast<float>(std::log(path.load_n));
    for (const ParameterSet& set : path.sets) weights_.push_back(static_cast<float>(set.weight));
  }

  // Requires ground in the column of the pivot.
  ForceEstimate force(std::size_t pivot, double pivot_height) {
    Met mean;
    double weights = 0.0;
    sums_.clear();
    for (const Rest& rest : rays_.rests) {
      const std::size_t at = pivot + static_cast<std::size_t>(heights_.step(rest.cell));
      if (heights_.height(at) == unknown) continue;
      const Met& met = met_at(at);
      mean.contact += rest.weight * met.contact;
      mean.palm += rest.weight * (met.palm - pivot_height);
      mean.tilt += rest.weight * met.tilt;
      add_column(&capacities_[met.at], &logs_[met.at], static_cast<float>(rest.weight), sums_);
      weights += rest.weight;
    }
    const double lengths = weights * path_.finger_length_m;
    find_forces(
        sums_,
        {.contact = static_cast<float>(mean.contact / weights),
         .bias = static_cast<float>(0.293 + (0.663 * mean.tilt - 0.446 * mean.palm) / lengths),
         .weights = static_cast<float>(weights)},
        log_scale_.data(), path_.pulls.level_spreads.data(), forces_);
    return estimate();
  }

 private:
  // State of a gripper at rest on a column.
  struct Met {
    double contact = 0.0;
    double palm = 0.0;   // height, m
    double tilt = 0.0;   // m
    std::size_t at = 0;  // offset of its capacities and their logarithms
  };
  struct Contacts {
    SideValues are_there{};  // 1 with contact, else 0
    std::array<int, azimuths> fall_deg{};
    SideValues upright{};  // cosine of the fall
  };

  const Met& met_at(std::size_t at) {
    std::optional<Met>& met = met_[at];
    if (!met) met = close_on(at);
    return *met;
  }

  Met close_on(std::size_t at_rest) {
    const double palm = palm_height(at_rest);
    Contacts contacts;
    Met met;
    double touching = 0.0;
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    for (std::size_t a = 0; a < azimuths; ++a) {
      const RayCell* cell = nullptr;
      const std::size_t at = first_contact(at_rest, palm, a, cell);
      if (cell == nullptr || !cell->has_spines) continue;
      contacts.are_there[a] = 1.0F;
      touching += 1.0;
      const Eigen::Vector2d& outward = rays_.outward[a];
      moment += cell->depth * outward;
      const auto& [along_x, along_y] = heights_.rise(at);
      const double fall = std::atan(-outward.dot(Eigen::Vector2d(along_x, along_y)));
      contacts.fall_deg[a] = static_cast<int>(std::lround(fall / libmap::radians_per_degree));
      contacts.upright[a] = static_cast<float>(std::cos(fall));
    }
    met.palm = palm;
    met.tilt = touching > 0.0 ? moment.norm() / touching : 0.0;
    SideValues sides{};
    add_side_values(rays_.half, contacts.are_there, sides);
    met.contact = *std::min_element(sides.begin(), sides.end());
    met.at = capacities_.size();
    capacities_.resize(met.at + sets_);
    logs_.resize(met.at + sets_);
    if (touching > 0.0) find_capacities(contacts, &capacities_[met.at], &logs_[met.at]);
    return met;
  }

  // Weakest side for the parameters of the gripper file; used for all sets, because the pulls of
  // each set increase with the fall.
  std::size_t weakest_side(const Contacts& contacts) const {
    SideValues pulls{};
    SideValues max_spine_forces{};
    for (std::size_t a = 0; a < azimuths; ++a) {
      if (contacts.are_there[a] == 0.0F) continue;
      pulls[a] = path_.nominal_pulls.at(contacts.fall_deg[a])[0];
      max_spine_forces[a] = contacts.upright[a] * path_.nominal_pulls.max_spine_forces[0];
    }
    std::size_t weakest = 0;
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t u = 0; u < dual_steps.size(); ++u) {
      SideValues sums{};
      add_side_values(rays_.pull[u], pulls, sums);
      add_side_values(rays_.push[u], max_spine_forces, sums);
      const auto here = std::min_element(sums.begin(), sums.end());
      if (*here >= least) continue;
      least = *here;
      weakest = static_cast<std::size_t>(here - sums.begin());
    }
    return weakest;
  }

  void find_capacities(const Contacts& contacts, float* capacities, float* logs) {
    const std::size_t side = weakest_side(contacts);
    std::fill_n(capacities, sets_, std::numeric_limits<float>::infinity());
    for (std::size_t u = 0; u < dual_steps.size(); ++u) {
      std::fill(scratch_.begin(), scratch_.end(), 0.0F);
      float push = 0.0F;
      for (std::size_t a = 0; a < azimuths; ++a) {
        if (contacts.are_there[a] == 0.0F) continue;
        push += rays_.push[u][a][side] * contacts.upright[a];
        if (rays_.pull[u][a][side] > 0.0F)
          add_scaled(path_.pulls.at(contacts.fall_deg[a]), rays_.pull[u][a][side], scratch_.data(),
                     sets_);
      }
      add_scaled(path_.pulls.max_spine_forces.data(), push, scratch_.data(), sets_);
      for (std::size_t s = 0; s < sets_; ++s) capacities[s] = std::min(capacities[s], scratch_[s]);
    }
    bound_capacities(capacities, logs, sets_);
  }

  ForceEstimate estimate() {
    ForceEstimate result;
    ForceGrid survivals;
    find_survivals(weights_.data(), forces_, log_forces_, survivals);
    result.hold_probability = std::min(1.0F, survivals.back());
    const auto quantile = [&](float above) {
      if (survivals.front() <= above) return 0.0F;
      std::size_t n = 1;
      while (n + 2 < force_steps && survivals[n] > above) ++n;
      const float fraction = std::min(
          1.0F, (survivals[n - 1] - above) / std::max(1e-9F, survivals[n - 1] - survivals[n]));
      return std::exp(log_forces_[n - 1] + fraction * log_force_step);
    };
    result.median_n = quantile(0.5F);
    result.low_n = quantile(0.95F);
    result.high_n = quantile(0.05F);
    float weight = 0.0F;
    float log = 0.0F;
    float square = 0.0F;
    for (std::size_t s = 0; s < sets_; ++s) {
      const float set_weight = weights_[s] * forces_.probability[s];
      if (set_weight <= 0.0F) continue;
      weight += set_weight;
      log += set_weight * forces_.log_force[s];
      square += set_weight * forces_.log_force[s] * forces_.log_force[s];
      result.trial_spread += set_weight * forces_.spread[s];
    }
    if (weight > 0.0F) {
      result.trial_spread /= weight;
      log /= weight;
      result.parameter_spread = std::sqrt(std::max(0.0F, square / weight - log * log));
    }
    return result;
  }

  double palm_height(std::size_t pivot) const {
    double palm = unknown;
    for (const std::ptrdiff_t step : palm_)
      palm = std::max(palm, heights_.height(pivot + static_cast<std::size_t>(step)));
    for (std::size_t n = 0; n < open_.size(); ++n)
      palm = std::max(
          palm, heights_.height(pivot + static_cast<std::size_t>(open_[n])) + rays_.open[n].depth);
    return palm;
  }

  std::size_t first_contact(std::size_t pivot, double palm, std::size_t azimuth,
                            const RayCell*& cell) const {
    const std::vector<RayCell>& cells = rays_.closing[azimuth];
    for (std::size_t n = 0; n < cells.size(); ++n) {
      const std::size_t at = pivot + static_cast<std::size_t>(closing_[azimuth][n]);
      if (!(heights_.height(at) > palm - cells[n].depth + palm_clearance_m)) continue;
      cell = &cells[n];
      return at;
    }
    return pivot;
  }

  const Heights& heights_;
  const Rays& rays_;
  const ClosingPath& path_;
  const std::size_t sets_;
  std::vector<std::ptrdiff_t> palm_;
  std::vector<std::ptrdiff_t> open_;
  std::array<std::vector<std::ptrdiff_t>, azimuths> closing_;
  std::vector<std::optional<Met>> met_;  // per column, computed on demand
  std::vector<float> capacities_;        // per computed column, in closing forces of all fingers
  std::vector<float> logs_;
  std::vector<float> weights_;    // of the parameter sets
  ForceGrid log_forces_{};        // of equally spaced forces, then of the load
  std::vector<float> log_scale_;  // ln of the closing force of all fingers, N
  SetSums sums_;
  SetForces forces_;
  std::vector<float> scratch_;
};

// Columns around a pivot from the circle of the closed spines outward.
std::vector<RayCell> outward_cells(const GripperMask& mask, double angle) {
  std::vector<RayCell> cells;
  const auto first = static_cast<int>(mask.closed_radius_m / mask.voxel_size_m);
  for (int step = first; step <= mask.pivot_xy; ++step) {
    const RayCell cell{static_cast<int>(std::lround(step * std::cos(angle))),
                       static_cast<int>(std::lround(step * std::sin(angle)))};
    const double radius_m = std::hypot(cell.i, cell.j) * mask.voxel_size_m;
    if (radius_m < mask.closed_radius_m || radius_m > mask.open_radius_m) continue;
    if (cells.empty() || cells.back().i != cell.i || cells.back().j != cell.j)
      cells.push_back(cell);
  }
  return cells;
}

// Calls use(members, heights) in parallel for each block of pivots. `members` are indices in
// `pivots`; `heights` covers all columns within `reach` of them.
template <typename Use>
void for_each_block(const VoxelGrid& grid, const std::vector<std::size_t>& pivots, int reach,
                    const Use& use) {
  std::map<std::pair<int, int>, std::vector<std::size_t>> blocks;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const Voxel& voxel = grid.voxels[pivots[n]];
    blocks[{floor_divide(voxel.i, closing_block_columns),
            floor_divide(voxel.j, closing_block_columns)}]
        .push_back(n);
  }
  const std::vector<std::pair<std::pair<int, int>, std::vector<std::size_t>>> listed(blocks.begin(),
                                                                                     blocks.end());
  libmap::parallel_for(listed.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const auto& [block, members] = listed[b];
      const int i = block.first * closing_block_columns;
      const int j = block.second * closing_block_columns;
      use(members,
          Heights(grid, expanded({i, i + closing_block_columns, j, j + closing_block_columns},
                                 reach, reach)));
    }
  });
}

}  // namespace

int closing_reach_voxels(const ClosingPath& path, double voxel_size_m) {
  // A position may be rounded half a column outward, its fall uses one more column, and gaps are
  // filled.
  return static_cast<int>(std::ceil(path.reach_m() / voxel_size_m + 0.5)) + 1 + gap_columns +
         rest_columns(path, voxel_size_m);
}

std::vector<ForceEstimate> closing_forces(const VoxelGrid& grid, const ClosingPath& path,
                                          const std::vector<std::size_t>& pivots) {
  const double voxel_size_m = grid.lattice.voxel_size_m;
  const Rays rays = make_rays(path, voxel_size_m);
  std::vector<ForceEstimate> forces(pivots.size());
  for_each_block(grid, pivots, closing_reach_voxels(path, voxel_size_m),
                 [&](const std::vector<std::size_t>& members, const Heights& heights) {
                   BlockCloser closer(heights, rays, path);
                   for (const std::size_t n : members) {
                     const Voxel& voxel = grid.voxels[pivots[n]];
                     forces[n] = closer.force(heights.index(voxel.i, voxel.j),
                                              (voxel.k + 0.5) * voxel_size_m);
                   }
                 });
  return forces;
}

std::vector<double> outward_fall_fractions(const VoxelGrid& grid, const GripperMask& mask,
                                           const std::vector<std::size_t>& pivots) {
  std::array<std::vector<RayCell>, azimuths> rays;
  for (std::size_t a = 0; a < azimuths; ++a)
    rays[a] = outward_cells(mask, 2.0 * std::numbers::pi * static_cast<double>(a) / azimuths);
  std::vector<double> fractions(pivots.size(), 0.0);
  for_each_block(grid, pivots, mask.pivot_xy + gap_columns,
                 [&](const std::vector<std::size_t>& members, const Heights& heights) {
                   for (const std::size_t n : members) {
                     const Voxel& voxel = grid.voxels[pivots[n]];
                     const std::size_t at = heights.index(voxel.i, voxel.j);
                     const auto falling = std::count_if(
                         rays.begin(), rays.end(),
                         [&](const auto& ray) { return heights.fall(at, ray) > mask.min_fall_m; });
                     fractions[n] = static_cast<double>(falling) / azimuths;
                   }
                 });
  return fractions;
}

}  // namespace libgtd
