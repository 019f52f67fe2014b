#include <pcl/surface/marching_cubes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/geometry/voxel_key.h"
#include "libmap/surface/surface_solvers.h"

namespace libmap {

namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr int block_cells = 8;
constexpr int block_corners = block_cells + 1;
constexpr std::size_t corners_per_block =
    std::size_t{block_corners} * block_corners * block_corners;
// Minimum distance of a vertex from the ends of its edge, per length, so that triangles have area.
constexpr double min_fraction = 0.01;
// Maximum tangential distance from the weighted mean of the samples, per reach. It is 0.26 at the
// straight border of evenly distributed samples.
constexpr double max_aside = 0.4;

// Corners and edges of a cube, in the order of PCL's tables.
constexpr std::array<std::array<int, 3>, 8> corner_offsets = {
    {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1}}};
constexpr std::array<std::array<int, 2>, 12> edge_corners = {{{0, 1},
                                                              {1, 2},
                                                              {3, 2},
                                                              {0, 3},
                                                              {4, 5},
                                                              {5, 6},
                                                              {7, 6},
                                                              {4, 7},
                                                              {0, 4},
                                                              {1, 5},
                                                              {2, 6},
                                                              {3, 7}}};

constexpr std::uint32_t unnumbered = 0xffffffff;

// Weighted sums over the samples around a corner, in cells.
struct Corner {
  double weight = 0.0;
  double height = 0.0;  // offset . normal
  double square = 0.0;  // squared offset
  double reach = 0.0;
  Vector3d offset = Vector3d::Zero();  // position relative to the corner
  Vector3d normal = Vector3d::Zero();

  // u_0 of the fitted sphere relative to the corner (Guennebaud and Gross 2007, eq. 5 to 7).
  double value() const {
    const Vector3d mean = offset / weight;
    const Vector3d mean_normal = normal / weight;
    const double spread = square / weight - mean.squaredNorm();
    if (!(spread > 1e-9)) return mean.dot(mean_normal);
    const double bend = 0.5 * (mean.dot(mean_normal) - height / weight) / spread;
    return mean.dot(mean_normal + 2.0 * bend * mean) - bend * square / weight;
  }

  // True if there are samples on all sides, not only on one.
  bool is_known() const {
    if (!(weight > 0.0)) return false;
    const double length = normal.squaredNorm();
    if (!(length > 0.0)) return false;
    const Vector3d aside = offset - offset.dot(normal) / length * normal;
    return aside.norm() < max_aside * reach;
  }
};

struct Block {
  Vector3i begin;                      // first cell
  std::vector<std::uint32_t> samples;  // samples whose support reaches the block, ascending
};

// Corners of the cubes of one block.
struct BlockGrid {
  std::vector<Corner> corners = std::vector<Corner>(corners_per_block);
  std::vector<double> values;
  // Vertices of the block's part on the three edges from each corner.
  std::vector<std::uint32_t> vertex_on =
      std::vector<std::uint32_t>(3 * corners_per_block, unnumbered);
};

struct Cube {
  Vector3i position;                // position in the block
  std::array<std::size_t, 8> at{};  // indices of the corners
  unsigned inside = 0;              // one bit per corner
};

// Part of the surface in one block.
struct Part {
  struct Vertex {
    Vector3d position;
    std::uint64_t corner = 0;  // packed lower corner of the vertex's edge
    std::size_t axis = 0;      // direction of the edge
    bool is_shared = false;    // true if other blocks contain the edge, too
  };
  std::vector<Vertex> vertices;
  std::vector<Triangle> triangles;  // indices of `vertices`
};

class ImplicitSurface {
 public:
  ImplicitSurface(const std::vector<SurfaceSample>& samples, double cell_m, double support_cells)
      : samples_(samples), cell_m_(cell_m), support_cells_(support_cells) {}

  TriangleMesh run() {
    find_blocks();
    parts_.resize(blocks_.size());
    parallel_each(blocks_.size(), 8, [&](std::size_t n) { march(blocks_[n], parts_[n]); });
    return joined();
  }

 private:
  // Radius of a sample's support, in cells.
  double reach_of(const SurfaceSample& sample) const {
    return support_cells_ * std::max(1.0, static_cast<double>(sample.spacing_m) / cell_m_);
  }
  Vector3d cells_of(const SurfaceSample& sample) const {
    return sample.position.cast<double>() / cell_m_;
  }

