#include "libmap/surface/surface_reconstruction.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/geometry/normal_sides.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/geometry/voxel_key.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/surface_solvers.h"

namespace libmap {

namespace {

// Number of neighbors for estimating the distance between samples.
constexpr std::size_t spacing_neighbors = 8;
// Minimum weight of a point.
constexpr double min_weight = 1.0 / 16;
// Minimum size of the octree's cube relative to the samples' bounding box.
constexpr double cube_margin = 1.1;
constexpr int min_depth = 3;
constexpr double max_grid_cells = voxel_cell_limit;
// Minimum ratio of the second to the first standard deviation of the positions.
constexpr double min_width = 1e-4;

// Maximum share of neighbors with normals on opposite sides.
constexpr double max_mixed_sides = 0.4;

constexpr std::size_t value_neighbors = 4;
// Maximum distance in cells up to which neighbors other than the nearest influence values.
constexpr double max_value_cells = 12.0;

// Bits dropped from a positive number for a histogram of 64 steps per octave.
constexpr unsigned dropped_bits = 46;

bool has_normal(const PointCloud& cloud, std::size_t n) {
  const float length = cloud.normals[n].norm();
  return cloud.positions[n].allFinite() && std::isfinite(length) && length > 0.0F;
}

// Maximum distance of samples from the surface, in cells.
double max_reach_cells(const SurfaceReconstructionOptions& options) {
  return options.support_cells * max_spacing_cells + 1.0;
}
// Distance between samples, in cells, above which the result does not change.
double max_known_spacing(const SurfaceReconstructionOptions& options) {
  return std::max(max_spacing_cells, max_reach_cells(options) / options.trim_distance_cells);
}

// Sets colors and fields of the vertices to the mean over the 4 nearest points, weighted by
// 1 / (d^2 + radius^2). Integer fields take the nearest point's value. NaN is ignored. `tree`
// contains the cloud's positions.
void transfer_values(const PointCloud& cloud, const PointTree& tree, double cell_size_m,
                     TriangleMesh& mesh) {
  const double radius_m = 0.5 * cell_size_m;
  const double max_m = max_value_cells * cell_size_m;
  const std::size_t count = mesh.vertices.size();
  mesh.vertex_colors.assign(cloud.has_colors() ? count : 0, Color{});
  mesh.vertex_fields.clear();
  for (const ScalarField& field : cloud.fields)
    mesh.vertex_fields.push_back({field.name, field.type, std::vector<double>(count, 0.0)});
  if (cloud.empty() || (!cloud.has_colors() && cloud.fields.empty())) return;
  parallel_each(count, 1024, [&](std::size_t v) {
    auto neighbors = tree.nearest(mesh.vertices[v], value_neighbors);
    while (neighbors.back().square_m2 > max_m * max_m && neighbors.size() > 1) neighbors.pop_back();
    const auto weight = [&](const NeighborPoint& point) {
      return 1.0 / (point.square_m2 + radius_m * radius_m);
    };
    if (cloud.has_colors()) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      double weights = 0.0;
      for (const NeighborPoint& point : neighbors) {
        const Color& color = cloud.colors[point.index];
        sum += weight(point) * Eigen::Vector3d(color[0], color[1], color[2]);
        weights += weight(point);
      }
      for (std::size_t c = 0; c < 3; ++c)
        mesh.vertex_colors[v][c] = static_cast<std::uint8_t>(
            std::lround(std::clamp(sum[static_cast<Eigen::Index>(c)] / weights, 0.0, 255.0)));
    }
    for (std::size_t f = 0; f < cloud.fields.size(); ++f) {
      const ScalarField& field = cloud.fields[f];
      double& value = mesh.vertex_fields[f].values[v];
      value = field.values[neighbors.front().index];
      if (is_integer(field.type)) continue;
      double sum = 0.0;
      double weights = 0.0;
      for (const NeighborPoint& point : neighbors) {
        if (std::isnan(field.values[point.index])) continue;
        sum += weight(point) * field.values[point.index];
        weights += weight(point);
      }
      if (weights > 0.0) value = sum / weights;
    }
  });
}

struct UsedPoint {
  std::size_t index;
  Eigen::Vector3i cell;
  Eigen::Vector3d position;  // cells
};

class Reconstruction {
 public:
  // `statistics` of the whole cloud, of which `cloud` is a part; nullptr: `cloud` is the whole.
  Reconstruction(const PointCloud& cloud, const CloudStatistics* statistics,
                 const SurfaceReconstructionOptions& options, Progress& progress)
      : cloud_(cloud), options_(options), progress_(progress), is_part_(statistics != nullptr) {
    if (is_part_) statistics_ = *statistics;
  }

