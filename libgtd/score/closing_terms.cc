#include "libgtd/score/closing_terms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "libgtd/score/scanned_area.h"
#include "libmap/core/angle.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

constexpr int azimuths = 16;
constexpr int gap_columns = 3;
constexpr int closing_block_columns = 64;
// The open finger rests on the ground: only what rises more than rounding into its way is met.
constexpr double palm_clearance_m = 1e-5;
constexpr double unknown = -std::numeric_limits<double>::infinity();
// Of where the gripper comes to rest, in lengths of a finger: the standard deviation of a normal
// distribution that is cut at twice of it. Pose and tilt of the palm, the azimuths of its fingers
// and the width of a column all blur what it meets; this value makes the verdicts of the virtual
// field test on the fitted sites nearly as likely as any larger one.
constexpr double spread = 0.25;
constexpr double max_deviations = 2.0;

// Places around a pivot as columns, for one azimuth.
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
  std::vector<Rest> rests;    // where the gripper may come to rest
  std::vector<RayCell> palm;  // depth 0
  std::vector<RayCell> open;  // of all azimuths
  std::array<std::vector<RayCell>, azimuths> closing;
  std::array<std::array<double, azimuths>, azimuths> weights{};  // side, azimuth; 1 in sum
};

// Whether a place in this column has not been as deep before: else it would have met the ground.
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
      if (const double distance = std::hypot(i, j) / sigma; distance <= max_deviations)
        rays.rests.push_back({{i, j}, std::exp(-0.5 * distance * distance)});
  const int palm = static_cast<int>(std::ceil(path.palm_radius_m / voxel_size_m));
  for (int i = -palm; i <= palm; ++i)
    for (int j = -palm; j <= palm; ++j)
      if (std::hypot(i, j) * voxel_size_m <= path.palm_radius_m) rays.palm.push_back({i, j});
  for (int a = 0; a < azimuths; ++a) {
    const double angle = 2.0 * std::numbers::pi * a / azimuths;
    const auto cell = [&](const ClosingPath::Place& place) {
      return RayCell{static_cast<int>(std::lround(place.radius_m * std::cos(angle) / voxel_size_m)),
                     static_cast<int>(std::lround(place.radius_m * std::sin(angle) / voxel_size_m)),
                     place.depth_m, place.has_spines};
    };
    for (const ClosingPath::Place& place : path.open) rays.open.push_back(cell(place));
    for (const ClosingPath::Place& place : path.closing)
      if (const RayCell next = cell(place); is_new(rays.closing[static_cast<std::size_t>(a)], next))
        rays.closing[static_cast<std::size_t>(a)].push_back(next);
    double sum = 0.0;
    auto& weights = rays.weights[static_cast<std::size_t>(a)];
    for (int b = 0; b < azimuths; ++b) {
      const double weight = std::max(0.0, std::cos(2.0 * std::numbers::pi * (b - a) / azimuths));
      weights[static_cast<std::size_t>(b)] = weight;
      sum += weight;
    }
    for (double& weight : weights) weight /= sum;
  }
  return rays;
}

