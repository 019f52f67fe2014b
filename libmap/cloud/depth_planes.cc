#include "libmap/cloud/depth_planes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

namespace libmap {

namespace {

// Standard deviations within which measurements of one surface lie.
constexpr double gate_sigmas = 3.0;
// Pixels by which a fitted plane reaches beyond the pixels that it was fitted to.
constexpr int edge_reach_px = 2;

using Four = Eigen::Array<float, 4, 1>;

// Inverse depth of a pixel and its change by column and row.
struct InversePlanes {
  std::vector<float> value;
  std::vector<float> by_column;
  std::vector<float> by_row;
  std::vector<std::uint8_t> support;
};

class PlaneFit {
 public:
  PlaneFit(const DepthImage& depth, const PixelRays& rays, const DepthPlaneOptions& options,
           const std::vector<std::uint8_t>& only)
      : rays_(rays),
        options_(options),
        only_(only),
        width_(depth.width),
        height_(depth.height),
        size_(depth.pixels.size()),
        stride_(static_cast<std::size_t>(depth.width + 2 * options.radius_px + 3)) {
    take_measurements(depth);
  }

  DepthPlanes run() {
    InversePlanes planes = fit_pairs();
    for (int ring = 0; ring < edge_reach_px; ++ring) reach_out(planes);
    return to_planes(planes);
  }

 private:
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  std::size_t margin_at(int x, int y) const {
    const int r = options_.radius_px;
    return static_cast<std::size_t>(y + r) * stride_ + static_cast<std::size_t>(x + r);
  }
  float measured(int x, int y) const { return measured_[margin_at(x, y)]; }
  // Any of four pixels side by side.
  bool are_wanted(int x, int y) const {
    if (only_.empty()) return true;
    const auto first = only_.begin() + static_cast<std::ptrdiff_t>(at(x, y));
    return std::any_of(first, first + std::min(4, width_ - x), [](int mark) { return mark != 0; });
  }

  void take_measurements(const DepthImage& depth);
  InversePlanes fit_pairs() const;
  // A pair of opposite pixels.
  struct Offset {
    std::ptrdiff_t pixels = 0;  // in measured_
    float dx = 0.0F;
    float dy = 0.0F;
    float steepest = 0.0F;  // half the difference that slope alone may make, of the inverse depth
  };
  // Over the pairs of each of four pixels.
  struct PairSums {
    Four mean = Four::Zero();
    Four number = Four::Zero();
    Four by_column = Four::Zero();
    Four by_row = Four::Zero();
    Four column_square = Four::Zero();
    Four row_square = Four::Zero();
    Four product = Four::Zero();
  };
  std::vector<Offset> pair_offsets() const;
  PairSums sum_pairs(int x, int y, const std::vector<Offset>& offsets) const;
  void reach_out(InversePlanes& planes) const;
  DepthPlanes to_planes(const InversePlanes& planes);
  Eigen::Vector3f towards_camera(const InversePlanes& planes, int x, int y) const;