  SurfaceReconstructionResult run(const AnnounceWork& announce = {}) {
    if (is_part_ && cloud_.empty()) return {};
    timed("samples", [&] {
      choose_points();
      choose_cell_size();
      if (!is_part_) check_cell_size();
      if (announce) announce(expected_work());
      make_samples();
      find_spacings();
    });
    if (samples_.empty()) return std::move(result_);
    TriangleMesh surface;
    const bool is_poisson = options_.method == SurfaceMethod::poisson;
    timed(is_poisson ? "poisson" : "implicit", [&] {
      progress_.begin("reconstruction", 0);
      surface = is_poisson
                    ? solve_poisson(samples_, problem_)
                    : implicit_surface(samples_, result_.cell_size_m, options_.support_cells);
    });
    timed("trimming", [&] { trim(surface); });
    timed("values", [&] {
      transfer_values(cloud_, PointTree(cloud_.positions), result_.cell_size_m, result_.mesh);
      result_.mesh.vertex_normals = estimate_vertex_normals(result_.mesh);
    });
    return std::move(result_);
  }

 private:
  template <typename Step>
  void timed(const char* name, const Step& step) {
    libmap::timed(result_.timings_s, name, step);
  }

  Eigen::Vector3d in_cells(const Eigen::Vector3d& position) const {
    return (position - origin_) / result_.cell_size_m;
  }

  void choose_points();
  void choose_cell_size();
  SurfaceWork expected_work() const;
  void check_cell_size();
  double weight_of(std::size_t point) const;
  void make_samples();
  void add_cell(const UsedPoint* begin, const UsedPoint* end);
  void find_spacings();
  void trim(TriangleMesh& surface);

  const PointCloud& cloud_;
  const SurfaceReconstructionOptions& options_;
  Progress& progress_;
  bool is_part_;
  CloudStatistics statistics_;
  std::vector<std::size_t> used_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double median_error_m_ = 0.0;
  double area_m2_ = 0.0;  // estimated from number and spacing of the points; not set for a part
  const ScalarField* errors_ = nullptr;
  PoissonProblem problem_;
  std::vector<SurfaceSample> samples_;      // relative to the origin
  std::vector<Eigen::Vector3d> positions_;  // positions of the samples, relative to the origin
  std::optional<PointTree> tree_;           // of positions_
  std::vector<double> spacings_m_;          // local distance between samples
  SurfaceReconstructionResult result_;
};

void Reconstruction::choose_points() {
  cloud_.check();
  if (!is_part_) statistics_.add(cloud_, options_.weigh_by_error);
  if (!cloud_.has_normals()) throw Error("the cloud has none", {.field = "normals"});
  for (std::size_t n = 0; n < cloud_.size(); ++n)
    if (has_normal(cloud_, n)) used_.push_back(n);
  result_.dropped_points = cloud_.size() - used_.size();
  if (statistics_.points() == 0) throw Error("none is finite", {.field = "normals"});
  const double opposing = opposing_fraction(cloud_.positions, cloud_.normals);
  if (opposing > max_mixed_sides)
    throw Error("the normals are not consistently oriented; use --normals estimate",
                {.field = "share of neighbors with normals on opposite sides",
                 .value = to_fixed_text(100.0 * opposing, 1) + " %",
                 .bound = "<= " + to_text(100.0 * max_mixed_sides) + " %"});
  // Sorted, so that the result does not depend on the order of the points.
  const auto& positions = cloud_.positions;
  const auto& normals = cloud_.normals;
  std::sort(used_.begin(), used_.end(), [&](std::size_t a, std::size_t b) {
    return std::tie(positions[a].x(), positions[a].y(), positions[a].z(), normals[a].x(),
                    normals[a].y(), normals[a].z()) < std::tie(positions[b].x(), positions[b].y(),
                                                               positions[b].z(), normals[b].x(),
                                                               normals[b].y(), normals[b].z());
  });
}

void Reconstruction::choose_cell_size() {
  origin_ = statistics_.origin();
  result_.cell_size_m = options_.cell_size_m;
  if (is_part_) return;
  std::vector<Eigen::Vector3d> distinct;
  distinct.reserve(used_.size());
  for (const std::size_t n : used_)
    if (distinct.empty() || distinct.back() != cloud_.positions[n])
      distinct.push_back(cloud_.positions[n]);
  const auto too_thin = [&](const char* reason) {
    return Error(reason,
                 {.field = "number of distinct points", .value = std::to_string(distinct.size())});
  };
  if (distinct.size() < 3) throw too_thin("too few points for a surface");
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& sample_position : distinct)
    mean += (sample_position - distinct.front()) / static_cast<double>(distinct.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& sample_position : distinct) {
    const Eigen::Vector3d arm = sample_position - distinct.front() - mean;
    moments += arm * arm.transpose();
  }
  const Eigen::Vector3d spread = symmetric_eigen(moments).values;
  if (!(spread[1] > min_width * min_width * spread[2]))
    throw too_thin("all points are on a line, so they define no surface");
  const CloudSpacing spacing = point_spacing(distinct);
  result_.spacing_m = spacing.nearest_m;
  if (!(options_.cell_size_m > 0.0)) result_.cell_size_m = result_.spacing_m;
  area_m2_ = static_cast<double>(distinct.size()) * spacing.by_area_m * spacing.by_area_m;
}

