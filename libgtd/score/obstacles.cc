#include "libgtd/score/obstacles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/geometry/disjoint_sets.h"

namespace libgtd {

namespace {

// Maximum index difference of two voxels along an axis.
int extent_of(const std::vector<Voxel>& voxels) {
  if (voxels.empty()) return 0;
  Voxel low = voxels.front();
  Voxel high = low;
  for (const Voxel& voxel : voxels) {
    low = {std::min(low.i, voxel.i), std::min(low.j, voxel.j), std::min(low.k, voxel.k)};
    high = {std::max(high.i, voxel.i), std::max(high.j, voxel.j), std::max(high.k, voxel.k)};
  }
  return std::max({high.i - low.i, high.j - low.j, high.k - low.k});
}

// Sets of voxels, identified by their first voxel.
using VoxelSets = libmap::DisjointSets<std::size_t>;

struct Rise {
  int foot = std::numeric_limits<int>::max();
  int top = std::numeric_limits<int>::min();
  void hold(int k) {
    foot = std::min(foot, k);
    top = std::max(top, k);
  }
};

void check(const std::vector<Voxel>& voxels, const std::vector<float>& slopes_deg) {
  if (voxels.size() != slopes_deg.size())
    throw libmap::Error("the number of slopes differs from the number of voxels",
                        {.field = "slopes_deg",
                         .value = std::to_string(slopes_deg.size()),
                         .bound = std::to_string(voxels.size())});
  for (std::size_t n = 1; n < voxels.size(); ++n)
    if (!(voxels[n - 1] < voxels[n]))
      throw libmap::Error("voxels are not strictly ascending", {.field = "i, j, k"});
}

void check(double voxel_size_m, const ObstacleOptions& options) {
  const auto require = [](bool sound, const char* name, double value, const char* bound) {
    if (!sound || !std::isfinite(value))
      throw libmap::Error("out of range",
                          {.field = name, .value = libmap::to_text(value), .bound = bound});
  };
  require(voxel_size_m > 0.0, "voxel_size_m", voxel_size_m, "> 0");
  require(options.height_m >= 0.0, "obstacle_height_m", options.height_m, ">= 0");
  require(options.normal_radius_m >= 0.0, "normal_radius_m", options.normal_radius_m, ">= 0");
}

// Foot and top of each face, stored at its first voxel.
std::vector<Rise> measure_faces(const std::vector<Voxel>& voxels,
                                const std::vector<std::uint8_t>& is_steep, VoxelSets& faces,
                                double radius_voxels) {
  std::vector<Rise> rises(voxels.size());
  for (std::size_t n = 0; n < voxels.size(); ++n)
    if (is_steep[n] != 0) rises[faces.find(n)].hold(voxels[n].k);
  const double square = radius_voxels * radius_voxels;
  // Limited by the extent of the voxels: a larger radius might overflow an int.
  const double reach = std::min(radius_voxels, static_cast<double>(extent_of(voxels)));
  constexpr double max_reach = 1e5;
  if (reach > max_reach)
    throw libmap::Error("spans too many voxels", {.field = "normal_radius_m",
                                                  .value = libmap::to_text(reach) + " voxels",
                                                  .bound = "<= 100000 voxels"});
  visit_pairs(voxels, static_cast<int>(reach), [&](std::size_t n, std::size_t m) {
    if (is_steep[n] == 0 && is_steep[m] == 0) return;
    const double di = voxels[m].i - voxels[n].i, dj = voxels[m].j - voxels[n].j,
                 dk = voxels[m].k - voxels[n].k;
    if (di * di + dj * dj + dk * dk > square) return;
    if (is_steep[n] != 0) rises[faces.find(n)].hold(voxels[m].k);
    if (is_steep[m] != 0) rises[faces.find(m)].hold(voxels[n].k);
  });
  return rises;
}

// Returns the first voxel of the region with the most voxels, or voxels.size() if there is none.
std::size_t find_ground(const std::vector<Obstacle>& obstacles, VoxelSets& regions) {
  std::vector<std::size_t> counts(obstacles.size(), 0);
  std::size_t ground = obstacles.size();
  for (std::size_t n = 0; n < obstacles.size(); ++n)
    if (obstacles[n] == Obstacle::none) ++counts[regions.find(n)];
  for (std::size_t n = 0; n < obstacles.size(); ++n)
    if (counts[n] > 0 && (ground == obstacles.size() || counts[n] > counts[ground])) ground = n;
  return ground;
}

}  // namespace

std::vector<Obstacle> find_obstacles(const std::vector<Voxel>& voxels,
                                     const std::vector<float>& slopes_deg, double voxel_size_m,
                                     const ObstacleOptions& options) {
  check(voxels, slopes_deg);
  check(voxel_size_m, options);
  // The slack makes the result for a rise of exactly the limit independent of rounding.
  const double limit = options.height_m / voxel_size_m * (1.0 + 1e-9);
  std::vector<std::uint8_t> is_steep(voxels.size(), 0);
  for (std::size_t n = 0; n < voxels.size(); ++n)
    is_steep[n] = static_cast<double>(slopes_deg[n]) > options.slope_deg ? 1 : 0;
  VoxelSets faces(voxels.size());
  visit_pairs(voxels, obstacle_link_voxels, [&](std::size_t n, std::size_t m) {
    if (is_steep[n] != 0 && is_steep[m] != 0) faces.join(n, m);
  });
  const std::vector<Rise> rises =
      measure_faces(voxels, is_steep, faces, options.normal_radius_m / voxel_size_m);
  std::vector<Obstacle> obstacles(voxels.size(), Obstacle::none);
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    if (is_steep[n] == 0) continue;
    const Rise& rise = rises[faces.find(n)];
    if (static_cast<double>(rise.top) - rise.foot > limit) obstacles[n] = Obstacle::face;
  }
  VoxelSets regions(voxels.size());
  visit_pairs(voxels, obstacle_link_voxels, [&](std::size_t n, std::size_t m) {
    if (obstacles[n] == Obstacle::none && obstacles[m] == Obstacle::none) regions.join(n, m);
  });
  const std::size_t ground = find_ground(obstacles, regions);
  std::vector<std::uint8_t> is_on_top(voxels.size(), 0);
  const auto meet = [&](std::size_t free_voxel, std::size_t face) {
    if (obstacles[free_voxel] != Obstacle::none || obstacles[face] != Obstacle::face) return;
    const Rise& rise = rises[faces.find(face)];
    const double above_foot = static_cast<double>(voxels[free_voxel].k) - rise.foot;
    const double below_top = static_cast<double>(rise.top) - voxels[free_voxel].k;
    if (above_foot > limit || above_foot > below_top) is_on_top[regions.find(free_voxel)] = 1;
  };
  visit_pairs(voxels, obstacle_link_voxels, [&](std::size_t n, std::size_t m) {
    meet(n, m);
    meet(m, n);
  });
  for (std::size_t n = 0; n < voxels.size(); ++n)
    if (obstacles[n] == Obstacle::none && is_on_top[regions.find(n)] != 0 &&
        regions.find(n) != ground)
      obstacles[n] = Obstacle::unreachable;
  return obstacles;
}

}  // namespace libgtd
