#include "libmap/fusion/surface_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/fusion/surface_voxels.h"

namespace libmap {

namespace {

// Maximum shift of an element beyond an edge along its normal, in voxels. A larger one indicates
// that the surface bends.
constexpr double max_extended_shift = 0.5;
// A point with less than this share of its neighbor's standard error makes the neighbor an echo.
constexpr float echo_certainty = 0.5F;
// Maximum distance along the normal between two points of one surface, in voxels.
constexpr double max_echo_distance = 0.5;
constexpr double normal_radius_voxels = 2.0;
// Points measured by at most this number of frames are dropped if other frames contradict this
// share of such points around them.
constexpr std::uint32_t weak_frames = 2;
constexpr double contradicted_fraction = 0.5;

constexpr float min_agreement = 0.7F;
// Neighbors with a smaller second eigenvalue of their covariance, in squared radii, are collinear.
constexpr float min_spread_ratio = 0.02F;

// A point of a fit; lengths are in radii.
struct Neighbor {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // relative to the cell's center
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float certainty = 0.0F;
};

// Points sorted into cells as wide as the radius. It replaces a PointTree, because one search
// serves all points of a cell (the tree's search takes 3 times as long as all of fit_normals), and
// the order of cells determines that of single-precision sums.
class NeighborCells {
 public:
  NeighborCells(const PointCloud& cloud, double radius_m, const std::vector<double>& deviations_m)
      : cloud_(cloud),
        radius_m_(radius_m),
        deviations_m_(deviations_m),
        first_cell_((bounds_of(cloud.positions).min / radius_m).array().floor()) {
    std::vector<std::uint32_t> cell_of(cloud.size());
    for (std::size_t n = 0; n < cloud.size(); ++n)
      cell_of[n] = index_.find_or_add(
          pack({((cloud.positions[n] / radius_m).array().floor() - first_cell_).cast<int>(), 0}));
    starts_.assign(index_.size() + 1, 0);
    for (const std::uint32_t c : cell_of) ++starts_[c + 1];
    for (std::size_t c = 0; c < index_.size(); ++c) starts_[c + 1] += starts_[c];
    members_.resize(cloud.size());
    std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
    for (std::size_t n = 0; n < cloud.size(); ++n)
      members_[next[cell_of[n]]++] = static_cast<std::uint32_t>(n);
  }

  std::size_t size() const { return index_.size(); }
  std::span<const std::uint32_t> members(std::size_t cell) const {
    return {members_.data() + starts_[cell], members_.data() + starts_[cell + 1]};
  }

  // Gathers the points of the cell, then those of the 26 cells around it.
  void gather(std::size_t cell, std::vector<Neighbor>& neighbors) const {
    neighbors.clear();
    const Eigen::Vector3i there = unpack(index_.keys()[cell]).cell;
    // Computed from integers, so that it does not depend on distant points.
    const Eigen::Vector3d middle =
        (first_cell_ + there.cast<double>().array() + 0.5).matrix() * radius_m_;
    add_members(cell, middle, neighbors);
    for (int n = 0; n < 27; ++n) {
      if (n == 13) continue;
      const Eigen::Vector3i beside = there + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
      const std::uint32_t c = index_.find(pack({beside, 0}));
      if (c != VoxelIndex::none) add_members(c, middle, neighbors);
    }
  }

 private:
  void add_members(std::size_t cell, const Eigen::Vector3d& middle,
                   std::vector<Neighbor>& neighbors) const {
    for (const std::uint32_t n : members(cell)) {
      // Deviations below 1 % of the radius do not increase the weight.
      const double deviation = deviations_m_[n] / radius_m_;
      neighbors.push_back({((cloud_.positions[n] - middle) / radius_m_).cast<float>(),
                           cloud_.normals[n],
                           static_cast<float>(1.0 / (deviation * deviation + 1e-4))});
    }
  }

