#include "libgtd/shape/curvature.h"

#include <pcl/common/eigen.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "libgtd/shape/neighbor_loops.h"
#include "libgtd/shape/point_grid.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr std::size_t cells_at_once = 16;
constexpr std::uint32_t max_inserted = 32;  // maximum bucket size for insertion sort
// Maximum number of neighbors that are stored for the second pass; others are searched again.
constexpr std::size_t max_kept_neighbors = std::size_t{1} << 26;

// Three numbers, padded to a register.
using Quad [[gnu::vector_size(16)]] = float;

Quad quad(float x, float y, float z) { return Quad{x, y, z, 0.0F}; }
// Rotates to y, z, x, for the products xy, yz, zx.
Quad turned(const Quad& q) { return __builtin_shufflevector(q, q, 1, 2, 0, 3); }

// Sums of x, y, z, their squares, and xy, yz, zx, each in the order of the additions.
struct Sums {
  Quad of{}, squares{}, products{};

  void add(const Quad& q) {
    of += q;
    add_products(q);
  }
  void add_products(const Quad& q) {
    squares += q * q;
    products += q * turned(q);
  }
};

using Numbers = std::vector<std::uint32_t>;  // numbers of candidates

// Candidates near a cell of the grid, from which the neighbors of its points are selected.
class NeighborSearch {
 public:
  NeighborSearch(const std::vector<Quad>& quads, const PointGrid& grid, double radius)
      : quads_(quads), grid_(grid), limit_(static_cast<float>(radius * radius)) {}

  // Lists the points around a cell by number.
  void list(const PointGrid::Cell& cell) {
    grid_.find_near(cell, 2, runs_);
    candidates_.clear();
    for (const PointGrid::Range& run : runs_)
      candidates_.insert(candidates_.end(), grid_.order().begin() + run.first,
                         grid_.order().begin() + run.last);
  }
  const std::vector<std::uint32_t>& candidates() const { return candidates_; }

  // Lists the points around a cell and prepares find() for the points of this cell.
  void enter(const PointGrid::Cell& cell) {
    list(cell);
    const std::size_t count = candidates_.size();
    const std::size_t room = count + NeighborLoops::rank_lanes;
    near_.resize(count);
    for (std::vector<float>* values : {&x_, &y_, &z_})
      values->assign(room, std::numeric_limits<float>::infinity());
    for (std::size_t n = 0; n < count; ++n) {
      const Quad& quad_at = near_[n] = quads_[candidates_[n]];
      x_[n] = quad_at[0];
      y_[n] = quad_at[1];
      z_[n] = quad_at[2];
    }
    keys_.resize(room);
    sorted_.resize(room);
  }
  // Positions of the candidates.
  const std::vector<Quad>& near() const { return near_; }

  // Keys of the neighbors of a point of this cell, including itself, by distance, then by index.
  std::span<const std::uint64_t> find(const Quad& at) {
    const float center[3] = {at[0], at[1], at[2]};
    const std::size_t count = loops_.rank(x_.data(), y_.data(), z_.data(), candidates_.size(),
                                          center, limit_, keys_.data());
    sort(count);
    return {sorted_.data(), count};
  }
  static std::uint32_t candidate_of(std::uint64_t key) { return static_cast<std::uint32_t>(key); }

 private:
  static std::uint32_t distance_of(std::uint64_t key) {
    return static_cast<std::uint32_t>(key >> 32);
  }