// The heights of a rectangle of columns, and how they fall.
class Heights {
 public:
  Heights(const VoxelGrid& grid, const TileBounds& bounds)
      : bounds_(bounds), width_(bounds.j_end - bounds.j_begin) {
    const auto size =
        static_cast<std::size_t>(bounds.i_end - bounds.i_begin) * static_cast<std::size_t>(width_);
    heights_.assign(size, unknown);
    // In voxels of the lattice, from its origin; ascending, so that the highest of a column is
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
  // From the first of the cells around a column that has ground to the lowest one.
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

// Follows the fingers at the pivots of one block.
class BlockCloser {
 public:
  BlockCloser(const Heights& heights, const Rays& rays, const ClosingPath& path)
      : heights_(heights), rays_(rays), path_(path), met_(heights.size()) {
    for (const RayCell& cell : rays.palm) palm_.push_back(heights.step(cell));
    for (const RayCell& cell : rays.open) open_.push_back(heights.step(cell));
    for (std::size_t a = 0; a < azimuths; ++a)
      for (const RayCell& cell : rays.closing[a]) closing_[a].push_back(heights.step(cell));
  }

  // The pivot's column must have ground.
  ClosingTerms terms(std::size_t pivot, double pivot_height) {
    Met sum;
    double weights = 0.0;
    for (const Rest& rest : rays_.rests) {
      const std::size_t at = pivot + static_cast<std::size_t>(heights_.step(rest.cell));
      if (heights_.height(at) == unknown) continue;
      const Met& met = met_at(at);
      sum.contact += rest.weight * met.contact;
      sum.bearing += rest.weight * met.bearing;
      sum.palm += rest.weight * (met.palm - pivot_height);
      sum.depth += rest.weight * met.depth;
      weights += rest.weight;
    }
    const double lengths = weights * path_.finger_length_m;
    return {.contact = sum.contact / weights,
            .bearing = sum.bearing / weights,
            .rise = sum.palm / lengths,
            .depth = sum.depth / lengths};
  }

 private:
  // What a gripper meets that comes to rest on a column.
  struct Met {
    double contact = 0.0;
    double bearing = 0.0;
    double palm = 0.0;   // m
    double depth = 0.0;  // of the contacts, mean, m
  };

  const Met& met_at(std::size_t at) {
    std::optional<Met>& met = met_[at];
    if (!met) met = close_on(at);
    return *met;
  }

  Met close_on(std::size_t at_rest) const {
    const double palm = palm_height(at_rest);
    std::array<double, azimuths> contacts{};
    std::array<double, azimuths> bearings{};
    double depths = 0.0;
    double touching = 0.0;
    for (std::size_t a = 0; a < azimuths; ++a) {
      const RayCell* cell = nullptr;
      const std::size_t at = first_contact(at_rest, palm, a, cell);
      if (cell == nullptr || !cell->has_spines) continue;
      contacts[a] = 1.0;
      depths += cell->depth;
      touching += 1.0;
      const double angle = 2.0 * std::numbers::pi * static_cast<double>(a) / azimuths;
      const auto& [along_x, along_y] = heights_.rise(at);
      const double fall_deg = std::atan(-(along_x * std::cos(angle) + along_y * std::sin(angle))) /
                              libmap::radians_per_degree;
      bearings[a] = path_.bearing[static_cast<std::size_t>(std::lround(fall_deg) + 90)];
    }
    return {.contact = weakest(contacts),
            .bearing = weakest(bearings),
            .palm = palm,
            .depth = touching > 0.0 ? depths / touching : 0.0};
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

  double weakest(const std::array<double, azimuths>& values) const {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& weights : rays_.weights) {
      double sum = 0.0;
      for (std::size_t a = 0; a < azimuths; ++a) sum += weights[a] * values[a];
      least = std::min(least, sum);
    }
    return least;
  }

  const Heights& heights_;
  const Rays& rays_;
  const ClosingPath& path_;
  std::vector<std::ptrdiff_t> palm_;
  std::vector<std::ptrdiff_t> open_;
  std::array<std::vector<std::ptrdiff_t>, azimuths> closing_;
  std::vector<std::optional<Met>> met_;  // of each column, once it is needed
};

// From the circle of the closed spines outward, as columns around a pivot.
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

// Calls use(members, heights) for each block of pivots, which are numbers in `pivots`, with the
// heights of all columns within `reach` of them; in parallel.
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
      const auto& [place, members] = listed[b];
      const int i = place.first * closing_block_columns;
      const int j = place.second * closing_block_columns;
      use(members, Heights(grid, grown({i, i + closing_block_columns, j, j + closing_block_columns},
                                       reach, reach)));
    }
  });
}

}  // namespace

int closing_reach_voxels(const ClosingPath& path, double voxel_size_m) {
  // A place may be rounded half a column outward; its fall looks one farther, and gaps are filled.
  return static_cast<int>(std::ceil(path.reach_m() / voxel_size_m + 0.5)) + 1 + gap_columns +
         rest_columns(path, voxel_size_m);
}

std::vector<ClosingTerms> closing_terms(const VoxelGrid& grid, const ClosingPath& path,
                                        const std::vector<std::size_t>& pivots) {
  const double voxel_size_m = grid.lattice.voxel_size_m;
  const Rays rays = make_rays(path, voxel_size_m);
  std::vector<ClosingTerms> terms(pivots.size());
  for_each_block(grid, pivots, closing_reach_voxels(path, voxel_size_m),
                 [&](const std::vector<std::size_t>& members, const Heights& heights) {
                   BlockCloser closer(heights, rays, path);
                   for (const std::size_t n : members) {
                     const Voxel& voxel = grid.voxels[pivots[n]];
                     terms[n] = closer.terms(heights.index(voxel.i, voxel.j),
                                             (voxel.k + 0.5) * voxel_size_m);
                   }
                 });
  return terms;
}

std::vector<double> outward_shares(const VoxelGrid& grid, const GripperMask& mask,
                                   const std::vector<std::size_t>& pivots) {
  std::array<std::vector<RayCell>, azimuths> rays;
  for (std::size_t a = 0; a < azimuths; ++a)
    rays[a] = outward_cells(mask, 2.0 * std::numbers::pi * static_cast<double>(a) / azimuths);
  std::vector<double> shares(pivots.size(), 0.0);
  for_each_block(grid, pivots, mask.pivot_xy + gap_columns,
                 [&](const std::vector<std::size_t>& members, const Heights& heights) {
                   for (const std::size_t n : members) {
                     const Voxel& voxel = grid.voxels[pivots[n]];
                     const std::size_t at = heights.index(voxel.i, voxel.j);
                     const auto falling = std::count_if(
                         rays.begin(), rays.end(),
                         [&](const auto& ray) { return heights.fall(at, ray) > mask.min_fall_m; });
                     shares[n] = static_cast<double>(falling) / azimuths;
                   }
                 });
  return shares;
}

}  // namespace libgtd