  const PointCloud& cloud_;
  double radius_m_;
  const std::vector<double>& deviations_m_;
  Eigen::Array3d first_cell_;  // offset that makes the minimum cell index 0
  VoxelIndex index_;
  std::vector<std::uint32_t> starts_;
  std::vector<std::uint32_t> members_;
};

Eigen::Vector3f fitted_normal(const Neighbor& point, const std::vector<Neighbor>& neighbors) {
  float weights = 0.0F;
  Eigen::Vector3f mean = Eigen::Vector3f::Zero();
  Eigen::Vector3f squares = Eigen::Vector3f::Zero();   // xx, yy, zz
  Eigen::Vector3f products = Eigen::Vector3f::Zero();  // xy, yz, zx
  for (const Neighbor& other : neighbors) {
    const Eigen::Vector3f arm = other.position - point.position;
    const float near = 1.0F - arm.squaredNorm();
    if (near <= 0.0F || other.normal.dot(point.normal) < min_agreement) continue;
    const float weight = near * other.certainty;
    const Eigen::Vector3f weighted = weight * arm;
    weights += weight;
    mean += weighted;
    squares += weighted.cwiseProduct(arm);
    products += weighted.cwiseProduct(Eigen::Vector3f(arm.y(), arm.z(), arm.x()));
  }
  mean /= weights;
  Eigen::Matrix3f moments;
  moments << squares.x(), products.x(), products.z(), products.x(), squares.y(), products.y(),
      products.z(), products.y(), squares.z();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(moments / weights - mean * mean.transpose());
  if (!(solver.eigenvalues()[1] >= min_spread_ratio)) return point.normal;
  const Eigen::Vector3f normal = solver.eigenvectors().col(0).normalized();
  return normal.dot(point.normal) < 0.0F ? Eigen::Vector3f(-normal) : normal;
}

// Points that share a voxel, weighted by their certainty.
struct MergedPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // weighted sum, like normal and color
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float weight = 0.0F;
  float expected_error_m = 0.0F;
  std::uint32_t frames = 0;  // 0: empty
  bool extended = false;
  bool is_wanted = true;  // in the requested columns
};

Color to_color(const Eigen::Vector3f& color) {
  const auto byte = [](float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F)));
  };
  return {byte(color.x()), byte(color.y()), byte(color.z())};
}

class PointMaker {
 public:
  PointMaker(const RefinedSurface& surface, double voxel_size_m, const TileMask& cells,
             const SurfacePointOptions& options)
      : surface_(surface), voxel_size_m_(voxel_size_m), cells_(cells), options_(options) {}

  SurfacePoints run() {
    find_contradicted();
    points_.reserve(surface_.elements.size());
    // Measured elements come first and take precedence over extended ones in their voxel.
    for (const bool extended : {false, true})
      for (std::size_t n = 0; n < surface_.elements.size(); ++n) {
        const SurfaceElement& element = surface_.elements[n];
        if (element.extended == extended && is_contradicted_[n] == 0 &&
            is_confirmed(element, surface_.refined[n]))
          merge(element, surface_.refined[n]);
      }
    drop_echoes();
    return make_cloud();
  }

 private:
  bool is_weak(std::size_t n) const { return surface_.refined[n].frames <= weak_frames; }
  // 1 if the element's column of voxels is requested, 0 otherwise.
  std::size_t wanted(const SurfaceElement& element) const;
  bool is_contradicted(std::size_t n);
  void find_contradicted();
  void spread_contradiction();
  bool is_confirmed(const SurfaceElement& element, const RefinedElement& refined);
  void merge(const SurfaceElement& element, const RefinedElement& refined);
  bool is_echo(std::size_t point, std::size_t other, int axis) const;
  void drop_echoes();
  SurfacePoints make_cloud();

  const RefinedSurface& surface_;
  double voxel_size_m_;
  const TileMask& cells_;
  const SurfacePointOptions& options_;
  std::vector<char> is_contradicted_;  // one per element
  VoxelIndex index_;
  std::vector<MergedPoint> points_;
  SurfacePointCounts counts_;
};

std::size_t PointMaker::wanted(const SurfaceElement& element) const {
  const Eigen::Vector2d position = element.position.head<2>().cast<double>() / voxel_size_m_;
  return cells_.has_cell(position.array().floor().cast<int>()) ? 1 : 0;
}

bool PointMaker::is_contradicted(std::size_t n) {
  const RefinedElement& refined = surface_.refined[n];
  const auto seen = static_cast<double>(refined.seen);
  if (static_cast<double>(refined.seen_through) > options_.max_seen_through * seen) {
    counts_.seen_through += wanted(surface_.elements[n]);
    return true;
  }
  if (static_cast<double>(refined.missed) > options_.max_missed * seen) {
    counts_.missed += wanted(surface_.elements[n]);
    return true;
  }
  return false;
}

