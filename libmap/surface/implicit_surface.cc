#include "libmap/surface/implicit_surface.h"

#include <pcl/surface/marching_cubes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr int block_cells = 8;
constexpr int block_corners = block_cells + 1;
constexpr std::size_t corners_per_block =
    std::size_t{block_corners} * block_corners * block_corners;
// A vertex keeps this share of an edge away from its ends, so that triangles have an area.
constexpr double min_share = 0.01;
// Of the reach: how far aside of their weighted mean a place is. On the straight border of evenly
// spread samples it is 0.26.
constexpr double max_aside = 0.4;

// Corners of a cube and its edges, in the order of PCL's tables.
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

// 21 bits an axis.
std::uint64_t pack(const Vector3i& place) {
  constexpr int middle = 1 << 20;
  const auto bits = [](int value) {
    return static_cast<std::uint64_t>(value + middle) & 0x1fffffU;
  };
  return bits(place.z()) << 42U | bits(place.y()) << 21U | bits(place.x());
}

// Sums over the samples around a corner; lengths in cells.
struct Corner {
  double weight = 0.0;
  double height = 0.0;  // offset . normal
  double square = 0.0;  // of the offset
  double reach = 0.0;
  Vector3d offset = Vector3d::Zero();  // from the samples
  Vector3d normal = Vector3d::Zero();

  // Guennebaud and Gross 2007, eq. 5 to 7, about the corner: u_0 of the fitted sphere.
  double value() const {
    const Vector3d mean = offset / weight;
    const Vector3d mean_normal = normal / weight;
    const double spread = square / weight - mean.squaredNorm();
    if (!(spread > 1e-9)) return mean.dot(mean_normal);
    const double bend = 0.5 * (mean.dot(mean_normal) - height / weight) / spread;
    return mean.dot(mean_normal + 2.0 * bend * mean) - bend * square / weight;
  }

  // Whether samples are all around it, not only on one side.
  bool is_known() const {
    if (!(weight > 0.0)) return false;
    const double length = normal.squaredNorm();
    if (!(length > 0.0)) return false;
    const Vector3d aside = offset - offset.dot(normal) / length * normal;
    return aside.norm() < max_aside * reach;
  }
};

struct Block {
  Vector3i begin;                      // its first cell
  std::vector<std::uint32_t> samples;  // whose support reaches it, ascending
};

struct Part {
  // Along each edge with a vertex: three times the packed lower corner, and the axis.
  std::vector<std::pair<std::uint64_t, Vector3d>> vertices;
  std::vector<std::array<std::uint64_t, 3>> triangles;
};

class ImplicitSurface {
 public:
  ImplicitSurface(const std::vector<SurfaceSample>& samples, double cell_m, double support_cells)
      : samples_(samples), cell_m_(cell_m), support_cells_(support_cells) {}

  TriangleMesh run() {
    find_blocks();
    parts_.resize(blocks_.size());
    parallel_for(blocks_.size(), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) march(blocks_[n], parts_[n]);
    });
    return joined();
  }

 private:
  // In cells.
  double reach_of(const SurfaceSample& sample) const {
    return support_cells_ * std::max(1.0, static_cast<double>(sample.spacing_m) / cell_m_);
  }
  Vector3d place_of(const SurfaceSample& sample) const {
    return sample.position.cast<double>() / cell_m_;
  }

  void find_blocks();
  void add_sample(const SurfaceSample& sample, const Block& block,
                  std::vector<Corner>& corners) const;
  void march(const Block& block, Part& part) const;
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
  std::unordered_map<std::uint64_t, std::size_t> numbers;
  for (std::size_t n = 0; n < samples_.size(); ++n) {
    const Vector3d place = place_of(samples_[n]) / block_cells;
    const Vector3d reach = Vector3d::Constant(reach_of(samples_[n]) / block_cells);
    const Vector3i low = (place - reach).array().floor().cast<int>();
    const Vector3i high = (place + reach).array().floor().cast<int>();
    for (int z = low.z(); z <= high.z(); ++z)
      for (int y = low.y(); y <= high.y(); ++y)
        for (int x = low.x(); x <= high.x(); ++x) {
          const auto [found, is_new] = numbers.try_emplace(pack({x, y, z}), blocks_.size());
          if (is_new) blocks_.push_back({Vector3i(x, y, z) * block_cells, {}});
          blocks_[found->second].samples.push_back(static_cast<std::uint32_t>(n));
        }
  }
}

