#include "libmap/cloud/surface_normals.h"

#include <Eigen/Eigenvalues>
#include <cstdint>
#include <span>
#include <utility>

#include "libmap/cloud/surface_voxels.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

constexpr float min_agreement = 0.7F;
// Second eigenvalue of the neighbors' covariance, in squared radii, below which they lie on a
// line.
constexpr float min_spread_ratio = 0.02F;

// What a fit needs of a point, lengths in radii.
struct Neighbor {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // from the middle of the cell
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float certainty = 0.0F;
};

// Points by cells as wide as the radius, the points of a cell side by side. Not a PointTree: one
// walk serves all points of a cell (the tree's search alone takes 3 times as long as all of
// fit_normals), and the order of the cells is that of the single-precision sums.
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

  // Of the cell and the 26 around it; the cell's own members first.
  void gather(std::size_t cell, std::vector<Neighbor>& neighbors) const {
    neighbors.clear();
    const Eigen::Vector3i there = unpack(index_.keys()[cell]).cell;
    // Of whole numbers, so that it does not depend on what lies far off.
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
      // No point is believed more than 1 % of the radius.
      const double deviation = deviations_m_[n] / radius_m_;
      neighbors.push_back({((cloud_.positions[n] - middle) / radius_m_).cast<float>(),
                           cloud_.normals[n],
                           static_cast<float>(1.0 / (deviation * deviation + 1e-4))});
    }
  }

  const PointCloud& cloud_;
  double radius_m_;
  const std::vector<double>& deviations_m_;
  Eigen::Array3d first_cell_;  // cells count from 0 on
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

}  // namespace libmap