void PointMaker::find_contradicted() {
  is_contradicted_.resize(surface_.elements.size(), 0);
  for (std::size_t n = 0; n < surface_.elements.size(); ++n)
    if (surface_.refined[n].frames > 0 && is_contradicted(n)) is_contradicted_[n] = 1;
  spread_contradiction();
}

// Drops the other points of moved objects. Other frames may see through a part of an object only,
// because the rest is outside their images. Squares of the x-y plane are evaluated instead of
// connected components, so that the result does not depend on tiles.
void PointMaker::spread_contradiction() {
  struct Counts {
    std::size_t all = 0;
    std::size_t contradicted = 0;
  };
  VoxelIndex blocks;
  std::vector<std::uint32_t> block_of(surface_.elements.size(), VoxelIndex::none);
  std::vector<Counts> counts;
  const double block_m = contradiction_block * voxel_size_m_;
  for (std::size_t n = 0; n < block_of.size(); ++n) {
    if (!is_weak(n)) continue;
    Eigen::Vector3i block = Eigen::Vector3i::Zero();
    block.head<2>() = (surface_.elements[n].position.head<2>().cast<double>() / block_m)
                          .array()
                          .floor()
                          .cast<int>();
    block_of[n] = blocks.find_or_add(pack({block, 0}));
    if (block_of[n] == counts.size()) counts.emplace_back();
    ++counts[block_of[n]].all;
    counts[block_of[n]].contradicted += is_contradicted_[n] != 0 ? 1 : 0;
  }
  std::vector<char> is_moved(counts.size(), 0);  // per square, including its neighbors' counts
  for (std::size_t number = 0; number < counts.size(); ++number) {
    const Eigen::Vector3i block = unpack(blocks.keys()[number]).cell;
    Counts around;
    for (int step = 0; step < 9; ++step) {
      const Eigen::Vector3i beside = block + Eigen::Vector3i(step % 3 - 1, step / 3 - 1, 0);
      const std::uint32_t other = blocks.find(pack({beside, 0}));
      if (other == VoxelIndex::none) continue;
      around.all += counts[other].all;
      around.contradicted += counts[other].contradicted;
    }
    is_moved[number] = static_cast<double>(around.contradicted) >=
                               contradicted_fraction * static_cast<double>(around.all)
                           ? 1
                           : 0;
  }
  for (std::size_t n = 0; n < block_of.size(); ++n) {
    if (block_of[n] == VoxelIndex::none || is_contradicted_[n] != 0 || is_moved[block_of[n]] == 0)
      continue;
    is_contradicted_[n] = 1;
    counts_.contradicted += wanted(surface_.elements[n]);
  }
}

bool PointMaker::is_confirmed(const SurfaceElement& element, const RefinedElement& refined) {
  counts_.max_views = std::max(counts_.max_views, wanted(element) * refined.frames);
  if (refined.frames < static_cast<std::uint32_t>(options_.min_views)) {
    counts_.unconfirmed += wanted(element);
    return false;
  }
  if (element.extended &&
      std::abs(static_cast<double>(refined.shift_m)) > max_extended_shift * voxel_size_m_) {
    counts_.beyond_edge += wanted(element);
    return false;
  }
  return true;
}

void PointMaker::merge(const SurfaceElement& element, const RefinedElement& refined) {
  const Eigen::Vector3f position = element.position + refined.shift_m * element.normal;
  const Eigen::Vector3i cell =
      (position.cast<double>() / voxel_size_m_).array().floor().cast<int>();
  std::uint32_t number = index_.find_or_add(pack({cell, 0}));
  if (number < points_.size() && points_[number].normal.dot(element.normal) < 0.0F)
    number = index_.find_or_add(pack({cell, 1}));
  if (number == points_.size()) points_.emplace_back();
  MergedPoint& point = points_[number];
  if (point.frames > 0) {
    counts_.merged += point.is_wanted ? 1 : 0;
    if (element.extended && !point.extended) return;
  }
  point.is_wanted = cells_.has_cell(cell.head<2>());
  point.extended = element.extended;
  const float error = refined.expected_error_m;
  const float weight = 1.0F / (error * error);
  point.weight += weight;
  point.position += weight * position;
  point.normal += weight * element.normal;
  for (int c = 0; c < 3; ++c)
    point.color[c] += weight * static_cast<float>(refined.color[static_cast<std::size_t>(c)]);
  // The points share measurements, so the mean has the smallest of their errors.
  point.expected_error_m = point.frames == 0 ? error : std::min(error, point.expected_error_m);
  point.frames = std::max(point.frames, refined.frames);
}

