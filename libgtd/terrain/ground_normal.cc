#include "libgtd/terrain/ground_normal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/symmetric_eigen.h"
#include "libmap/geometry/voxel_key.h"

namespace libgtd {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double cells_per_extent = 70.0;
constexpr std::size_t cells_per_chunk = 4096;
constexpr double tukey_widths = 4.685;            // 95 % efficiency for normal residuals
constexpr double deviations_per_median = 1.4826;  // of normal residuals
// The ground is a plane if half of the surface is so much nearer to it than to the start.
constexpr double max_median_ratio = 0.5;
constexpr double min_cosine = 0.7071067811865476;  // to the start's normal: 45 degrees
constexpr int hypotheses = 500;
constexpr std::size_t max_looked_at = 4000;
constexpr int max_steps = 200;
constexpr double converged_rad = 1e-9;

struct Mean {
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
};

// Along the start's axes from its centroid, in its extents, in the order of the cells.
std::vector<Vector3d> cell_means(const libmap::PointStream& points, const FittedPlane& start) {
  libmap::VoxelIndex cells;
  std::vector<Mean> sums;  // of the cells
  points.for_each_block(libmap::PointStream::Need::positions, [&](const libmap::PointCloud& block) {
    for (const Vector3d& position : block.positions) {
      if (!position.allFinite()) continue;
      const Vector3d place = start.axes.transpose() * (position - start.centroid) / start.extent_m;
      libmap::VoxelPlace voxel;
      for (int axis = 0; axis < 3; ++axis)
        voxel.cell[axis] = static_cast<int>(std::llround(place[axis] * cells_per_extent));
      const std::uint32_t cell = cells.find_or_add(pack(voxel));
      if (cell == sums.size()) sums.emplace_back();
      sums[cell].sum += place;
      sums[cell].count += 1.0;
    }
  });
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  order.reserve(sums.size());
  for (const std::uint64_t key : cells.keys()) order.emplace_back(key, order.size());
  std::sort(order.begin(), order.end());
  std::vector<Vector3d> means;
  means.reserve(order.size());
  for (const auto& [key, cell] : order) means.push_back(sums[cell].sum / sums[cell].count);
  return means;
}

struct Plane {
  Vector3d normal = Vector3d::UnitX();
  double offset = 0.0;
  double height(const Vector3d& place) const { return normal.dot(place) - offset; }
};

struct Sums {
  double weight = 0.0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
};

Plane weighted_fit(const std::vector<Vector3d>& places, const Plane& last, double width) {
  const Sums sums = libmap::parallel_reduce(
      places.size(), cells_per_chunk, Sums{},
      [&](std::size_t begin, std::size_t end) {
        Sums part;
        for (std::size_t n = begin; n < end; ++n) {
          const double share = last.height(places[n]) / width;
          if (std::abs(share) >= 1.0) continue;
          const double weight = (1.0 - share * share) * (1.0 - share * share);
          part.weight += weight;
          part.first += weight * places[n];
          part.second += weight * places[n] * places[n].transpose();
        }
        return part;
      },
      [](Sums a, const Sums& b) {
        a.weight += b.weight;
        a.first += b.first;
        a.second += b.second;
        return a;
      });
  if (!(sums.weight > 0.0)) return last;
  const Vector3d mean = sums.first / sums.weight;
  const Matrix3d covariance = sums.second / sums.weight - mean * mean.transpose();
  const libmap::SymmetricEigen<3> eigen = libmap::symmetric_eigen<3>(covariance);
  // On a line, they would fit any plane through it.
  if (!(eigen.values[1] > 1e-4 * eigen.values[2])) return last;
  Plane plane;
  plane.normal = eigen.vectors.col(0);
  if (plane.normal.dot(last.normal) < 0.0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(mean);
  return plane;
}

// Of the absolute heights; the upper one of two.
double median_height(const std::vector<Vector3d>& places, const Plane& plane) {
  std::vector<double> heights;
  heights.reserve(places.size());
  for (const Vector3d& place : places) heights.push_back(std::abs(plane.height(place)));
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  return *middle;
}

// Least median of squares (Rousseeuw 1984): of planes through three places, the one with the least
// median of the absolute heights. Every so many-th place is looked at.
Plane least_median(const std::vector<Vector3d>& places, const Plane& start) {
  std::vector<Vector3d> looked_at;
  const std::size_t step = places.size() / max_looked_at + 1;
  for (std::size_t n = 0; n < places.size(); n += step) looked_at.push_back(places[n]);
  libmap::RandomStream random(1, 0);
  Plane best = start;
  double least = median_height(looked_at, start);
  for (int n = 0; n < hypotheses; ++n) {
    const Vector3d& a = looked_at[random.below(looked_at.size())];
    const Vector3d& b = looked_at[random.below(looked_at.size())];
    const Vector3d& c = looked_at[random.below(looked_at.size())];
    Plane plane;
    plane.normal = (b - a).cross(c - a);
    const double length = plane.normal.norm();
    if (!(length > 0.0)) continue;
    plane.normal /= plane.normal.dot(start.normal) < 0.0 ? -length : length;
    if (!(plane.normal.dot(start.normal) > min_cosine)) continue;
    plane.offset = plane.normal.dot(a);
    const double median = median_height(looked_at, plane);
    if (median >= least) continue;
    least = median;
    best = plane;
  }
  return best;
}

}  // namespace

Vector3d ground_normal(const libmap::PointStream& points, const FittedPlane& start) {
  const std::vector<Vector3d> places = cell_means(points, start);
  const Plane squares;
  const Plane found = least_median(places, squares);
  const double median = median_height(places, found);
  if (!(median < max_median_ratio * median_height(places, squares))) return start.axes.col(0);
  // Below this, heights are rounding.
  constexpr double min_width = 1e-6;
  const double width = std::max(tukey_widths * deviations_per_median * median, min_width);
  Plane plane = found;
  for (int step = 0; step < max_steps; ++step) {
    const Plane next = weighted_fit(places, plane, width);
    const double turn = (next.normal - plane.normal).norm();
    plane = next;
    if (turn < converged_rad) break;
  }
  return start.axes * plane.normal;
}

}  // namespace libgtd
