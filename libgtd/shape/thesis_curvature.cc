#include "libgtd/shape/thesis_curvature.h"

#include <pcl/common/eigen.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

#include "libgtd/shape/point_grid.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr std::size_t cells_at_once = 16;
// Neighbours are found once and kept for the second pass while there is room for them.
constexpr std::size_t max_kept_neighbors = std::size_t{1} << 26;

struct Place {
  float x, y, z;
};

// The points near one cell of the grid, of which each point of the cell takes its neighbours.
class NeighborSearch {
 public:
  NeighborSearch(const std::vector<Place>& places, const PointGrid& grid, double radius)
      : places_(places), grid_(grid), limit_(static_cast<float>(radius * radius)) {}

  void enter(const PointGrid::Cell& cell) {
    candidates_.clear();
    PointGrid::Cell near;
    for (near[0] = cell[0] - 2; near[0] <= cell[0] + 2; ++near[0])
      for (near[1] = cell[1] - 2; near[1] <= cell[1] + 2; ++near[1])
        for (near[2] = cell[2] - 2; near[2] <= cell[2] + 2; ++near[2]) {
          const PointGrid::Range range = grid_.range_of(near);
          candidates_.insert(candidates_.end(), grid_.order().begin() + range.first,
                             grid_.order().begin() + range.last);
        }
    const std::size_t count = candidates_.size();
    for (std::vector<float>* values : {&x_, &y_, &z_, &distances_}) values->resize(count);
    for (std::size_t n = 0; n < count; ++n) {
      const Place& place = places_[candidates_[n]];
      x_[n] = place.x;
      y_[n] = place.y;
      z_[n] = place.z;
    }
    keys_.resize(count);
    sorted_.resize(count);
  }

  // The neighbours of a point of that cell, among them itself.
  void find(const Place& at, std::vector<std::uint32_t>& neighbors) {
    const std::size_t count = select(at);
    sort(count);
    neighbors.resize(count);
    for (std::size_t n = 0; n < count; ++n) neighbors[n] = candidates_[candidate_of(sorted_[n])];
  }

 private:
  // Squared distance above, candidate below: positive floats order as their bits do.
  static std::uint32_t distance_of(std::uint64_t key) {
    return static_cast<std::uint32_t>(key >> 32);
  }
  static std::uint32_t candidate_of(std::uint64_t key) { return static_cast<std::uint32_t>(key); }

  std::size_t select(const Place& at) {
    const std::size_t all = candidates_.size();
    for (std::size_t n = 0; n < all; ++n) {
      const float x = at.x - x_[n], y = at.y - y_[n], z = at.z - z_[n];
      distances_[n] = x * x + y * y + z * z;
    }
    std::size_t count = 0;
    for (std::size_t n = 0; n < all; ++n) {
      keys_[count] = std::uint64_t{std::bit_cast<std::uint32_t>(distances_[n])} << 32 | n;
      count += distances_[n] < limit_ ? 1 : 0;
    }
    return count;
  }

  // Squared distances to points of a surface are spread evenly: buckets leave little to sort.
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
    for (std::size_t n = 1; n < count; ++n) {
      const std::uint64_t key = sorted_[n];
      std::size_t to = n;
      for (; to > 0 && comes_before(key, sorted_[to - 1]); --to) sorted_[to] = sorted_[to - 1];
      sorted_[to] = key;
    }
  }

  bool comes_before(std::uint64_t a, std::uint64_t b) const {
    if (distance_of(a) != distance_of(b)) return distance_of(a) < distance_of(b);
    return candidates_[candidate_of(a)] < candidates_[candidate_of(b)];
  }

  const std::vector<Place>& places_;
  const PointGrid& grid_;
  float limit_;
  std::vector<std::uint32_t> candidates_;
  std::vector<float> x_, y_, z_, distances_;
  std::vector<std::uint64_t> keys_, sorted_;
};