void ImplicitSurface::add_sample(const SurfaceSample& sample, const Block& block,
                                 std::vector<Corner>& corners) const {
  const Vector3d place = place_of(sample) - block.begin.cast<double>();
  const Vector3d normal = sample.normal.cast<double>();
  const double reach = reach_of(sample);
  const double factor = static_cast<double>(sample.weight) / (reach * reach);
  const auto first = [&](int axis) {
    return std::max(0, static_cast<int>(std::ceil(place[axis] - reach)));
  };
  const auto last = [&](int axis) {
    return std::min(block_cells, static_cast<int>(std::floor(place[axis] + reach)));
  };
  for (int z = first(2); z <= last(2); ++z)
    for (int y = first(1); y <= last(1); ++y)
      for (int x = first(0); x <= last(0); ++x) {
        const Vector3d offset = Vector3d(x, y, z) - place;
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
  std::vector<Corner> corners(corners_per_block);
  for (const std::uint32_t n : block.samples) add_sample(samples_[n], block, corners);
  std::vector<double> values;
  values.reserve(corners_per_block);
  for (const Corner& corner : corners) values.push_back(corner.weight > 0.0 ? corner.value() : 0.0);
  std::array<std::size_t, 8> at{};
  for (int z = 0; z < block_cells; ++z)
    for (int y = 0; y < block_cells; ++y)
      for (int x = 0; x < block_cells; ++x) {
        unsigned inside = 0;
        bool is_known = true;
        for (std::size_t c = 0; c < at.size() && is_known; ++c) {
          const auto& offset = corner_offsets[c];
          at[c] = corner_index({x + offset[0], y + offset[1], z + offset[2]});
          is_known = corners[at[c]].weight > 0.0;
          if (values[at[c]] < 0.0) inside |= 1U << c;
        }
        if (!is_known || pcl::edgeTable[inside] == 0) continue;
        is_known =
            std::all_of(at.begin(), at.end(), [&](std::size_t n) { return corners[n].is_known(); });
        if (!is_known) continue;
        std::array<std::uint64_t, 12> keys{};
        for (std::size_t e = 0; e < edge_corners.size(); ++e) {
          if ((pcl::edgeTable[inside] & (1U << e)) == 0) continue;
          const auto& [a, b] = edge_corners[e];
          const auto& low = corner_offsets[static_cast<std::size_t>(a)];
          const auto& high = corner_offsets[static_cast<std::size_t>(b)];
          const Vector3i corner = block.begin + Vector3i(x + low[0], y + low[1], z + low[2]);
          const Vector3i along(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
          const double from = values[at[static_cast<std::size_t>(a)]];
          const double to = values[at[static_cast<std::size_t>(b)]];
          const double share = std::clamp(from / (from - to), min_share, 1.0 - min_share);
          keys[e] = 3 * pack(corner) + static_cast<std::uint64_t>(along.y() + 2 * along.z());
          part.vertices.emplace_back(
              keys[e], cell_m_ * (corner.cast<double>() + share * along.cast<double>()));
        }
        // PCL's table turns triangles toward the inside.
        for (const int* edge = pcl::triTable[inside]; *edge >= 0; edge += 3)
          part.triangles.push_back({keys[static_cast<std::size_t>(edge[0])],
                                    keys[static_cast<std::size_t>(edge[1])],
                                    keys[static_cast<std::size_t>(edge[2])]});
      }
}

TriangleMesh ImplicitSurface::joined() const {
  TriangleMesh mesh;
  std::unordered_map<std::uint64_t, std::uint32_t> numbers;
  for (const Part& part : parts_) {
    for (const auto& [key, position] : part.vertices)
      if (numbers.try_emplace(key, static_cast<std::uint32_t>(mesh.vertices.size())).second)
        mesh.vertices.push_back(position);
    for (const auto& triangle : part.triangles)
      mesh.triangles.push_back(
          {numbers.at(triangle[0]), numbers.at(triangle[1]), numbers.at(triangle[2])});
  }
  return mesh;
}

}  // namespace

TriangleMesh implicit_surface(const std::vector<SurfaceSample>& samples, double cell_m,
                              double support_cells) {
  return ImplicitSurface(samples, cell_m, support_cells).run();
}

}  // namespace libmap