  // Bucket sort: squared distances to points of a surface are uniformly distributed. If the radius
  // is far larger than the cloud, one bucket contains all.
  void sort(std::size_t count) {
    constexpr std::size_t buckets = 256;
    std::uint32_t begin_of[buckets + 1] = {};
    const float scale = static_cast<float>(buckets) / limit_;
    const auto bucket_of = [&](std::uint64_t key) {
      const float bucket = std::bit_cast<float>(distance_of(key)) * scale;
      return std::min(static_cast<std::size_t>(static_cast<int>(bucket)), buckets - 1);
    };
    for (std::size_t n = 0; n < count; ++n) ++begin_of[bucket_of(keys_[n]) + 1];
    for (std::size_t b = 1; b < buckets; ++b) begin_of[b] += begin_of[b - 1];
    for (std::size_t n = 0; n < count; ++n) sorted_[begin_of[bucket_of(keys_[n])]++] = keys_[n];
    const auto is_before = [&](std::uint64_t a, std::uint64_t b) { return comes_before(a, b); };
    for (std::size_t b = 0, begin = 0; b < buckets; begin = begin_of[b++])
      if (begin_of[b] - begin > max_inserted)
        std::sort(sorted_.begin() + static_cast<std::ptrdiff_t>(begin),
                  sorted_.begin() + static_cast<std::ptrdiff_t>(begin_of[b]), is_before);
    for (std::size_t n = 1; n < count; ++n) {
      const std::uint64_t key = sorted_[n];
      std::size_t to = n;
      for (; to > 0 && comes_before(key, sorted_[to - 1]); --to) sorted_[to] = sorted_[to - 1];
      sorted_[to] = key;
    }
  }

  bool comes_before(std::uint64_t a, std::uint64_t b) const {
    if (distance_of(a) != distance_of(b)) return a < b;
    return candidates_[candidate_of(a)] < candidates_[candidate_of(b)];
  }

  const std::vector<Quad>& quads_;
  const PointGrid& grid_;
  float limit_;
  const NeighborLoops& loops_ = neighbor_loops_of(libmap::best_instruction_set());
  std::vector<PointGrid::Range> runs_;
  std::vector<std::uint32_t> candidates_;
  std::vector<Quad> near_;
  std::vector<float> x_, y_, z_;
  std::vector<std::uint64_t> keys_, sorted_;
};

Matrix3f symmetric(float xx, float xy, float xz, float yy, float yz, float zz) {
  Matrix3f matrix;
  matrix << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return matrix;
}

// Sums relative to the first point, as in computeMeanAndCovarianceMatrix.
Matrix3f covariance_of(const std::vector<Quad>& near, const Numbers& neighbors) {
  const Quad origin = near[neighbors.front()];
  Sums sums;
  for (const std::uint32_t n : neighbors) sums.add(near[n] - origin);
  const auto count = static_cast<float>(neighbors.size());
  const Quad mean = sums.of / count;
  const Quad squares = sums.squares / count - mean * mean;
  const Quad products = sums.products / count - mean * turned(mean);
  return symmetric(squares[0], products[0], products[2], squares[1], products[1], squares[2]);
}

// Normal toward the origin, as in computePointNormal and flipNormalTowardsViewpoint.
Vector3f normal_of(const std::vector<Quad>& near, const Quad& at, const Numbers& neighbors) {
  if (neighbors.size() < 3) return Vector3f::Constant(Curvature::nan);
  float smallest = 0;
  Vector3f normal;
  pcl::eigen33(covariance_of(near, neighbors), smallest, normal);
  // Four components, because their products are added in a different order than those of three.
  const Eigen::Vector4f to_origin(0.0F - at[0], 0.0F - at[1], 0.0F - at[2], 0.0F);
  const Eigen::Vector4f plane(normal[0], normal[1], normal[2], 0.0F);
  if (to_origin.dot(plane) < 0) normal *= -1;
  return normal;
}