  const PixelRays& rays_;
  const DepthPlaneOptions& options_;
  const std::vector<std::uint8_t>& only_;
  int width_;
  int height_;
  std::size_t size_;
  std::size_t stride_;            // of measured_
  std::vector<float> measured_;   // inverse depth with a margin, 0 where not measured
  std::vector<float> tolerance_;  // of the mean of a pair against the pixel between; 4 more
  DepthPixelCounts counts_;
};

void PlaneFit::take_measurements(const DepthImage& depth) {
  measured_.assign(stride_ * static_cast<std::size_t>(height_ + 2 * options_.radius_px) + 4, 0.0F);
  tolerance_.assign(size_ + 4, 0.0F);
  counts_.pixels = size_;
  const auto min = static_cast<float>(options_.min_depth_m);
  const auto max = static_cast<float>(options_.max_depth_m);
  // The difference of a pixel and the mean of two has 3/2 of the variance of one.
  const auto gate = static_cast<float>(gate_sigmas * std::sqrt(1.5));
  const auto axial = static_cast<float>(options_.noise.axial_m);
  const auto of_range = static_cast<float>(options_.noise.axial_of_range);
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const float z = depth.at(x, y);
      if (!(z > 0.0F)) {
        ++counts_.unmeasured;
      } else if (!(z >= min && z <= max)) {
        ++counts_.out_of_range;
      } else {
        const float inverse = 1.0F / z;
        measured_[margin_at(x, y)] = inverse;
        tolerance_[at(x, y)] = gate * (axial + of_range * z) * inverse * inverse;
      }
    }
  for (const std::size_t n : rays_.blind) {
    float& inverse =
        measured_[margin_at(static_cast<int>(n) % width_, static_cast<int>(n) / width_)];
    if (inverse == 0.0F) continue;
    inverse = 0.0F;
    ++counts_.without_ray;
  }
}

std::vector<PlaneFit::Offset> PlaneFit::pair_offsets() const {
  const int r = options_.radius_px;
  // Half the difference that a surface at the greatest incidence makes from pixel to pixel.
  const double tangent = std::tan(options_.max_incidence_deg * std::numbers::pi / 180.0);
  const Eigen::Vector2d extent = rays_.max - rays_.min;
  const double pitch =
      std::max(extent.x() / std::max(1, width_ - 1), extent.y() / std::max(1, height_ - 1));
  std::vector<Offset> offsets;
  for (int dy = 0; dy <= r; ++dy)
    for (int dx = -r; dx <= r; ++dx)
      if ((dy > 0 || dx > 0) && dx * dx + dy * dy <= r * r + 1)
        offsets.push_back({dy * static_cast<std::ptrdiff_t>(stride_) + dx, static_cast<float>(dx),
                           static_cast<float>(dy),
                           static_cast<float>(tangent * pitch * std::hypot(dx, dy))});
  return offsets;
}

// The sums of four pixels side by side.
PlaneFit::PairSums PlaneFit::sum_pairs(int x, int y, const std::vector<Offset>& offsets) const {
  const float* middle = &measured_[margin_at(x, y)];
  const Four center = Eigen::Map<const Four>(middle);
  const Four tolerance = Eigen::Map<const Four>(&tolerance_[at(x, y)]);
  PairSums sums;
  for (const Offset& offset : offsets) {
    const Four a = Eigen::Map<const Four>(middle + offset.pixels);
    const Four b = Eigen::Map<const Four>(middle - offset.pixels);
    const Four mean = 0.5F * (a + b);
    const Four half = 0.5F * (a - b);
    // Positive where both are measured and agree with the pixel between, within noise and slope.
    const Four slack = (tolerance - (mean - center).abs())
                           .min(tolerance + offset.steepest * center - half.abs())
                           .min(a)
                           .min(b);
    // 1 or 0, by arithmetic that is done on four at once where a comparison would not be.
    const Four agrees = (slack * 1e30F).max(0.0F).min(1.0F);
    const Four slope = agrees * half;
    sums.mean += agrees * mean;
    sums.number += agrees;
    sums.by_column += offset.dx * slope;
    sums.by_row += offset.dy * slope;
    sums.column_square += (offset.dx * offset.dx) * agrees;
    sums.row_square += (offset.dy * offset.dy) * agrees;
    sums.product += (offset.dx * offset.dy) * agrees;
  }
  return sums;
}

InversePlanes PlaneFit::fit_pairs() const {
  InversePlanes planes{std::vector<float>(size_), std::vector<float>(size_),
                       std::vector<float>(size_), std::vector<std::uint8_t>(size_)};
  const std::vector<Offset> offsets = pair_offsets();
  const auto min_pairs =
      static_cast<float>(options_.min_pair_share * static_cast<double>(offsets.size()));
  for (int y = 0; y < height_; ++y)
    for (int first = 0; first < width_; first += 4) {
      if (!are_wanted(first, y)) continue;
      const PairSums sums = sum_pairs(first, y, offsets);
      const Four determinant = sums.column_square * sums.row_square - sums.product * sums.product;
      const Four value =
          (Four(Eigen::Map<const Four>(&measured_[margin_at(first, y)])) + 2.0F * sums.mean) /
          (1.0F + 2.0F * sums.number);
      const Four by_column =
          (sums.by_column * sums.row_square - sums.by_row * sums.product) / determinant;
      const Four by_row =
          (sums.by_row * sums.column_square - sums.by_column * sums.product) / determinant;
      for (int i = 0; i < std::min(4, width_ - first); ++i) {
        // The determinant is a whole number, 0 where all pairs lie on one line.
        if (measured(first + i, y) <= 0.0F || sums.number[i] < min_pairs || determinant[i] < 0.5F)
          continue;
        const std::size_t n = at(first + i, y);
        planes.value[n] = value[i];
        planes.by_column[n] = by_column[i];
        planes.by_row[n] = by_row[i];
        planes.support[n] = static_cast<std::uint8_t>(1.0F + 2.0F * sums.number[i]);
      }
    }
  return planes;
}

void PlaneFit::reach_out(InversePlanes& planes) const {
  std::vector<std::pair<std::size_t, std::size_t>> taken;  // pixel, from which
  std::vector<float> values;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const std::size_t n = at(x, y);
      if (measured(x, y) <= 0.0F || planes.support[n] > 0) continue;
      float best = tolerance_[n] / std::sqrt(1.5F);
      float best_value = 0.0F;
      std::size_t from = n;
      for (int dy = std::max(-1, -y); dy <= std::min(1, height_ - 1 - y); ++dy)
        for (int dx = std::max(-1, -x); dx <= std::min(1, width_ - 1 - x); ++dx) {
          const std::size_t m = at(x + dx, y + dy);
          if (planes.support[m] == 0) continue;
          const float value = planes.value[m] - static_cast<float>(dx) * planes.by_column[m] -
                              static_cast<float>(dy) * planes.by_row[m];
          const float miss = std::abs(value - measured(x, y));
          if (!(miss < best && value > 0.0F)) continue;
          best = miss;
          best_value = value;
          from = m;
        }
      if (from == n) continue;
      taken.emplace_back(n, from);
      values.push_back(best_value);
    }
  for (std::size_t i = 0; i < taken.size(); ++i) {
    const auto [n, from] = taken[i];
    planes.value[n] = values[i];
    planes.by_column[n] = planes.by_column[from];
    planes.by_row[n] = planes.by_row[from];
    planes.support[n] = 1;
  }
}

