#include "libgtd/terrain/regression_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/geometry/plane_fit.h"
#include "libmap/geometry/robust.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/geometry/voxel_key.h"

namespace libgtd {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using libmap::PointCloud;
using libmap::PointStream;

constexpr std::size_t points_per_chunk = 8192;
// Minimum cosine between the z axis of the input and the normal for UpSource::frame_z (75 deg).
constexpr double min_cosine_of_frame_z = 0.2588190451025207;
// Directions with a smaller sine are parallel.
constexpr double parallel_sine = 1e-6;
constexpr double in_plane_cosine = 1e-9;

struct Sum {
  Vector3d of = Vector3d::Zero();
  std::size_t count = 0;
};

struct Moments {
  double second = 0;
  double third = 0;
  libmap::NormalVotes normals{};
};

// Sums chunk by chunk in the order of the points, so that blocks of whole chunks have the same sum
// as all points at once.
template <typename T, typename Add>
void add_block(const PointCloud& block, const T& zero, const Add& add, T& total) {
  static_assert(PointStream::block_points % points_per_chunk == 0);
  total = libmap::parallel_reduce(
      block.size(), points_per_chunk, total,
      [&](std::size_t begin, std::size_t end) {
        T sum = zero;
        for (std::size_t i = begin; i < end; ++i)
          if (block.positions[i].allFinite()) add(sum, block, i);
        return sum;
      },
      [](T a, const T& b) {
        a += b;
        return a;
      });
}

template <typename T, typename Add>
T sum_over(const PointStream& points, const T& zero, const Add& add) {
  T total = zero;
  points.for_each_block(PointStream::Need::positions,
                        [&](const PointCloud& block) { add_block(block, zero, add, total); });
  return total;
}

Sum& operator+=(Sum& a, const Sum& b) {
  a.of += b.of;
  a.count += b.count;
  return a;
}

Moments& operator+=(Moments& a, const Moments& b) {
  a.second += b.second;
  a.third += b.third;
  a.normals += b.normals;
  return a;
}

void add_offsets(const PointCloud& block, const Vector3d& origin, Sum& total) {
  add_block(
      block, Sum{},
      [&](Sum& sum, const PointCloud& of, std::size_t i) {
        sum.of += of.positions[i] - origin;
        ++sum.count;
      },
      total);
}

Vector3d mean_about(const Vector3d& origin, const Sum& sum) {
  return sum.count == 0 ? origin : origin + sum.of / static_cast<double>(sum.count);
}

// Results of the first pass over the points.
struct Facts {
  std::size_t points = 0;         // including points that are not finite
  std::optional<Vector3d> first;  // first finite point
  Sum offsets;                    // sum of offsets of finite points from `first`
  double opposing_normals = 0;    // share in the first block
  libmap::Pose viewpoint = libmap::Pose::Identity();
};

Facts facts_of(const PointStream& points) {
  Facts facts;
  points.for_each_block(PointStream::Need::positions_and_normals, [&](const PointCloud& block) {
    block.check();
    facts.points += block.size();
    facts.viewpoint = block.viewpoint;
    for (std::size_t i = 0; i < block.size() && !facts.first; ++i)
      if (block.positions[i].allFinite()) facts.first = block.positions[i];
    if (facts.first) add_offsets(block, *facts.first, facts.offsets);
    if (block.has_normals() && facts.points == block.size())
      facts.opposing_normals = libmap::opposing_fraction(block.positions, block.normals);
  });
  return facts;
}

// Eq. 2-13. The second pass removes the rounding of the first for points far from the origin.
Vector3d centroid_of(const PointStream& points, const Facts& facts) {
  const Vector3d near = mean_about(facts.first.value_or(Vector3d::Zero()), facts.offsets);
  Sum offsets;
  points.for_each_block(PointStream::Need::positions,
                        [&](const PointCloud& block) { add_offsets(block, near, offsets); });
  return mean_about(near, offsets);
}

// Eq. 2-14, 2-15: normal without its sign, and the three variances, ascending.
Matrix3d principal_axes(const PointStream& points, const Vector3d& centroid, std::size_t count,
                        Vector3d& variances) {
  Matrix3d covariance = sum_over(points, Matrix3d(Matrix3d::Zero()),
                                 [&](Matrix3d& s, const PointCloud& block, std::size_t i) {
                                   const Vector3d d = block.positions[i] - centroid;
                                   s += d * d.transpose();
                                 });
  covariance /= static_cast<double>(count);
  // Scaled to avoid underflow and overflow for tiny and huge clouds.
  const double scale = covariance.trace();
  if (scale > 0) covariance /= scale;
  const libmap::SymmetricEigen<3> eigen = libmap::symmetric_eigen(covariance);
  variances = eigen.values.cwiseMax(0.0) * scale;
  return eigen.vectors;
}

void check_spread(const Vector3d& variances, const Vector3d& centroid, std::size_t count) {
  if (count < 3)
    throw libmap::Error("too few finite points for a plane",
                        {.field = "points", .value = std::to_string(count), .bound = ">= 3"});
  const double size = std::sqrt(variances[2]);
  const double rounding = 1e-15 * centroid.norm();
  if (!(size > 4 * rounding))
    throw libmap::Error("all coincide, so that no plane can be fitted", {.field = "points"});
  // Single-precision coordinates have noise of about 1e-7 of the offset across an exact line.
  if (!(std::sqrt(variances[1]) > 1e-6 * size + 4 * rounding))
    throw libmap::Error("all are on a line, so that no plane can be fitted", {.field = "points"});
}

// Moments of the heights, and votes of the normals for the side of `normal`.
Moments height_moments(const PointStream& points, const Vector3d& centroid,
                       const Vector3d& normal) {
  Moments total;
  points.for_each_block(PointStream::Need::positions_and_normals, [&](const PointCloud& all) {
    add_block(
        all, Moments{},
        [&](Moments& m, const PointCloud& block, std::size_t i) {
          const double h = normal.dot(block.positions[i] - centroid);
          m.second += h * h;
          m.third += h * h * h;
          if (block.has_normals()) m.normals.add(block.normals[i], normal);
        },
        total);
  });
  return total;
}

// Cosine between normal and direction; 0 if `direction` is unknown or within the plane.
double side_of(const Vector3d& normal, const Vector3d& direction) {
  const double length = direction.stableNorm();
  if (!(length > 0) || !std::isfinite(length)) return 0;
  const double cosine = normal.dot(direction / length);
  return std::abs(cosine) > in_plane_cosine ? cosine : 0;
}

// Least-squares plane of the points.
struct FittedPlane {
  Vector3d centroid;      // m
  Matrix3d axes;          // columns: unit normal, then two unit vectors in the plane
  double extent_m = 0.0;  // > 0: standard deviation of the points along the last axis
};

constexpr double cells_per_extent = 70.0;
constexpr std::size_t cells_per_chunk = 4096;
// The terrain has level ground if the ratio of the median distances of the plane found and the
// start is at most this.
constexpr double max_median_ratio = 0.5;
constexpr double min_cosine = 0.7071067811865476;  // to the start's normal: 45 deg
constexpr int hypotheses = 500;
constexpr std::size_t max_sampled = 4000;
constexpr int max_steps = 200;
constexpr double converged_rad = 1e-9;

struct Mean {
  Vector3d sum = Vector3d::Zero();
  double count = 0.0;
};

// Means of the points in each cell, along the axes of the start from its centroid, in units of its
// extent, in the order of the cells.
std::vector<Vector3d> cell_means(const libmap::PointStream& points, const FittedPlane& start) {
  libmap::VoxelIndex cells;
  std::vector<Mean> sums;  // one per cell
  points.for_each_block(libmap::PointStream::Need::positions, [&](const libmap::PointCloud& block) {
    for (const Vector3d& position : block.positions) {
      if (!position.allFinite()) continue;
      const Vector3d point = start.axes.transpose() * (position - start.centroid) / start.extent_m;
      libmap::VoxelSide voxel;
      for (int axis = 0; axis < 3; ++axis)
        voxel.cell[axis] = static_cast<int>(std::llround(point[axis] * cells_per_extent));
      const std::uint32_t cell = cells.find_or_add(pack(voxel));
      if (cell == sums.size()) sums.emplace_back();
      sums[cell].sum += point;
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

// Plane in the coordinates of cell_means; the default is the start.
struct Plane {
  Vector3d normal = Vector3d::UnitX();
  double offset = 0.0;
  double height(const Vector3d& point) const { return normal.dot(point) - offset; }
};

Plane weighted_fit(const std::vector<Vector3d>& cell_points, const Plane& last, double limit) {
  const libmap::PlaneSpread spread = libmap::weighted_spread(
      cell_points, Vector3d::Zero(), cells_per_chunk, [&](const Vector3d& point) {
        const double ratio = last.height(point) / limit;
        return libmap::tukey_weight(ratio);
      });
  if (!spread.is_plane(1e-4)) return last;
  Plane plane;
  plane.normal = spread.axes.col(0);
  if (plane.normal.dot(last.normal) < 0.0) plane.normal = -plane.normal;
  plane.offset = plane.normal.dot(spread.center);
  return plane;
}

// Median of the absolute heights.
double median_height(const std::vector<Vector3d>& cell_points, const Plane& plane) {
  std::vector<double> heights;
  heights.reserve(cell_points.size());
  for (const Vector3d& point : cell_points) heights.push_back(std::abs(plane.height(point)));
  return libmap::median(std::move(heights));
}

// Least median of squares (Rousseeuw 1984): of planes through three positions, the plane with the
// minimum median of the absolute heights, on a subsample of positions.
Plane least_median(const std::vector<Vector3d>& cell_points, const Plane& start) {
  std::vector<Vector3d> sampled;
  const std::size_t step = cell_points.size() / max_sampled + 1;
  for (std::size_t n = 0; n < cell_points.size(); n += step) sampled.push_back(cell_points[n]);
  libmap::RandomStream random(1, 0);
  Plane best = start;
  double least = median_height(sampled, start);
  for (int n = 0; n < hypotheses; ++n) {
    const Vector3d& a = sampled[random.below(sampled.size())];
    const Vector3d& b = sampled[random.below(sampled.size())];
    const Vector3d& c = sampled[random.below(sampled.size())];
    Plane plane;
    plane.normal = (b - a).cross(c - a);
    const double length = plane.normal.norm();
    if (!(length > 0.0)) continue;
    plane.normal /= plane.normal.dot(start.normal) < 0.0 ? -length : length;
    if (!(plane.normal.dot(start.normal) > min_cosine)) continue;
    plane.offset = plane.normal.dot(a);
    const double median = median_height(sampled, plane);
    if (median >= least) continue;
    least = median;
    best = plane;
  }
  return best;
}

// Unit normal of the ground, on the side of the start's normal and at most 45 degrees from it. The
// least-squares plane is tilted by rocks; this normal is that of the plane that most of the surface
// follows. The points are replaced by one mean per cube of extent_m / 70 (about 1/250 of the width
// of the terrain), so that scan density has no effect. The least median of squares of 500 planes
// (Rousseeuw 1984) is refined by reweighted least squares with Tukey's biweight. Returns the normal
// of the start if its median distance is less than twice that of the plane found, because such a
// terrain has no level ground. The result is the same to the bit for points in one or many blocks.
Vector3d ground_normal(const libmap::PointStream& points, const FittedPlane& start) {
  const std::vector<Vector3d> cell_points = cell_means(points, start);
  const Plane squares;
  const Plane found = least_median(cell_points, squares);
  const double median = median_height(cell_points, found);
  if (!(median < max_median_ratio * median_height(cell_points, squares))) return start.axes.col(0);
  // Smaller heights are rounding errors.
  constexpr double min_limit = 1e-6;
  const double limit = std::max(libmap::tukey_width_of(median), min_limit);
  Plane plane = found;
  for (int step = 0; step < max_steps; ++step) {
    const Plane next = weighted_fit(cell_points, plane, limit);
    const double turn = (next.normal - plane.normal).norm();
    plane = next;
    if (turn < converged_rad) break;
  }
  return start.axes * plane.normal;
}

// Fitted plane without the sign of its normal.
struct Fit {
  Vector3d centroid;
  Vector3d normal;
  double rmse = 0;
  double skewness = 0;
  libmap::NormalVotes normals{};
};

// Returns the sign of the normal, and sets the criterion that decided it.
double choose_up(const Facts& facts, const RegressionPlaneOptions& options, const Fit& fit,
                 UpSource& source) {
  if (options.up) {
    source = UpSource::direction;
    const double side = side_of(fit.normal, *options.up);
    if (side == 0)
      throw libmap::Error(
          "the direction is zero or parallel to the plane, so it does not determine the upper side "
          "of the plane",
          {.field = "up"});
    const double tilt_deg = std::acos(std::min(1.0, std::abs(side))) * 180.0 / std::numbers::pi;
    if (tilt_deg > options.max_tilt_deg)
      throw libmap::Error(
          "too steep; if 0 or -9999 marks missing heights, declare it with gdal_translate "
          "-a_nodata",
          {.field = "tilt of the plane",
           .value = libmap::to_fixed_text(tilt_deg, 1) + " deg",
           .bound = "<= " + libmap::to_text(options.max_tilt_deg) + " deg"});
    return side;
  }
  double side = 0;
  if (!facts.viewpoint.isApprox(libmap::Pose::Identity(), 1e-12)) {
    source = UpSource::viewpoint;
    side = side_of(fit.normal, facts.viewpoint.translation() - fit.centroid);
    if (side != 0) return side;
  }
  source = UpSource::normals;
  if (fit.normals.agree() && facts.opposing_normals <= libmap::max_opposing_fraction)
    return fit.normals.along - fit.normals.against;
  source = UpSource::frame_z;
  if (std::abs(fit.normal.z()) >= min_cosine_of_frame_z) return fit.normal.z();
  source = UpSource::camera_origin;
  side = -fit.centroid.dot(fit.normal);
  if (std::abs(side) > fit.rmse && side != 0) return side;
  source = UpSource::relief;
  return fit.skewness < 0 ? -1 : 1;
}

// Eq. 2-17..2-19 with R = [x, -y, n], y = (c x n) / |c x n|, x = n x y.
Matrix3d thesis_axes(const Vector3d& centroid, const Vector3d& normal) {
  const Vector3d across = centroid.cross(normal);
  if (!(across.norm() > parallel_sine * centroid.norm()) || centroid.norm() == 0)
    throw libmap::Error(
        "the centroid is on the plane's normal through the origin, so that eq. 2-17 defines no "
        "heading (method thesis); use method corrected");
  const Vector3d y = across.normalized();
  Matrix3d axes;
  axes << normal.cross(y), -y, normal;
  return axes;
}

Matrix3d corrected_axes(const Vector3d& normal) {
  Vector3d x = Vector3d::UnitX() - normal.x() * normal;
  if (x.norm() > 1e-3) {
    x.normalize();
  } else {
    const Vector3d y = (Vector3d::UnitY() - normal.y() * normal).normalized();
    x = y.cross(normal);
  }
  Matrix3d axes;
  axes << x, normal.cross(x), normal;
  return axes;
}

}  // namespace

RegressionPlane fit_regression_plane(const PointStream& points,
                                     const RegressionPlaneOptions& options) {
  const Facts facts = facts_of(points);
  RegressionPlane plane;
  plane.points = facts.offsets.count;
  plane.centroid = centroid_of(points, facts);
  plane.skipped = facts.points - plane.points;
  Vector3d variances = Vector3d::Zero();
  Matrix3d axes = Matrix3d::Identity();
  if (plane.points >= 3) axes = principal_axes(points, plane.centroid, plane.points, variances);
  check_spread(variances, plane.centroid, plane.points);

  Fit fit{.centroid = plane.centroid, .normal = axes.col(0)};
  if (options.method == PlaneMethod::robust)
    fit.normal = ground_normal(
        points, {.centroid = plane.centroid, .axes = axes, .extent_m = std::sqrt(variances[2])});
  const Moments moments = height_moments(points, fit.centroid, fit.normal);
  const double count = static_cast<double>(plane.points);
  fit.rmse = std::sqrt(moments.second / count);
  const double cube = fit.rmse * fit.rmse * fit.rmse;
  fit.skewness = cube > 0 ? moments.third / count / cube : 0;
  if (!std::isfinite(fit.skewness)) fit.skewness = 0;
  fit.normals = moments.normals;

  if (choose_up(facts, options, fit, plane.up_source) < 0) {
    fit.normal = -fit.normal;
    fit.skewness = -fit.skewness;
    std::swap(fit.normals.along, fit.normals.against);
  }
  if (!fit.normals.empty())
    plane.normals_up = fit.normals.along / (fit.normals.along + fit.normals.against);
  plane.opposing_normals = facts.opposing_normals;
  plane.rmse_m = fit.rmse;
  plane.relief_skewness = fit.skewness;
  const Matrix3d rotation = options.method == PlaneMethod::thesis
                                ? thesis_axes(fit.centroid, fit.normal)
                                : corrected_axes(fit.normal);
  plane.terrain_from_input.linear() = rotation.transpose();
  plane.terrain_from_input.translation() = -(rotation.transpose() * plane.centroid);
  return plane;
}

RegressionPlane fit_regression_plane(const PointCloud& cloud,
                                     const RegressionPlaneOptions& options) {
  return fit_regression_plane(libmap::CloudAsStream(cloud), options);
}

libmap::PointCloud transform_to_terrain(const libmap::PointCloud& cloud,
                                        const RegressionPlane& plane, PlaneMethod method) {
  libmap::PointCloud moved = libmap::transform_cloud(cloud, plane.terrain_from_input);
  const Eigen::Matrix3d rotation = plane.terrain_from_input.linear();
  if (method == PlaneMethod::thesis) {
    const Eigen::Matrix3f turn = rotation.cast<float>();
    const Eigen::Vector3f shift = turn * plane.centroid.cast<float>();
    for (std::size_t i = 0; i < cloud.size(); ++i)
      moved.positions[i] = (turn * cloud.positions[i].cast<float>() - shift).eval().cast<double>();
  } else {
    // Relative to the centroid: R^T p - R^T c would lose digits far from the origin.
    for (std::size_t i = 0; i < cloud.size(); ++i)
      moved.positions[i] = rotation * (cloud.positions[i] - plane.centroid);
  }
  return moved;
}

std::string_view to_text(UpSource source) {
  // In the order of the enumeration.
  constexpr std::array<std::string_view, 6> names = {"direction", "viewpoint",     "normals",
                                                     "frame_z",   "camera_origin", "relief"};
  return names[static_cast<std::size_t>(source)];
}

}  // namespace libgtd