// Coefficients measured on rolling ground of 1 million points, with poisson on a site of 300,000.
SurfaceWork Reconstruction::expected_work() const {
  const double points = static_cast<double>(used_.size());
  SurfaceWork work;
  work.triangles = 2.7 * area_m2_ / (result_.cell_size_m * result_.cell_size_m);
  const bool is_poisson = options_.method == SurfaceMethod::poisson;
  work.bytes = 450.0 * points + (is_poisson ? 500.0 : 90.0) * work.triangles;
  work.seconds = 6.5e-6 * points + (is_poisson ? 3e-5 : 4.3e-6) * work.triangles;
  return work;
}

void Reconstruction::check_cell_size() {
  const Bounds3d& bounds = statistics_.bounds();
  const double extent = (bounds.max - bounds.min).maxCoeff();
  // The surface extends by about a cell, so larger cells would create ground around the points.
  if (result_.cell_size_m > extent)
    throw Error("the cells would be larger than the cloud",
                {.field = "cell_size_m",
                 .value = to_text(static_cast<float>(result_.cell_size_m)),
                 .bound = "<= " + to_text(static_cast<float>(extent)) + " m"});
  const bool is_poisson = options_.method == SurfaceMethod::poisson;
  const double cells = cube_margin * extent / result_.cell_size_m;
  const double min_cell_m =
      is_poisson ? cube_margin * extent / std::exp2(max_octree_depth)
                 : std::max(extent / max_grid_cells, result_.spacing_m / max_spacing_cells);
  if (!(result_.cell_size_m >= min_cell_m))
    throw Error(is_poisson ? "the octree would be deeper than " + std::to_string(max_octree_depth) +
                                 " levels"
                           : "too small for the distance between the points",
                {.field = "cell_size_m",
                 .value = to_text(static_cast<float>(result_.cell_size_m)),
                 .bound = ">= " + to_text(static_cast<float>(min_cell_m)) + " m"});
  if (!is_poisson) return;
  problem_.depth = std::max(min_depth, static_cast<int>(std::ceil(std::log2(cells))));
  problem_.cube_m = result_.cell_size_m * std::exp2(problem_.depth);
  problem_.screening = options_.screening;
  problem_.samples_per_cell = options_.samples_per_cell;
  result_.octree_depth = problem_.depth;
}

double Reconstruction::weight_of(std::size_t point) const {
  if (errors_ == nullptr) return 1.0;
  const double ratio = median_error_m_ / errors_->values[point];
  if (std::isnan(ratio)) return 1.0;
  return std::clamp(ratio * ratio, min_weight, 1.0);
}

void Reconstruction::make_samples() {
  median_error_m_ = statistics_.median_error_m();
  errors_ = median_error_m_ > 0.0 ? cloud_.find_field("expected_error") : nullptr;
  std::vector<UsedPoint> points;
  points.reserve(used_.size());
  for (const std::size_t n : used_) {
    const Eigen::Vector3d position = in_cells(cloud_.positions[n]);
    points.push_back({n, position.array().floor().cast<int>(), position});
  }
  // By block, then by cell, so that neighbors in space are neighbors in memory.
  const auto key_of = [](const UsedPoint& point) {
    const Eigen::Vector3i& cell = point.cell;
    return std::tuple(cell.z() >> 3, cell.y() >> 3, cell.x() >> 3, cell.z(), cell.y(), cell.x());
  };
  std::stable_sort(points.begin(), points.end(),
                   [&](const UsedPoint& a, const UsedPoint& b) { return key_of(a) < key_of(b); });
  for (std::size_t begin = 0; begin < points.size();) {
    std::size_t end = begin + 1;
    while (end < points.size() && points[end].cell == points[begin].cell) ++end;
    add_cell(points.data() + begin, points.data() + end);
    begin = end;
  }
  result_.samples = samples_.size();
}

