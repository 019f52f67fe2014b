#include "libmap/fusion/depth_planes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include "libmap/fusion/depth_plane_loops.h"

namespace libmap {

namespace {

// Maximum deviation of measurements of one surface, in standard deviations.
constexpr double gate_sigmas = 3.0;
// Number of pixels by which fitted planes are extended at the edges of surfaces.
constexpr int edge_reach_px = 2;

using Loops = DepthPlaneLoops;

std::size_t padded(int width) {
  return static_cast<std::size_t>((width + Loops::lanes - 1) / Loops::lanes * Loops::lanes);
}

using UsePlaneRow = std::function<void(int y, const Loops::Planes& planes)>;

class PlaneFit {
 public:
  PlaneFit(const DepthImage& depth, const PixelRays& rays, const DepthPlaneOptions& options,
           const std::vector<std::uint8_t>& only)
      : depth_(depth),
        rays_(rays),
        options_(options),
        only_(only),
        width_(depth.width),
        height_(depth.height),
        stride_(padded(width_)) {
    take_measurements();
  }

  DepthPixelCounts run(const UsePlaneRow& use) {
    fit_pairs();
    for (int ring = 0; ring < edge_reach_px; ++ring) extend_planes();
    finish(use);
    return counts_;
  }

 private:
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  std::size_t plane_at(int x, int y) const {
    return static_cast<std::size_t>(y) * stride_ + static_cast<std::size_t>(x);
  }
  std::size_t margin_stride() const {
    return stride_ + 2 * static_cast<std::size_t>(options_.radius_px);
  }
  std::size_t margin_at(int x, int y) const {
    const int r = options_.radius_px;
    return static_cast<std::size_t>(y + r) * margin_stride() + static_cast<std::size_t>(x + r);
  }
  float measured(int x, int y) const { return measured_[margin_at(x, y)]; }
  // `support_` has a margin of one row above and below, and one 64-bit word left and right.
  std::size_t support_stride() const { return stride_ + 2 * sizeof(std::uint64_t); }
  std::size_t support_at(int x, int y) const {
    return static_cast<std::size_t>(y + 1) * support_stride() + sizeof(std::uint64_t) +
           static_cast<std::size_t>(x);
  }
  Loops::InversePlanes row_of(int y) {
    const std::size_t first = plane_at(0, y);
    return {&value_[first], &by_column_[first], &by_row_[first], &support_[support_at(0, y)]};
  }

  void take_measurements();
  std::vector<Loops::Offset> pair_offsets() const;
  void fit_pairs();
  // A pixel at the edge of a surface, with the adjacent plane that it takes.
  struct ExtendedPixel {
    std::size_t plane = 0;
    std::size_t support = 0;
    std::size_t from = 0;
    float value = 0.0F;
  };
  std::uint64_t edge_pixels(int x, int y) const;
  void take_plane_beside(int x, int y, std::vector<ExtendedPixel>& taken) const;
  void extend_planes();
  void finish(const UsePlaneRow& use);