// Covariance of the neighbors' normals in the tangent plane, as in computePointPrincipalCurvatures.
// As in PCL, one neighbor without a normal invalidates the sum. `normals` are those of the
// candidates.
Curvature curvature_of(const Vector3f& normal, const std::vector<Quad>& normals,
                       const Numbers& neighbors, std::vector<Quad>& projected) {
  const Matrix3f to_tangent = Matrix3f::Identity() - normal * normal.transpose();
  const auto column = [&](int n) {
    return quad(to_tangent(0, n), to_tangent(1, n), to_tangent(2, n));
  };
  const Quad a = column(0), b = column(1), c = column(2);
  Quad mean{};
  projected.resize(neighbors.size());
  for (std::size_t n = 0; n < neighbors.size(); ++n) {
    const Quad& one = normals[neighbors[n]];
    // In the order of additions of Eigen's 3x3 matrix-vector product.
    projected[n] = a * one[0] + (b * one[1] + c * one[2]);
    mean += projected[n];
  }
  const auto count = static_cast<float>(neighbors.size());
  mean /= count;
  Sums sums;
  for (const Quad& one : projected) sums.add_products(one - mean);
  Vector3f widths;
  pcl::eigen33(symmetric(sums.squares[0], sums.products[0], sums.products[2], sums.squares[1],
                         sums.products[1], sums.squares[2]),
               widths);
  Curvature result;
  const float inverse = 1.0F / count;
  result.k1 = widths[2] * inverse;
  result.k2 = widths[1] * inverse;
  result.normal = normal;
  result.valid = std::isfinite(result.k1) && std::isfinite(result.k2) && normal.allFinite();
  return result.valid ? result : Curvature{};
}

// Lists of the neighbors of the points of a run of cells, one list after another.
struct KeptNeighbors {
  bool complete = false;
  Numbers lists;
  std::vector<std::size_t> ends;
};

class CurvatureEstimation {
 public:
  CurvatureEstimation(const libmap::PointCloud& cloud, double radius)
      : radius_(radius),
        quads_(quads_of(cloud)),
        grid_(positions_of(quads_), 0.5 * radius * (1 + 1e-5)) {}

  std::vector<Curvature> run(std::size_t points, const std::vector<std::size_t>& queries) {
    std::vector<Quad> normals(points, quad(Curvature::nan, Curvature::nan, Curvature::nan));
    kept_.resize((grid_.cells().size() + cells_at_once - 1) / cells_at_once);
    for_each_run([&](const Run& run) { find_normals(run, normals); });
    std::vector<std::uint8_t> wanted(points, 0);
    for (const std::size_t query : queries) wanted[query] = 1;
    std::vector<Curvature> of_points(points);
    for_each_run([&](const Run& run) { find_curvatures(run, normals, wanted, of_points); });
    std::vector<Curvature> results;
    results.reserve(queries.size());
    for (const std::size_t query : queries) results.push_back(of_points[query]);
    return results;
  }

 private:
  // Cells begin .. end - 1, and their stored neighbors.
  struct Run {
    std::size_t begin = 0;
    std::size_t end = 0;
    KeptNeighbors& kept;
  };

  static std::vector<Quad> quads_of(const libmap::PointCloud& cloud) {
    std::vector<Quad> quads;
    quads.reserve(cloud.size());
    for (const Eigen::Vector3d& p : cloud.positions) {
      const Vector3f at = p.cast<float>();
      quads.push_back(quad(at.x(), at.y(), at.z()));
    }
    return quads;
  }
  static std::vector<Eigen::Vector3d> positions_of(const std::vector<Quad>& quads) {
    std::vector<Eigen::Vector3d> positions;
    positions.reserve(quads.size());
    for (const Quad& quad_at : quads)
      positions.emplace_back(static_cast<double>(quad_at[0]), static_cast<double>(quad_at[1]),
                             static_cast<double>(quad_at[2]));
    return positions;
  }

  template <typename Body>
  void for_each_run(const Body& body) {
    libmap::parallel_for(grid_.cells().size(), cells_at_once,
                         [&](std::size_t begin, std::size_t end) {
                           body(Run{begin, end, kept_[begin / cells_at_once]});
                         });
  }

  using PositionBits = std::array<std::uint32_t, 3>;
  PositionBits bits_of(std::uint32_t point) const {
    const Quad& at = quads_[point];
    return {std::bit_cast<std::uint32_t>(at[0]), std::bit_cast<std::uint32_t>(at[1]),
            std::bit_cast<std::uint32_t>(at[2])};
  }

