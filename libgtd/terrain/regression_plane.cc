#include "libgtd/terrain/regression_plane.h"

#include <array>
#include <cmath>
#include <string>

#include "libgtd/terrain/ground_normal.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/symmetric_eigen.h"

namespace libgtd {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using libmap::PointCloud;
using libmap::PointStream;

constexpr std::size_t points_per_chunk = 8192;
// The input's z axis decides only where it is within 75 deg of the normal.
constexpr double min_cosine_of_frame_z = 0.2588190451025207;
// Below these sines two directions count as parallel.
constexpr double parallel_sine = 1e-6;
constexpr double in_plane_cosine = 1e-9;

struct Sum {
  Vector3d of = Vector3d::Zero();
  std::size_t count = 0;
};

struct Moments {
  double second = 0;
  double third = 0;
};

// Chunk by chunk in the points' order, so that blocks of whole chunks give the sum of all points
// at once.
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

void add_normals(const PointCloud& block, Vector3d& total) {
  add_block(
      block, Vector3d(Vector3d::Zero()),
      [](Vector3d& sum, const PointCloud& of, std::size_t i) {
        const Vector3d n = of.normals[i].cast<double>();
        if (n.allFinite() && n.norm() > 0) sum += n.normalized();
      },
      total);
}

// What a first look at the points tells.
struct Facts {
  std::size_t points = 0;         // finite or not
  std::optional<Vector3d> first;  // finite one
  Sum offsets;                    // of the finite points from the first
  Vector3d normals = Vector3d::Zero();
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
    if (block.has_normals()) add_normals(block, facts.normals);
  });
  return facts;
}

// Eq. 2-13. The second pass takes away the rounding that a far origin leaves in the first.
Vector3d centroid_of(const PointStream& points, const Facts& facts) {
  const Vector3d near = mean_about(facts.first.value_or(Vector3d::Zero()), facts.offsets);
  Sum offsets;
  points.for_each_block(PointStream::Need::positions,
                        [&](const PointCloud& block) { add_offsets(block, near, offsets); });
  return mean_about(near, offsets);
}

// Eq. 2-14, 2-15: the normal without its sign, and the three variances in increasing order.
Matrix3d principal_axes(const PointStream& points, const Vector3d& centroid, std::size_t count,
                        Vector3d& variances) {
  Matrix3d covariance = sum_over(points, Matrix3d(Matrix3d::Zero()),
                                 [&](Matrix3d& s, const PointCloud& block, std::size_t i) {
                                   const Vector3d d = block.positions[i] - centroid;
                                   s += d * d.transpose();
                                 });
  covariance /= static_cast<double>(count);
  // Scaled, so that neither tiny nor huge clouds leave the numbers' range.
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
  if (!(size > 4 * rounding)) throw libmap::Error("all points lie in one place: no plane fits");
  // Single-precision coordinates leave about 1e-7 of the offset as noise across a true line.
  if (!(std::sqrt(variances[1]) > 1e-6 * size + 4 * rounding))
    throw libmap::Error("all points lie on a line: no plane fits");
}

Moments height_moments(const PointStream& points, const Vector3d& centroid,
                       const Vector3d& normal) {
  return sum_over(points, Moments{}, [&](Moments& m, const PointCloud& block, std::size_t i) {
    const double h = normal.dot(block.positions[i] - centroid);
    m.second += h * h;
    m.third += h * h * h;
  });
}

// The cosine between both; 0 if `direction` is unknown or within the plane.
double side_of(const Vector3d& normal, const Vector3d& direction) {
  const double length = direction.stableNorm();
  if (!(length > 0) || !std::isfinite(length)) return 0;
  const double cosine = normal.dot(direction / length);
  return std::abs(cosine) > in_plane_cosine ? cosine : 0;
}

// A fitted plane whose normal may still face either side.
struct Fit {
  Vector3d centroid;
  Vector3d normal;
  double rmse = 0;
  double skewness = 0;
};

// The sign of the normal: which of the two sides is up, and who said so.
double choose_up(const Facts& facts, const RegressionPlaneOptions& options, const Fit& fit,
                 UpSource& source) {
  if (options.up) {
    source = UpSource::direction;
    const double side = side_of(fit.normal, *options.up);
    if (side == 0)
      throw libmap::Error(
          "this direction does not say which side of the plane is up: it has no "
          "length or lies in the plane",
          {.field = "up"});
    return side;
  }
  double side = 0;
  if (!facts.viewpoint.isApprox(libmap::Pose::Identity(), 1e-12)) {
    source = UpSource::viewpoint;
    side = side_of(fit.normal, facts.viewpoint.translation() - fit.centroid);
    if (side != 0) return side;
  }
  source = UpSource::normals;
  side = side_of(fit.normal, facts.normals);
  if (side != 0) return side;
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
        "the centroid lies on the plane's normal through the origin, so eq. 2-17 gives no heading "
        "(method thesis); use method corrected");
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

  if (choose_up(facts, options, fit, plane.up_source) < 0) {
    fit.normal = -fit.normal;
    fit.skewness = -fit.skewness;
  }
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
    // About the centroid: a far origin would cancel out of R^T p - R^T c.
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