// Adds one sample for each side of the surface in a cell.
void Reconstruction::add_cell(const UsedPoint* begin, const UsedPoint* end) {
  const auto normal_of = [&](const UsedPoint& point) {
    return cloud_.normals[point.index].normalized();
  };
  const Eigen::Vector3f front = normal_of(*begin);
  for (const bool back : {false, true}) {
    double weights = 0.0;
    std::size_t count = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (const UsedPoint* point = begin; point != end; ++point) {
      const Eigen::Vector3f own = normal_of(*point);
      if ((own.dot(front) < 0.0F) != back) continue;
      const double weight = weight_of(point->index);
      weights += weight;
      ++count;
      position += weight * point->position;
      normal += static_cast<float>(weight) * own;
    }
    if (count == 0) continue;
    SurfaceSample sample;
    sample.position = (position / weights * result_.cell_size_m).cast<float>();
    sample.normal = normal.normalized();
    sample.weight = static_cast<float>(weights / static_cast<double>(count));
    samples_.push_back(sample);
  }
}

void Reconstruction::find_spacings() {
  positions_.reserve(samples_.size());
  for (const SurfaceSample& sample : samples_) positions_.push_back(sample.position.cast<double>());
  spacings_m_.resize(samples_.size());
  const double max_m = options_.method == SurfaceMethod::poisson
                           ? std::numeric_limits<double>::infinity()
                           : max_known_spacing(options_) * result_.cell_size_m;
  tree_.emplace(positions_);
  const PointTree& tree = *tree_;
  parallel_each(samples_.size(), 1024, [&](std::size_t n) {
    const auto neighbors = tree.nearest(positions_[n], spacing_neighbors + 1);
    spacings_m_[n] = max_m;
    if (is_part_ && neighbors.size() <= spacing_neighbors) return;
    // Number of samples in the disc up to the farthest neighbor.
    const double count = static_cast<double>(neighbors.size()) - 0.5;
    spacings_m_[n] =
        std::min(max_m, std::sqrt(std::numbers::pi * neighbors.back().square_m2 / count));
  });
  for (std::size_t n = 0; n < samples_.size(); ++n)
    samples_[n].spacing_m =
        static_cast<float>(std::min(spacings_m_[n], max_spacing_cells * result_.cell_size_m));
}

// Keeps the triangles near samples that have the orientation of the samples.
void Reconstruction::trim(TriangleMesh& surface) {
  const PointTree& tree = *tree_;
  std::vector<std::uint32_t> sample_of(surface.vertices.size());  // sample near a vertex, or none
  constexpr std::uint32_t none = 0xffffffff;
  parallel_each(sample_of.size(), 1024, [&](std::size_t v) {
    const NeighborPoint nearest = tree.first_of_nearest(surface.vertices[v]);
    const double reach =
        options_.trim_distance_cells * std::max(result_.cell_size_m, spacings_m_[nearest.index]);
    const bool is_far = nearest.square_m2 > reach * reach;
    sample_of[v] = is_far ? none : static_cast<std::uint32_t>(nearest.index);
  });
  tree_.reset();
  std::vector<char> near(surface.triangles.size());
  parallel_each(near.size(), 4096, [&](std::size_t n) {
    const Triangle& triangle = surface.triangles[n];
    const Eigen::Vector3d normal = area_normal(surface, triangle);
    near[n] = std::none_of(triangle.begin(), triangle.end(), [&](std::uint32_t corner) {
      const std::uint32_t sample = sample_of[corner];
      return sample == none || samples_[sample].normal.cast<double>().dot(normal) < 0.0;
    });
  });
  result_.trimmed_triangles = static_cast<std::size_t>(std::count(near.begin(), near.end(), 0));
  result_.mesh = select_triangles(surface, {near.begin(), near.end()});
  for (Eigen::Vector3d& vertex : result_.mesh.vertices) vertex += origin_;
}

}  // namespace