  const DepthImage& depth_;
  const PixelRays& rays_;
  const DepthPlaneOptions& options_;
  const std::vector<std::uint8_t>& only_;
  const Loops& loops_ = depth_plane_loops_of(best_instruction_set());
  int width_;
  int height_;
  std::size_t stride_;            // of all rows below, without margins
  std::vector<float> measured_;   // inverse depth with a margin, 0 where not measured
  std::vector<float> tolerance_;  // maximum difference of a pair's mean from the pixel between
  // Inverse depth of each pixel's plane, and its derivatives by column and row.
  std::unique_ptr<float[]> value_;
  std::unique_ptr<float[]> by_column_;
  std::unique_ptr<float[]> by_row_;
  std::vector<std::uint8_t> support_;  // with a margin; 0 without a plane
  DepthPixelCounts counts_;
};

void PlaneFit::take_measurements() {
  const std::size_t size = stride_ * static_cast<std::size_t>(height_);
  measured_.assign(margin_stride() * static_cast<std::size_t>(height_ + 2 * options_.radius_px),
                   0.0F);
  tolerance_.resize(size);
  counts_.pixels = depth_.pixels.size();
  const Loops::Limits limits{
      static_cast<float>(options_.min_depth_m), static_cast<float>(options_.max_depth_m),
      // The difference of a pixel and the mean of two has 3/2 of a pixel's variance.
      static_cast<float>(gate_sigmas * std::sqrt(1.5)), static_cast<float>(options_.noise.axial_m),
      static_cast<float>(options_.noise.axial_of_range),
      static_cast<float>(options_.noise.axial_of_square)};
  for (int y = 0; y < height_; ++y) {
    const Loops::MeasureCounts counts =
        loops_.measure(&depth_.pixels[at(0, y)], width_, limits, &measured_[margin_at(0, y)],
                       &tolerance_[plane_at(0, y)]);
    counts_.unmeasured += static_cast<std::size_t>(counts.unmeasured);
    counts_.out_of_range += static_cast<std::size_t>(counts.out_of_range);
  }
  for (const std::size_t n : rays_.blind) {
    float& inverse =
        measured_[margin_at(static_cast<int>(n) % width_, static_cast<int>(n) / width_)];
    if (inverse == 0.0F) continue;
    inverse = 0.0F;
    ++counts_.without_ray;
  }
}

std::vector<Loops::Offset> PlaneFit::pair_offsets() const {
  const int r = options_.radius_px;
  // Maximum difference of opposite pixels on a surface at the maximum incidence.
  const double tangent = std::tan(options_.max_incidence_deg * std::numbers::pi / 180.0);
  const Eigen::Vector2d extent = rays_.max - rays_.min;
  const double pitch =
      std::max(extent.x() / std::max(1, width_ - 1), extent.y() / std::max(1, height_ - 1));
  std::vector<Loops::Offset> offsets;
  for (int dy = 0; dy <= r; ++dy)
    for (int dx = -r; dx <= r; ++dx)
      if ((dy > 0 || dx > 0) && dx * dx + dy * dy <= r * r + 1)
        offsets.push_back({dy * static_cast<std::ptrdiff_t>(margin_stride()) + dx,
                           1 | (dx * dx) << 8 | (dy * dy) << 20, dx * dy, static_cast<float>(dx),
                           static_cast<float>(dy),
                           2.0F * static_cast<float>(tangent * pitch * std::hypot(dx, dy))});
  return offsets;
}

// Marks the pixels to fit in `wanted`: each group of four with a pixel in `only`. Returns true if
// there are any.
bool mark_fours(const std::uint8_t* only, int width, std::vector<std::uint8_t>& wanted) {
  bool has_any = false;
  for (int x = 0; x < width; x += 4) {
    const std::uint8_t* const end = only + std::min(x + 4, width);
    const bool marked = std::any_of(only + x, end, [](std::uint8_t mark) { return mark != 0; });
    std::fill_n(wanted.begin() + x, 4, static_cast<std::uint8_t>(marked ? 1 : 0));
    has_any = has_any || marked;
  }
  return has_any;
}

void PlaneFit::fit_pairs() {
  const std::size_t size = stride_ * static_cast<std::size_t>(height_);
  value_ = std::make_unique_for_overwrite<float[]>(size);
  by_column_ = std::make_unique_for_overwrite<float[]>(size);
  by_row_ = std::make_unique_for_overwrite<float[]>(size);
  support_.assign(support_stride() * static_cast<std::size_t>(height_ + 2), 0);
  const std::vector<Loops::Offset> offsets = pair_offsets();
  const auto min_pairs =
      static_cast<float>(options_.min_pair_fraction * static_cast<double>(offsets.size()));
  std::vector<std::uint8_t> wanted(stride_, 0);
  for (int y = 0; y < height_; ++y) {
    if (!only_.empty() && !mark_fours(&only_[at(0, y)], width_, wanted)) continue;
    loops_.fit(&measured_[margin_at(0, y)], &tolerance_[plane_at(0, y)],
               only_.empty() ? nullptr : wanted.data(), width_, offsets.data(), offsets.size(),
               min_pairs, row_of(y));
  }
}

// One byte for each of eight adjacent pixels: not 0 if a neighbor has a plane. 0 for all if all
// eight have planes.
std::uint64_t PlaneFit::edge_pixels(int x, int y) const {
  const auto eight = [&](std::size_t first) {
    std::uint64_t word = 0;
    std::memcpy(&word, &support_[first], sizeof(word));
    return word;
  };
  const std::size_t middle = support_at(x, y);
  const std::uint64_t own = eight(middle);
  constexpr std::uint64_t ones = 0x0101010101010101;
  constexpr std::uint64_t signs = 0x8080808080808080;
  if (((own - ones) & ~own & signs) == 0) return 0;
  std::uint64_t near = 0;
  for (const std::size_t row : {middle - support_stride(), middle, middle + support_stride()})
    near |= eight(row - 1) | eight(row) | eight(row + 1);
  return near;
}

void PlaneFit::take_plane_beside(int x, int y, std::vector<ExtendedPixel>& taken) const {
  if (measured(x, y) <= 0.0F || support_[support_at(x, y)] > 0) return;
  float best = tolerance_[plane_at(x, y)] / std::sqrt(1.5F);
  ExtendedPixel found;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      if (support_[support_at(x + dx, y + dy)] == 0) continue;
      const std::size_t m = plane_at(x + dx, y + dy);
      const float value =
          value_[m] - static_cast<float>(dx) * by_column_[m] - static_cast<float>(dy) * by_row_[m];
      const float miss = std::abs(value - measured(x, y));
      if (!(miss < best && value > 0.0F)) continue;
      best = miss;
      found = {plane_at(x, y), support_at(x, y), m, value};
    }
  if (found.support > 0) taken.push_back(found);
}

void PlaneFit::extend_planes() {
  std::vector<ExtendedPixel> taken;
  constexpr int word = sizeof(std::uint64_t);
  for (int y = 0; y < height_; ++y)
    for (int first = 0; first < width_; first += word) {
      const std::uint64_t open = edge_pixels(first, y);
      if (open == 0) continue;
      for (int x = first; x < std::min(first + word, width_); ++x) take_plane_beside(x, y, taken);
    }
  for (const ExtendedPixel& one : taken) {
    value_[one.plane] = one.value;
    by_column_[one.plane] = by_column_[one.from];
    by_row_[one.plane] = by_row_[one.from];
    support_[one.support] = 1;
  }
}

void PlaneFit::finish(const UsePlaneRow& use) {
  const auto least =
      static_cast<float>(std::cos(options_.max_incidence_deg * std::numbers::pi / 180.0));
  std::vector<float> numbers(5 * stride_);
  std::vector<std::uint8_t> support(stride_);
  const auto numbers_at = [&](std::size_t n) { return numbers.data() + n * stride_; };
  const Loops::Planes planes{
      numbers_at(0), {numbers_at(1), numbers_at(2), numbers_at(3)}, numbers_at(4), support.data()};
  for (int y = 0; y < height_; ++y) {
    const std::size_t row = at(0, y);
    const Loops::Rays rays{&rays_.x[row], &rays_.y[row], y > 0 ? -width_ : 0,
                           y + 1 < height_ ? width_ : 0};
    const Loops::PlaneCounts counts =
        loops_.finish(&measured_[margin_at(0, y)], row_of(y), rays, width_, least, planes);
    counts_.used += static_cast<std::size_t>(counts.used);
    counts_.flying += static_cast<std::size_t>(counts.flying);
    counts_.grazing += static_cast<std::size_t>(counts.grazing);
    if (counts.used > 0) use(y, planes);
  }
}

// Maximum distance of a plane from the depth of its pixel, along the optical axis, m. The gate g
// s(z) / z^2 is in inverse depth: with d = g s(z) / z, a plane is at most z d / (1 - d) behind its
// pixel, and less in front of it.
double max_plane_distance_m(const DepthPlaneOptions& options) {
  const double gate = gate_sigmas * std::sqrt(1.5);
  const double nearest = gate * options.noise.axial_at(options.min_depth_m) / options.min_depth_m;
  if (!(nearest < 1.0)) return std::numeric_limits<double>::infinity();
  return gate * options.noise.axial_at(options.max_depth_m) / (1.0 - nearest);
}

// Returns the marked pixels (not 0) and all pixels that affect their planes. With the result as
// `only`, the marked pixels have the same planes as with the whole image.
std::vector<std::uint8_t> dilate_mask(const std::vector<std::uint8_t>& marks, int width,
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

// Calls use(y, planes) for each row with planes. If `only` is not empty, only its pixels that are
// not 0 get planes, and the counts are meaningless.
DepthPixelCounts each_plane_row(const DepthImage& depth, const PixelRays& rays,
                                const DepthPlaneOptions& options,
                                const std::vector<std::uint8_t>& only, const UsePlaneRow& use) {
  if (depth.pixels.empty()) return {};
  return PlaneFit(depth, rays, options, only).run(use);
}

Loops::Placement placement_of(const Pose& grid_from_camera, const DepthNoise& noise,
                              double voxel_size_m) {
  Loops::Placement placement{};
  placement.scale = static_cast<float>(1.0 / voxel_size_m);
  for (int axis = 0; axis < 3; ++axis) {
    for (int of = 0; of < 3; ++of)
      placement.rotation[3 * axis + of] = static_cast<float>(grid_from_camera.linear()(axis, of));
    placement.translation[axis] =
        static_cast<float>(grid_from_camera.translation()[axis]) * placement.scale;
  }
  placement.axial_m = static_cast<float>(noise.axial_m);
  placement.axial_of_range = static_cast<float>(noise.axial_of_range);
  placement.axial_of_square = static_cast<float>(noise.axial_of_square);
  return placement;
}

std::size_t row_begin(const DepthImage& depth, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width);
}

// Marks the pixels with measurements in `cells` by a value that is not 0.
std::vector<std::uint8_t> pixels_in(const DepthImage& depth, const PixelRays& rays,
                                    const Loops::Placement& placement, double max_depth_m,
                                    const TileMask& cells) {
  const Loops& loops = depth_plane_loops_of(best_instruction_set());
  const auto max_depth = static_cast<float>(max_depth_m);
  std::vector<std::uint8_t> are_in(depth.pixels.size(), 0);
  const auto width = static_cast<std::size_t>(depth.width);
  std::vector<float> coordinates(2 * (width + Loops::lanes));
  float* const x = coordinates.data();
  float* const y = x + width + Loops::lanes;
  for (int row = 0; row < depth.height; ++row) {
    const std::size_t first = row_begin(depth, row);
    loops.place_depths(&depth.pixels[first], &rays.x[first], &rays.y[first], depth.width, placement,
                       x, y);
    for (std::size_t n = 0; n < width; ++n) {
      const float z = depth.pixels[first + n];
      if (z > 0.0F && z <= max_depth) are_in[first + n] = cells.contains({x[n], y[n]}) ? 1 : 0;
    }
  }
  return are_in;
}

// Marks all pixels whose planes may be in `cells`, and the pixels that affect these planes.
std::vector<std::uint8_t> pixels_around(const DepthImage& depth, const PixelRays& rays,
                                        const Loops::Placement& placement,
                                        const DepthPlaneOptions& options, double voxel_size_m,
                                        const TileMask& cells) {
  const double ray_length = rays.min.cwiseAbs().cwiseMax(rays.max.cwiseAbs()).homogeneous().norm();
  const double moved = max_plane_distance_m(options) * ray_length / voxel_size_m;
  const int margin = 1 + static_cast<int>(std::min(moved, static_cast<double>(voxel_cell_limit)));
  const std::vector<std::uint8_t> are_in =
      pixels_in(depth, rays, placement, options.max_depth_m, cells.grown(margin));
  if (std::none_of(are_in.begin(), are_in.end(), [](std::uint8_t mark) { return mark != 0; }))
    return {};
  return dilate_mask(are_in, depth.width, depth.height);
}

}  // namespace

