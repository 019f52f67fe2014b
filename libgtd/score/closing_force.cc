#include "libgtd/score/closing_force.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "libgtd/gripper/target_clones.h"
#include "libgtd/score/column_heights.h"
#include "libgtd/score/force_distribution.h"
#include "libgtd/score/scanned_area.h"
#include "libmap/core/angle.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

constexpr int azimuths = 16;
constexpr int closing_block_columns = 64;
// The open finger rests on the ground. Only ground that is higher by more than this (rounding)
// stops it.
constexpr double palm_clearance_m = 1e-5;
// Standard deviation of the resting position, in finger lengths, of a normal distribution truncated
// at twice this value. It covers pose and tilt of the palm, azimuths of the fingers and width of a
// column. With this value the verdicts of the virtual field test on the fitted sites are nearly as
// likely as with any larger one.
constexpr double spread = 0.25;
constexpr double max_deviations = 2.0;

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

// sums += weight * values
GRASPMAP_CLONED void add_scaled(const float* __restrict values, float weight,
                                float* __restrict sums, std::size_t count) {
  for (std::size_t n = 0; n < count; ++n) sums[n] += weight * values[n];
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
  BlockCloser(const ColumnHeights& heights, const Rays& rays, const ClosingPath& path)
      : heights_(heights),
        rays_(rays),
        path_(path),
        sets_(path.pulls.sets),
        met_(heights.size()),
        distribution_(path),
        scratch_(sets_) {
    for (const RayCell& cell : rays.palm) palm_.push_back(step(cell));
    for (const RayCell& cell : rays.open) open_.push_back(step(cell));
    for (std::size_t a = 0; a < azimuths; ++a)
      for (const RayCell& cell : rays.closing[a]) closing_[a].push_back(step(cell));
  }

  // Requires ground in the column of the pivot.
  ForceEstimate force(std::size_t pivot, double pivot_height) {
    RestSums sums;
    distribution_.clear();
    for (const Rest& rest : rays_.rests) {
      const std::size_t at = pivot + static_cast<std::size_t>(step(rest.cell));
      if (heights_.height(at) == ColumnHeights::unknown) continue;
      const Met& met = met_at(at);
      sums.contact += rest.weight * met.contact;
      sums.rise_m += rest.weight * (met.palm - pivot_height);
      sums.tilt_m += rest.weight * met.tilt;
      sums.weights += rest.weight;
      distribution_.add_column(&capacities_[met.at], &logs_[met.at],
                               static_cast<float>(rest.weight));
    }
    return distribution_.estimate(sums);
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

  std::ptrdiff_t step(const RayCell& cell) const { return heights_.step(cell.i, cell.j); }

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
      const auto& [along_x, along_y] = heights_.gradient(at);
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

  double palm_height(std::size_t pivot) const {
    double palm = ColumnHeights::unknown;
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

  const ColumnHeights& heights_;
  const Rays& rays_;
  const ClosingPath& path_;
  const std::size_t sets_;
  std::vector<std::ptrdiff_t> palm_;
  std::vector<std::ptrdiff_t> open_;
  std::array<std::vector<std::ptrdiff_t>, azimuths> closing_;
  std::vector<std::optional<Met>> met_;  // per column, computed on demand
  std::vector<float> capacities_;        // per computed column, in closing forces of all fingers
  std::vector<float> logs_;
  ForceDistribution distribution_;
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

// Returns the fall from the first cell with ground around a column to the lowest cell.
double fall_along(const ColumnHeights& heights, std::size_t at, const std::vector<RayCell>& cells) {
  double first = ColumnHeights::unknown;
  double lowest = std::numeric_limits<double>::infinity();
  for (const RayCell& cell : cells) {
    const double height =
        heights.height(at + static_cast<std::size_t>(heights.step(cell.i, cell.j)));
    if (height == ColumnHeights::unknown) continue;
    if (first == ColumnHeights::unknown) first = height;
    lowest = std::min(lowest, height);
  }
  return first == ColumnHeights::unknown ? 0.0 : first - lowest;
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
          ColumnHeights(grid, expanded({i, i + closing_block_columns, j, j + closing_block_columns},
                                       reach, reach)));
    }
  });
}

}  // namespace

int closing_reach_voxels(const ClosingPath& path, double voxel_size_m) {
  // A position may be rounded half a column outward, its fall uses one more column, and gaps are
  // filled.
  return static_cast<int>(std::ceil(path.reach_m() / voxel_size_m + 0.5)) + 1 +
         ColumnHeights::gap_columns + rest_columns(path, voxel_size_m);
}

std::vector<ForceEstimate> closing_forces(const VoxelGrid& grid, const ClosingPath& path,
                                          const std::vector<std::size_t>& pivots) {
  const double voxel_size_m = grid.lattice.voxel_size_m;
  const Rays rays = make_rays(path, voxel_size_m);
  std::vector<ForceEstimate> forces(pivots.size());
  for_each_block(grid, pivots, closing_reach_voxels(path, voxel_size_m),
                 [&](const std::vector<std::size_t>& members, const ColumnHeights& heights) {
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
  for_each_block(grid, pivots, mask.pivot_xy + ColumnHeights::gap_columns,
                 [&](const std::vector<std::size_t>& members, const ColumnHeights& heights) {
                   for (const std::size_t n : members) {
                     const Voxel& voxel = grid.voxels[pivots[n]];
                     const std::size_t at = heights.index(voxel.i, voxel.j);
                     const auto falling =
                         std::count_if(rays.begin(), rays.end(), [&](const auto& ray) {
                           return fall_along(heights, at, ray) > mask.min_fall_m;
                         });
                     fractions[n] = static_cast<double>(falling) / azimuths;
                   }
                 });
  return fractions;
}

}  // namespace libgtd