// Sums relative to the first point, as computeMeanAndCovarianceMatrix.
Matrix3f covariance_of(const std::vector<Place>& places,
                       const std::vector<std::uint32_t>& neighbors) {
  const Place origin = places[neighbors.front()];
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, x_sum = 0, y_sum = 0, z_sum = 0;
  for (const std::uint32_t n : neighbors) {
    const float x = places[n].x - origin.x, y = places[n].y - origin.y, z = places[n].z - origin.z;
    xx += x * x;
    xy += x * y;
    xz += x * z;
    yy += y * y;
    yz += y * z;
    zz += z * z;
    x_sum += x;
    y_sum += y;
    z_sum += z;
  }
  const auto count = static_cast<float>(neighbors.size());
  const float x = x_sum / count, y = y_sum / count, z = z_sum / count;
  Matrix3f covariance;
  covariance(0, 0) = xx / count - x * x;
  covariance(0, 1) = covariance(1, 0) = xy / count - x * y;
  covariance(0, 2) = covariance(2, 0) = xz / count - x * z;
  covariance(1, 1) = yy / count - y * y;
  covariance(1, 2) = covariance(2, 1) = yz / count - y * z;
  covariance(2, 2) = zz / count - z * z;
  return covariance;
}

// Toward the frame's origin, as computePointNormal and flipNormalTowardsViewpoint.
Vector3f normal_of(const std::vector<Place>& places, const Place& at,
                   const std::vector<std::uint32_t>& neighbors) {
  if (neighbors.size() < 3) return Vector3f::Constant(Curvature::nan);
  float smallest = 0;
  Vector3f normal;
  pcl::eigen33(covariance_of(places, neighbors), smallest, normal);
  // Of four components, whose products are added in another order than those of three.
  const Eigen::Vector4f to_origin(0.0F - at.x, 0.0F - at.y, 0.0F - at.z, 0.0F);
  const Eigen::Vector4f plane(normal[0], normal[1], normal[2], 0.0F);
  if (to_origin.dot(plane) < 0) normal *= -1;
  return normal;
}

// The covariance of the neighbours' normals in the tangent plane, as
// computePointPrincipalCurvatures. One neighbour without a normal spoils the sum, as in PCL.
Curvature curvature_of(const std::vector<Vector3f>& normals, std::size_t point,
                       const std::vector<std::uint32_t>& neighbors,
                       std::vector<Vector3f>& projected) {
  const Vector3f& normal = normals[point];
  const Matrix3f to_tangent = Matrix3f::Identity() - normal * normal.transpose();
  Vector3f mean = Vector3f::Zero();
  projected.resize(neighbors.size());
  for (std::size_t n = 0; n < neighbors.size(); ++n) {
    projected[n] = to_tangent * normals[neighbors[n]];
    mean += projected[n];
  }
  const auto count = static_cast<float>(neighbors.size());
  mean /= count;
  float xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (const Vector3f& one : projected) {
    const float x = one[0] - mean[0], y = one[1] - mean[1], z = one[2] - mean[2];
    xx += x * x;
    xy += x * y;
    xz += x * z;
    yy += y * y;
    yz += y * z;
    zz += z * z;
  }
  Matrix3f covariance;
  covariance << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  Vector3f widths;
  pcl::eigen33(covariance, widths);
  Curvature result;
  const float inverse = 1.0F / count;
  result.k1 = widths[2] * inverse;
  result.k2 = widths[1] * inverse;
  result.normal = normal;
  result.valid = std::isfinite(result.k1) && std::isfinite(result.k2) && normal.allFinite();
  return result.valid ? result : Curvature{};
}

// The neighbours of the points of a run of cells, one list after the other.
struct KeptNeighbors {
  bool complete = false;
  std::vector<std::uint32_t> lists;
  std::vector<std::size_t> ends;
};

class CurvatureEstimation {
 public:
  CurvatureEstimation(const libmap::PointCloud& cloud, double radius)
      : radius_(radius),
        places_(places_of(cloud)),
        grid_(positions_of(places_), 0.5 * radius * (1 + 1e-5)) {}