DepthPlanes fit_depth_planes(const DepthImage& depth, const PixelRays& rays,
                             const DepthPlaneOptions& options) {
  const std::size_t size = depth.pixels.size();
  DepthPlanes planes;
  planes.width = depth.width;
  planes.height = depth.height;
  planes.depth_m.assign(size, 0.0F);
  planes.normals.assign(size, Eigen::Vector3f::Zero());
  planes.cos_incidence.assign(size, 0.0F);
  planes.support.assign(size, 0);
  planes.counts = each_plane_row(depth, rays, options, {}, [&](int y, const Loops::Planes& row) {
    const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width);
    for (std::size_t x = 0; x < static_cast<std::size_t>(depth.width); ++x) {
      if (row.support[x] == 0) continue;
      planes.depth_m[first + x] = row.depth_m[x];
      planes.normals[first + x] = {row.normal[0][x], row.normal[1][x], row.normal[2][x]};
      planes.cos_incidence[first + x] = row.cosine[x];
      planes.support[first + x] = row.support[x];
    }
  });
  return planes;
}

DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const TileMask& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels) {
  const Loops::Placement placement = placement_of(grid_from_camera, options.noise, voxel_size_m);
  std::vector<std::uint8_t> only;
  if (fitted == FittedPixels::in_cells) {
    only = cells.subsampling_level > 0
               ? pixels_in(depth, rays, placement, options.max_depth_m, cells)
               : pixels_around(depth, rays, placement, options, voxel_size_m, cells);
    if (only.empty()) return {};
  }
  const Loops& loops = depth_plane_loops_of(best_instruction_set());
  const auto width = static_cast<std::size_t>(depth.width);
  const std::size_t stride = width + Loops::lanes;
  std::vector<float> numbers(7 * stride);
  const auto numbers_at = [&](std::size_t n) { return numbers.data() + n * stride; };
  const Loops::PlacedElements placed{{numbers_at(0), numbers_at(1), numbers_at(2)},
                                     {numbers_at(3), numbers_at(4), numbers_at(5)},
                                     numbers_at(6)};
  return each_plane_row(depth, rays, options, only, [&](int y, const Loops::Planes& planes) {
    const std::size_t first = row_begin(depth, y);
    loops.place(planes, &rays.x[first], &rays.y[first], depth.width, placement, placed);
    for (std::size_t x = 0; x < width; ++x) {
      if (planes.support[x] == 0) continue;
      const Eigen::Vector3f position(placed.position[0][x], placed.position[1][x],
                                     placed.position[2][x]);
      if (!cells.contains(position.head<2>())) continue;
      voxels.add(position, {placed.normal[0][x], placed.normal[1][x], placed.normal[2][x]},
                 placed.weight[x]);
    }
  });
}

void describe(ResultTable& table, const DepthPixelCounts& counts) {
  table.add("pixels", counts.pixels, Merge::sum, "number of depth pixels of all frames");
  table.add("measurements_used", counts.used, Merge::sum, "number of pixels that were fused");
  table.add("rejected_unmeasured", counts.unmeasured, Merge::sum, "number of pixels without depth");
  table.add("rejected_out_of_range", counts.out_of_range, Merge::sum,
            "number of pixels outside the depth range");
  table.add("rejected_without_ray", counts.without_ray, Merge::sum,
            "number of pixels whose lens distortion cannot be inverted");
  table.add("rejected_flying", counts.flying, Merge::sum,
            "number of flying pixels, which are on no surface of their neighbors");
  table.add("rejected_grazing", counts.grazing, Merge::sum,
            "number of pixels with an angle of incidence above max_incidence_deg");
}

}  // namespace libmap