  void find_blocks();
  void add_sample(const SurfaceSample& sample, const Block& block,
                  std::vector<Corner>& corners) const;
  void march(const Block& block, Part& part) const;
  static bool is_crossed(const BlockGrid& grid, Cube& cube);
  void add_cube(const Block& block, const Cube& cube, BlockGrid& grid, Part& part) const;
  Part::Vertex vertex_of(const Block& block, const Vector3i& in_block, int axis,
                         double fraction) const;
  TriangleMesh joined() const;

  static std::size_t corner_index(const Vector3i& corner) {
    const int index = (corner.z() * block_corners + corner.y()) * block_corners + corner.x();
    return static_cast<std::size_t>(index);
  }

  const std::vector<SurfaceSample>& samples_;
  double cell_m_;
  double support_cells_;
  std::vector<Block> blocks_;
  std::vector<Part> parts_;
};

void ImplicitSurface::find_blocks() {
  VoxelIndex numbers;
  for (std::size_t n = 0; n < samples_.size(); ++n) {
    const Vector3d center = cells_of(samples_[n]) / block_cells;
    const Vector3d reach = Vector3d::Constant(reach_of(samples_[n]) / block_cells);
    const Vector3i low = (center - reach).array().floor().cast<int>();
    const Vector3i high = (center + reach).array().floor().cast<int>();
    for (int z = low.z(); z <= high.z(); ++z)
      for (int y = low.y(); y <= high.y(); ++y)
        for (int x = low.x(); x <= high.x(); ++x) {
          const std::uint32_t block = numbers.find_or_add(pack({{x, y, z}, 0}));
          if (block == blocks_.size()) blocks_.push_back({Vector3i(x, y, z) * block_cells, {}});
          blocks_[block].samples.push_back(static_cast<std::uint32_t>(n));
        }
  }
}

void ImplicitSurface::add_sample(const SurfaceSample& sample, const Block& block,
                                 std::vector<Corner>& corners) const {
  const Vector3d center = cells_of(sample) - block.begin.cast<double>();
  const Vector3d normal = sample.normal.cast<double>();
  const double reach = reach_of(sample);
  const double factor = static_cast<double>(sample.weight) / (reach * reach);
  const auto first = [&](int axis) {
    return std::max(0, static_cast<int>(std::ceil(center[axis] - reach)));
  };
  const auto last = [&](int axis) {
    return std::min(block_cells, static_cast<int>(std::floor(center[axis] + reach)));
  };
  for (int z = first(2); z <= last(2); ++z)
    for (int y = first(1); y <= last(1); ++y)
      for (int x = first(0); x <= last(0); ++x) {
        const Vector3d offset = Vector3d(x, y, z) - center;
        const double nearness = 1.0 - offset.squaredNorm() / (reach * reach);
        if (nearness <= 0.0) continue;
        const double weight = factor * nearness * nearness * nearness;
        Corner& corner = corners[corner_index({x, y, z})];
        corner.weight += weight;
        corner.height += weight * normal.dot(offset);
        corner.square += weight * offset.squaredNorm();
        corner.reach += weight * reach;
        corner.offset += weight * offset;
        corner.normal += weight * normal;
      }
}

void ImplicitSurface::march(const Block& block, Part& part) const {
  BlockGrid grid;
  for (const std::uint32_t n : block.samples) add_sample(samples_[n], block, grid.corners);
  grid.values.reserve(corners_per_block);
  for (const Corner& corner : grid.corners)
    grid.values.push_back(corner.weight > 0.0 ? corner.value() : 0.0);
  for (int z = 0; z < block_cells; ++z)
    for (int y = 0; y < block_cells; ++y)
      for (int x = 0; x < block_cells; ++x) {
        Cube cube{.position = {x, y, z}};
        if (is_crossed(grid, cube)) add_cube(block, cube, grid, part);
      }
}