// The plane a x + b y + c = 1/z in ray coordinates x, y has the normal (a, b, c).
Eigen::Vector3f PlaneFit::towards_camera(const InversePlanes& planes, int x, int y) const {
  const std::size_t n = at(x, y);
  const int left = std::max(x - 1, 0);
  const int right = std::min(x + 1, width_ - 1);
  const int up = std::max(y - 1, 0);
  const int down = std::min(y + 1, height_ - 1);
  const auto columns = static_cast<float>(std::max(1, right - left));
  const auto rows = static_cast<float>(std::max(1, down - up));
  const float x_by_column = (rays_.x[at(right, y)] - rays_.x[at(left, y)]) / columns;
  const float y_by_column = (rays_.y[at(right, y)] - rays_.y[at(left, y)]) / columns;
  const float x_by_row = (rays_.x[at(x, down)] - rays_.x[at(x, up)]) / rows;
  const float y_by_row = (rays_.y[at(x, down)] - rays_.y[at(x, up)]) / rows;
  const float determinant = x_by_column * y_by_row - y_by_column * x_by_row;
  const float a = (y_by_row * planes.by_column[n] - y_by_column * planes.by_row[n]) / determinant;
  const float b = (x_by_column * planes.by_row[n] - x_by_row * planes.by_column[n]) / determinant;
  const float c = planes.value[n] - a * rays_.x[n] - b * rays_.y[n];
  return -Eigen::Vector3f(a, b, c).normalized();
}