  std::vector<Curvature> run(std::size_t points, const std::vector<std::size_t>& queries) {
    normals_.assign(points, Vector3f::Constant(Curvature::nan));
    kept_.resize((grid_.cells().size() + cells_at_once - 1) / cells_at_once);
    for_each_neighborhood([&](std::size_t point, const List& neighbors, Scratch&) {
      normals_[point] = normal_of(places_, places_[point], neighbors);
    });
    std::vector<std::uint8_t> wanted(points, 0);
    for (const std::size_t query : queries) wanted[query] = 1;
    std::vector<Curvature> of_points(points);
    for_each_neighborhood([&](std::size_t point, const List& neighbors, Scratch& projected) {
      if (wanted[point] != 0)
        of_points[point] = curvature_of(normals_, point, neighbors, projected);
    });
    std::vector<Curvature> results;
    results.reserve(queries.size());
    for (const std::size_t query : queries) results.push_back(of_points[query]);
    return results;
  }

 private:
  using List = std::vector<std::uint32_t>;
  using Scratch = std::vector<Vector3f>;

  static std::vector<Place> places_of(const libmap::PointCloud& cloud) {
    std::vector<Place> places;
    places.reserve(cloud.size());
    for (const Eigen::Vector3d& p : cloud.positions) {
      const Vector3f at = p.cast<float>();
      places.push_back({at.x(), at.y(), at.z()});
    }
    return places;
  }
  static std::vector<Eigen::Vector3d> positions_of(const std::vector<Place>& places) {
    std::vector<Eigen::Vector3d> positions;
    positions.reserve(places.size());
    for (const Place& place : places)
      positions.emplace_back(static_cast<double>(place.x), static_cast<double>(place.y),
                             static_cast<double>(place.z));
    return positions;
  }

  // visit(point, neighbours, scratch) for each finite point, cells in parallel.
  template <typename Visit>
  void for_each_neighborhood(const Visit& visit) {
    libmap::parallel_for(grid_.cells().size(), cells_at_once,
                         [&](std::size_t begin, std::size_t end) {
                           KeptNeighbors& kept = kept_[begin / cells_at_once];
                           if (kept.complete)
                             recall(begin, end, kept, visit);
                           else
                             search(begin, end, kept, visit);
                         });
  }

  template <typename Visit>
  void search(std::size_t begin, std::size_t end, KeptNeighbors& kept, const Visit& visit) {
    NeighborSearch near(places_, grid_, radius_);
    List neighbors;
    Scratch scratch;
    const bool keep = kept_count_ < max_kept_neighbors;
    for (std::size_t c = begin; c < end; ++c) {
      near.enter(grid_.cells()[c]);
      const PointGrid::Range range = grid_.ranges()[c];
      for (std::uint32_t k = range.first; k < range.last; ++k) {
        const std::uint32_t point = grid_.order()[k];
        near.find(places_[point], neighbors);
        visit(point, neighbors, scratch);
        if (!keep) continue;
        kept.lists.insert(kept.lists.end(), neighbors.begin(), neighbors.end());
        kept.ends.push_back(kept.lists.size());
      }
    }
    kept.complete = keep;
    if (keep) kept_count_ += kept.lists.size();
  }

  template <typename Visit>
  void recall(std::size_t begin, std::size_t end, const KeptNeighbors& kept, const Visit& visit) {
    List neighbors;
    Scratch scratch;
    std::size_t list = 0;
    std::size_t first = 0;
    for (std::size_t c = begin; c < end; ++c) {
      const PointGrid::Range range = grid_.ranges()[c];
      for (std::uint32_t k = range.first; k < range.last; ++k, ++list) {
        neighbors.assign(kept.lists.begin() + static_cast<std::ptrdiff_t>(first),
                         kept.lists.begin() + static_cast<std::ptrdiff_t>(kept.ends[list]));
        first = kept.ends[list];
        visit(grid_.order()[k], neighbors, scratch);
      }
    }
  }

  double radius_;
  std::vector<Place> places_;
  PointGrid grid_;
  std::vector<Vector3f> normals_;
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