// Sets the corners of the cube. True if the surface intersects the cube, with samples on all sides.
bool ImplicitSurface::is_crossed(const BlockGrid& grid, Cube& cube) {
  for (std::size_t c = 0; c < cube.at.size(); ++c) {
    const auto& offset = corner_offsets[c];
    cube.at[c] = corner_index(cube.position + Vector3i(offset[0], offset[1], offset[2]));
    if (!(grid.corners[cube.at[c]].weight > 0.0)) return false;
    if (grid.values[cube.at[c]] < 0.0) cube.inside |= 1U << c;
  }
  return pcl::edgeTable[cube.inside] != 0 &&
         std::all_of(cube.at.begin(), cube.at.end(),
                     [&](std::size_t n) { return grid.corners[n].is_known(); });
}

void ImplicitSurface::add_cube(const Block& block, const Cube& cube, BlockGrid& grid,
                               Part& part) const {
  std::array<std::uint32_t, 12> numbers{};
  for (std::size_t e = 0; e < edge_corners.size(); ++e) {
    if ((pcl::edgeTable[cube.inside] & (1U << e)) == 0) continue;
    const auto a = static_cast<std::size_t>(edge_corners[e][0]);
    const auto b = static_cast<std::size_t>(edge_corners[e][1]);
    const auto& low = corner_offsets[a];
    const auto& high = corner_offsets[b];
    const int axis = high[1] - low[1] + 2 * (high[2] - low[2]);
    std::uint32_t& known = grid.vertex_on[3 * cube.at[a] + static_cast<std::size_t>(axis)];
    if (known == unnumbered) {
      known = static_cast<std::uint32_t>(part.vertices.size());
      const double from = grid.values[cube.at[a]];
      const double to = grid.values[cube.at[b]];
      const double fraction = std::clamp(from / (from - to), min_fraction, 1.0 - min_fraction);
      part.vertices.push_back(
          vertex_of(block, cube.position + Vector3i(low[0], low[1], low[2]), axis, fraction));
    }
    numbers[e] = known;
  }
  // PCL's table orients triangles inwards.
  for (const int* edge = pcl::triTable[cube.inside]; *edge >= 0; edge += 3)
    part.triangles.push_back({numbers[static_cast<std::size_t>(edge[0])],
                              numbers[static_cast<std::size_t>(edge[1])],
                              numbers[static_cast<std::size_t>(edge[2])]});
}

// Vertex on the edge from a corner of the block, at the given share of its length.
Part::Vertex ImplicitSurface::vertex_of(const Block& block, const Vector3i& in_block, int axis,
                                        double fraction) const {
  const Vector3i corner = block.begin + in_block;
  Part::Vertex vertex;
  vertex.position = cell_m_ * (corner.cast<double>() + fraction * Vector3d::Unit(axis));
  vertex.corner = pack({corner, 0});
  vertex.axis = static_cast<std::size_t>(axis);
  for (int other = 0; other < 3; ++other)
    if (other != axis && in_block[other] % block_cells == 0) vertex.is_shared = true;
  return vertex;
}

TriangleMesh ImplicitSurface::joined() const {
  TriangleMesh mesh;
  std::size_t triangles = 0;
  for (const Part& part : parts_) triangles += part.triangles.size();
  mesh.triangles.reserve(triangles);
  // Shared vertices by the axis of their edge.
  std::array<VoxelIndex, 3> edges;
  std::array<std::vector<std::uint32_t>, 3> on_edges;
  std::vector<std::uint32_t> numbers;
  for (const Part& part : parts_) {
    numbers.clear();
    for (const Part::Vertex& vertex : part.vertices) {
      auto number = static_cast<std::uint32_t>(mesh.vertices.size());
      if (vertex.is_shared) {
        std::vector<std::uint32_t>& known = on_edges[vertex.axis];
        const std::uint32_t edge = edges[vertex.axis].find_or_add(vertex.corner);
        if (edge == known.size()) known.push_back(number);
        number = known[edge];
      }
      if (number == mesh.vertices.size()) mesh.vertices.push_back(vertex.position);
      numbers.push_back(number);
    }
    for (const Triangle& triangle : part.triangles)
      mesh.triangles.push_back({numbers[triangle[0]], numbers[triangle[1]], numbers[triangle[2]]});
  }
  return mesh;
}

}  // namespace

TriangleMesh implicit_surface(const std::vector<SurfaceSample>& samples, double cell_m,
                              double support_cells) {
  return ImplicitSurface(samples, cell_m, support_cells).run();
}

}  // namespace libmap