// Returns true if `point` duplicates `other`, which is in the next voxel along its normal. Noise, a
// pose error or a surface at the border of two voxels causes such echoes.
bool PointMaker::is_echo(std::size_t point, std::size_t other, int axis) const {
  const MergedPoint& one = points_[point];
  const MergedPoint& two = points_[other];
  if (two.normal.dot(one.normal) <= 0.0F || (two.extended && !one.extended)) return false;
  if (!two.extended && two.expected_error_m < echo_certainty * one.expected_error_m) return true;
  const float apart = std::abs(two.position[axis] / two.weight - one.position[axis] / one.weight);
  if (static_cast<double>(apart) > max_echo_distance * voxel_size_m_) return false;
  return std::tuple(two.extended, two.expected_error_m, other) <
         std::tuple(one.extended, one.expected_error_m, point);
}

void PointMaker::drop_echoes() {
  std::vector<char> is_surplus(points_.size(), 0);
  parallel_for(points_.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      VoxelSide voxel = unpack(index_.keys()[n]);
      int axis = 2;
      points_[n].normal.cwiseAbs().maxCoeff(&axis);
      voxel.cell[axis] -= 1;
      for (int step = 0; step < 2; ++step, voxel.cell[axis] += 2)
        for (voxel.side = 0; voxel.side < 2; ++voxel.side) {
          const std::uint32_t other = index_.find(pack(voxel));
          if (other != VoxelIndex::none && is_echo(n, other, axis)) is_surplus[n] = 1;
        }
    }
  });
  std::size_t kept = 0;
  for (std::size_t n = 0; n < points_.size(); ++n) {
    if (is_surplus[n] != 0)
      counts_.merged += points_[n].is_wanted ? 1 : 0;
    else
      points_[kept++] = points_[n];
  }
  points_.resize(kept);
}

SurfacePoints PointMaker::make_cloud() {
  PointCloud cloud;
  ScalarField views{"views", ScalarType::uint16, {}};
  ScalarField errors{"expected_error", ScalarType::float32, {}};
  cloud.positions.reserve(points_.size());
  cloud.normals.reserve(points_.size());
  views.values.reserve(points_.size());
  errors.values.reserve(points_.size());
  std::vector<std::size_t> wanted;
  for (const MergedPoint& point : points_) {
    if (point.is_wanted) wanted.push_back(cloud.size());
    cloud.positions.push_back((point.position / point.weight).cast<double>());
    cloud.normals.push_back(point.normal.normalized());
    if (surface_.has_color) cloud.colors.push_back(to_color(point.color / point.weight));
    views.values.push_back(std::min(65535.0, static_cast<double>(point.frames)));
    errors.values.push_back(static_cast<double>(point.expected_error_m));
    counts_.extended_points += point.extended && point.is_wanted ? 1 : 0;
  }
  fit_normals(cloud, normal_radius_voxels * voxel_size_m_, errors.values);
  cloud.fields = {std::move(views), std::move(errors)};
  if (wanted.size() < cloud.size()) cloud = select_points(cloud, wanted);
  return {std::move(cloud), counts_};
}

}  // namespace

void fit_normals(PointCloud& cloud, double radius_m, const std::vector<double>& deviations_m) {
  if (cloud.empty()) return;
  const NeighborCells cells(cloud, radius_m, deviations_m);
  std::vector<Eigen::Vector3f> fitted(cloud.size());
  parallel_for(cells.size(), 256, [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> neighbors;
    for (std::size_t c = begin; c < end; ++c) {
      cells.gather(c, neighbors);
      const std::span<const std::uint32_t> members = cells.members(c);
      for (std::size_t i = 0; i < members.size(); ++i)
        fitted[members[i]] = fitted_normal(neighbors[i], neighbors);
    }
  });
  cloud.normals = std::move(fitted);
}

SurfacePoints make_surface_points(const RefinedSurface& surface, double voxel_size_m,
                                  const TileMask& cells, const SurfacePointOptions& options) {
  return PointMaker(surface, voxel_size_m, cells, options).run();
}

}  // namespace libmap