DepthPlanes PlaneFit::to_planes(const InversePlanes& inverse) {
  DepthPlanes planes;
  planes.width = width_;
  planes.height = height_;
  planes.depth_m.assign(size_, 0.0F);
  planes.normals.assign(size_, Eigen::Vector3f::Zero());
  planes.cos_incidence.assign(size_, 0.0F);
  planes.support.assign(size_, 0);
  const auto least =
      static_cast<float>(std::cos(options_.max_incidence_deg * std::numbers::pi / 180.0));
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const std::size_t n = at(x, y);
      if (measured(x, y) <= 0.0F) continue;
      if (inverse.support[n] == 0) {
        ++counts_.flying;
        continue;
      }
      const Eigen::Vector3f normal = towards_camera(inverse, x, y);
      const Eigen::Vector3f ray(rays_.x[n], rays_.y[n], 1.0F);
      const float cosine = -normal.dot(ray) / ray.norm();
      if (!(cosine >= least)) {  // nor where the rays around the pixel have no slope
        ++counts_.grazing;
        continue;
      }
      planes.depth_m[n] = 1.0F / inverse.value[n];
      planes.normals[n] = normal;
      planes.cos_incidence[n] = cosine;
      planes.support[n] = inverse.support[n];
      ++counts_.used;
    }
  planes.counts = counts_;
  return planes;
}

}  // namespace

DepthPixelCounts& DepthPixelCounts::operator+=(const DepthPixelCounts& more) {
  pixels += more.pixels;
  unmeasured += more.unmeasured;
  out_of_range += more.out_of_range;
  without_ray += more.without_ray;
  flying += more.flying;
  grazing += more.grazing;
  used += more.used;
  return *this;
}

// The gate g s(z) / z^2 is of inverse depth: with d = g s(z) / z a plane is at most z d / (1 - d)
// farther than its pixel, and less nearer.
double max_plane_distance_m(const DepthPlaneOptions& options) {
  const double gate = gate_sigmas * std::sqrt(1.5);
  const double nearest = gate * options.noise.axial_at(options.min_depth_m) / options.min_depth_m;
  if (!(nearest < 1.0)) return std::numeric_limits<double>::infinity();
  return gate * options.noise.axial_at(options.max_depth_m) / (1.0 - nearest);
}

std::vector<std::uint8_t> grown_marks(const std::vector<std::uint8_t>& marks, int width,
                                      int height) {
  std::vector<std::uint8_t> grown(marks.size(), 0);
  const auto columns = static_cast<std::ptrdiff_t>(width);
  for (std::ptrdiff_t y = 0; y < height; ++y)
    for (std::ptrdiff_t x = 0; x < columns; ++x) {
      if (marks[static_cast<std::size_t>(y * columns + x)] == 0) continue;
      const std::ptrdiff_t left = std::max<std::ptrdiff_t>(0, x - edge_reach_px);
      const std::ptrdiff_t right = std::min<std::ptrdiff_t>(columns - 1, x + edge_reach_px);
      for (std::ptrdiff_t row = std::max<std::ptrdiff_t>(0, y - edge_reach_px);
           row <= std::min<std::ptrdiff_t>(height - 1, y + edge_reach_px); ++row)
        std::fill_n(grown.begin() + row * columns + left, right - left + 1, std::uint8_t{1});
    }
  return grown;
}

DepthPlanes fit_depth_planes(const DepthImage& depth, const PixelRays& rays,
                             const DepthPlaneOptions& options,
                             const std::vector<std::uint8_t>& only) {
  return PlaneFit(depth, rays, options, only).run();
}

}  // namespace libmap