void CloudStatistics::add(const PointCloud& cloud, bool weigh_by_error) {
  if (!cloud.empty() && !cloud.has_normals())
    throw Error("the cloud has none", {.field = "normals"});
  const ScalarField* errors = weigh_by_error ? cloud.find_field("expected_error") : nullptr;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    if (!has_normal(cloud, n)) {
      ++dropped_;
      continue;
    }
    const Eigen::Vector3d& sample_position = cloud.positions[n];
    bounds_.min =
        points_ == 0 ? sample_position : Eigen::Vector3d(bounds_.min.cwiseMin(sample_position));
    bounds_.max =
        points_ == 0 ? sample_position : Eigen::Vector3d(bounds_.max.cwiseMax(sample_position));
    ++points_;
    if (errors != nullptr && errors->values[n] > 0.0 && std::isfinite(errors->values[n]))
      ++errors_[std::bit_cast<std::uint64_t>(errors->values[n]) >> dropped_bits];
  }
}

double CloudStatistics::median_error_m() const {
  std::size_t count = 0;
  for (const auto& [bits, number] : errors_) count += number;
  std::size_t below = 0;
  for (const auto& [bits, number] : errors_) {
    below += number;
    // Center of the histogram's step.
    if (2 * below > count) return std::bit_cast<double>((2 * bits + 1) << (dropped_bits - 1));
  }
  return 0.0;
}

void bind(ParameterTable& table, SurfaceReconstructionOptions& options) {
  table.add("method", options.method,
            {{"implicit", SurfaceMethod::implicit}, {"poisson", SurfaceMethod::poisson}},
            "reconstruction method; implicit: algebraic point set surface; poisson: screened "
            "Poisson reconstruction");
  table.add("support_cells", options.support_cells, {1.5, 10.0},
            "method implicit: radius of influence of a point, as a multiple of the cell size or, "
            "if larger, of the distance between points");
  table.add("cell_size_m", options.cell_size_m, not_negative,
            "size of the finest cells of the reconstruction, m, which is also the approximate edge "
            "length of the mesh; 0: the median distance between neighboring points");
  table.add("screening", options.screening, not_negative,
            "method poisson: weight of the points relative to the smoothness of the surface");
  table.add("weigh_by_error", options.weigh_by_error,
            "weight points by the inverse square of their field expected_error (m), if it exists");
  table.add("samples_per_cell", options.samples_per_cell, positive,
            "method poisson: minimum number of points per cell; cells with fewer are enlarged");
  table.add("trim_distance_cells", options.trim_distance_cells, positive,
            "maximum distance between the surface and the nearest point, as a multiple of the cell "
            "size or, if larger, of the distance between points; the surface beyond it is removed");
}

SurfaceReconstructionResult reconstruct_surface(const PointCloud& cloud,
                                                const SurfaceReconstructionOptions& options,
                                                Progress& progress, const AnnounceWork& announce) {
  check_parameters(options);
  return Reconstruction(cloud, nullptr, options, progress).run(announce);
}

SurfaceReconstructionResult reconstruct_part(const PointCloud& part,
                                             const CloudStatistics& statistics,
                                             const SurfaceReconstructionOptions& options,
                                             Progress& progress) {
  check_parameters(options);
  surface_margin_m(options);
  return Reconstruction(part, &statistics, options, progress).run();
}

double surface_margin_m(const SurfaceReconstructionOptions& options) {
  if (options.method != SurfaceMethod::implicit)
    throw Error("this method cannot reconstruct a surface in tiles",
                {.field = "method", .value = "poisson", .bound = "implicit"});
  if (!(options.cell_size_m > 0.0))
    throw Error("reconstruction in tiles requires a cell size",
                {.field = "cell_size_m", .value = to_text(options.cell_size_m), .bound = "> 0"});
  // A vertex depends on the samples that reach its cube. Each sample depends on its neighbors and
  // on the points of its cell.
  const double around =
      max_known_spacing(options) *
      std::sqrt((static_cast<double>(spacing_neighbors) + 0.5) / std::numbers::pi);
  const double cells = std::max(max_reach_cells(options) + around, max_value_cells) + 4.0;
  return cells * options.cell_size_m;
}

void describe(ResultTable& table, const SurfaceReconstructionResult& result) {
  table.add("dropped_points", result.dropped_points, "number of dropped points (without normal)");
  table.add("cell_size_m", result.cell_size_m, "size of the reconstruction's finest cells, m");
  table.add("spacing_m", result.spacing_m, "median distance between neighboring points, m");
  table.add("samples", result.samples, "number of samples to which the points were reduced");
  table.add("octree_depth", result.octree_depth,
            "depth of the octree of method poisson, otherwise 0");
  table.add("trimmed_triangles", result.trimmed_triangles,
            "number of triangles removed: far from points, or opposed to the points' normals");
}

}  // namespace libmap