  // Calls visit(point, twin); `twin` is true if the point coincides with the previous one and thus
  // has the same neighbors.
  template <typename Visit>
  void for_each_point(std::size_t cell, const Visit& visit) const {
    const PointGrid::Range range = grid_.ranges()[cell];
    Numbers points(grid_.order().begin() + range.first, grid_.order().begin() + range.last);
    std::sort(points.begin(), points.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(bits_of(a), a) < std::pair(bits_of(b), b);
    });
    for (std::size_t n = 0; n < points.size(); ++n)
      visit(points[n], n > 0 && bits_of(points[n]) == bits_of(points[n - 1]));
  }

  static void numbers_of(std::span<const std::uint64_t> keys, Numbers& numbers) {
    numbers.resize(keys.size());
    for (std::size_t n = 0; n < keys.size(); ++n)
      numbers[n] = NeighborSearch::candidate_of(keys[n]);
  }

  void find_normals(const Run& run, std::vector<Quad>& normals) {
    NeighborSearch search(quads_, grid_, radius_);
    Numbers neighbors;
    const bool keep = kept_count_ < max_kept_neighbors;
    for (std::size_t c = run.begin; c < run.end; ++c) {
      search.enter(grid_.cells()[c]);
      Quad found{};
      for_each_point(c, [&](std::uint32_t point, bool twin) {
        if (twin) {
          normals[point] = found;
          return;
        }
        numbers_of(search.find(quads_[point]), neighbors);
        const Vector3f normal = normal_of(search.near(), quads_[point], neighbors);
        normals[point] = found = quad(normal[0], normal[1], normal[2]);
        if (!keep) return;
        run.kept.lists.insert(run.kept.lists.end(), neighbors.begin(), neighbors.end());
        run.kept.ends.push_back(run.kept.lists.size());
      });
    }
    run.kept.complete = keep;
    if (keep) kept_count_ += run.kept.lists.size();
  }

  void find_curvatures(const Run& run, const std::vector<Quad>& normals,
                       const std::vector<std::uint8_t>& wanted, std::vector<Curvature>& results) {
    NeighborSearch search(quads_, grid_, radius_);
    Numbers neighbors;
    std::vector<Quad> near_normals, projected;
    std::size_t list = 0;
    std::size_t first = 0;
    const auto find = [&](std::uint32_t point) {
      if (!run.kept.complete) return numbers_of(search.find(quads_[point]), neighbors);
      const std::size_t last = run.kept.ends[list++];
      neighbors.assign(run.kept.lists.begin() + static_cast<std::ptrdiff_t>(first),
                       run.kept.lists.begin() + static_cast<std::ptrdiff_t>(last));
      first = last;
    };
    for (std::size_t c = run.begin; c < run.end; ++c) {
      if (run.kept.complete)
        search.list(grid_.cells()[c]);
      else
        search.enter(grid_.cells()[c]);
      near_normals.clear();
      for (const std::uint32_t point : search.candidates()) near_normals.push_back(normals[point]);
      std::optional<Curvature> found;
      for_each_point(c, [&](std::uint32_t point, bool twin) {
        if (!twin) {
          find(point);
          found.reset();
        }
        if (wanted[point] == 0) return;
        const Quad& normal = normals[point];
        if (!found)
          found =
              curvature_of({normal[0], normal[1], normal[2]}, near_normals, neighbors, projected);
        results[point] = *found;
      });
    }
  }

  double radius_;
  std::vector<Quad> quads_;
  PointGrid grid_;
  std::vector<KeptNeighbors> kept_;
  std::atomic<std::size_t> kept_count_ = 0;
};

}  // namespace

std::vector<Curvature> estimate_thesis_curvature(const libmap::PointCloud& cloud, double radius_m,
                                                 const std::vector<std::size_t>& queries) {
  if (queries.empty()) return {};
  return CurvatureEstimation(cloud, radius_m).run(cloud.size(), queries);
}

}  // namespace libgtd
