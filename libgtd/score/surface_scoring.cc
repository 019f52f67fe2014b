#include "libgtd/score/surface_scoring.h"

#include <algorithm>

#include "libgtd/score/scoring.h"
#include "libgtd/score/tilted_matching.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

constexpr std::size_t tilted_pivots_per_chunk = 4096;

// What the points in each voxel know of the surface in it.
struct VoxelPoints {
  // Mean of the points in the voxel, meters; the voxel's center where there is none.
  std::vector<Eigen::Vector3d> centroids;
  // Sum of their normals, each of unit length; zero where none is known.
  std::vector<Eigen::Vector3f> outsides;
};

// For each point the place of its voxel in the list, or voxels.size().
std::vector<std::size_t> find_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                                     const std::vector<Voxel>& voxels) {
  std::vector<std::size_t> places(terrain.size(), voxels.size());
  libmap::parallel_for(terrain.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      if (!terrain.positions[n].allFinite()) continue;
      const Voxel voxel = lattice.voxel_of(terrain.positions[n]);
      const auto found = std::lower_bound(voxels.begin(), voxels.end(), voxel);
      if (found != voxels.end() && *found == voxel)
        places[n] = static_cast<std::size_t>(found - voxels.begin());
    }
  });
  return places;
}

// Of each of `voxels`, which ascend. Depends on the points in a voxel and their order alone.
VoxelPoints points_of_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                             const std::vector<Voxel>& voxels) {
  const std::vector<std::size_t> places = find_voxels(terrain, lattice, voxels);
  VoxelPoints result;
  result.outsides.assign(voxels.size(), Eigen::Vector3f::Zero());
  std::vector<Eigen::Vector3d> offsets(voxels.size(), Eigen::Vector3d::Zero());
  std::vector<double> counts(voxels.size(), 0.0);
  for (std::size_t n = 0; n < terrain.size(); ++n) {
    const std::size_t at = places[n];
    if (at == voxels.size()) continue;
    // Relative to the voxel, so that a point far from the origin is as exact as one near it.
    offsets[at] += terrain.positions[n] - lattice.center_of(voxels[at]);
    counts[at] += 1.0;
    if (!terrain.has_normals()) continue;
    const Eigen::Vector3f& normal = terrain.normals[n];
    if (normal.allFinite() && normal.norm() > 0.0F) result.outsides[at] += normal.normalized();
  }
  result.centroids.reserve(voxels.size());
  for (std::size_t at = 0; at < voxels.size(); ++at)
    result.centroids.push_back(lattice.center_of(voxels[at]) +
                               offsets[at] / std::max(counts[at], 1.0));
  return result;
}

std::vector<TiltedPivot> tilt(const std::vector<Voxel>& voxels,
                              const std::vector<SurfaceNormal>& normals,
                              const libmap::PointCloud& surface, const VoxelLattice& lattice) {
  const VoxelPoints points = points_of_voxels(surface, lattice, voxels);
  std::vector<TiltedPivot> pivots(voxels.size());
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Eigen::Vector3d center = lattice.center_of(voxels[n]);
    pivots[n].anchor_m = center;
    if (!normals[n].normal.allFinite()) continue;
    const Eigen::Vector3d normal = normals[n].normal.cast<double>().normalized();
    pivots[n].normal = normal;
    pivots[n].anchor_m += normal * normal.dot(points.centroids[n] - center);
  }
  return pivots;
}

// Tile by tile, since only the scanned columns nearby are known of one.
std::vector<std::uint8_t> find_tilted_edges(const std::vector<Voxel>& voxels,
                                            const std::vector<TiltedPivot>& pivots,
                                            const TiltedTerrain& terrain, const VoxelGrid& grid,
                                            const GripperMask& mask,
                                            const std::vector<TileBounds>& tiles) {
  std::vector<std::uint8_t> edges(voxels.size(), 0);
  const int reach = tilted_reach_voxels(mask);
  VoxelGrid places;  // the pivots, to be cut by tiles
  places.voxels = voxels;
  libmap::parallel_for(tiles.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      std::vector<std::size_t> here;
      std::vector<TiltedPivot> pivots_here;
      visit_columns(places, tiles[t], [&](std::size_t n) {
        here.push_back(n);
        pivots_here.push_back(pivots[n]);
      });
      if (here.empty()) continue;
      const std::vector<std::uint8_t> found =
          terrain.find_edges(pivots_here, unscanned_columns(grid, grown(tiles[t], reach, reach)));
      for (std::size_t n = 0; n < here.size(); ++n) edges[here[n]] = found[n];
    }
  });
  return edges;
}

}  // namespace

std::vector<Voxel> pivots_of(const VoxelGrid& grid, const GripperMask& mask,
                             const std::vector<TileBounds>& tiles) {
  std::vector<std::uint8_t> is_pivot(grid.voxels.size(), 0);
  for (const TileBounds& tile : tiles)
    for (const std::size_t at : pivots_in(grid, mask, tile)) is_pivot[at] = 1;
  std::vector<Voxel> voxels;
  for (std::size_t at = 0; at < is_pivot.size(); ++at)
    if (is_pivot[at] != 0) voxels.push_back(grid.voxels[at]);
  return voxels;
}

std::vector<SurfaceNormal> normals_at(const std::vector<Voxel>& voxels,
                                      const libmap::PointCloud& surface,
                                      const VoxelLattice& lattice, double radius_m) {
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(voxels.size());
  for (const Voxel& voxel : voxels) centers.push_back(lattice.center_of(voxel));
  std::vector<Eigen::Vector3f> outsides;
  if (surface.has_normals()) outsides = points_of_voxels(surface, lattice, voxels).outsides;
  return fit_surface_normals(surface, centers, outsides, {.radius_m = radius_m});
}

std::vector<ScoredVoxel> score_on_surface(const std::vector<Voxel>& voxels,
                                          const std::vector<SurfaceNormal>& normals,
                                          const libmap::PointCloud& surface, const VoxelGrid& grid,
                                          const GripperMask& mask,
                                          const std::vector<TileBounds>& tiles,
                                          const ScoringOptions& options,
                                          libmap::Progress& progress) {
  const std::vector<TiltedPivot> pivots = tilt(voxels, normals, surface, grid.lattice);
  const TiltedTerrain terrain(surface.positions, grid.lattice, mask);
  const std::vector<VoxelCounts> counts = terrain.match(pivots, progress);
  std::vector<std::uint8_t> edges(voxels.size(), 0);
  // The other methods do not score the border at all.
  if (mask.method == Method::corrected)
    edges = find_tilted_edges(voxels, pivots, terrain, grid, mask, tiles);
  std::vector<ScoredVoxel> scored(voxels.size());
  libmap::parallel_for(
      voxels.size(), tilted_pivots_per_chunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
          scored[n] = {
              .voxel = voxels[n],
              .counts = counts[n],
              .score = score_percent(counts[n], mask.method, options.solid_voxel_threshold) / 100.0,
              .border = edges[n] != 0};
      });
  return scored;
}

}  // namespace libgtd
