#include "libmap/fusion/surface_voxels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/fusion/tile_mask.h"

namespace libmap {

SurfaceVoxels::Sum& SurfaceVoxels::side_of(const VoxelSide& voxel, const Eigen::Vector3f& normal) {
  std::uint32_t number = index_.find_or_add(pack({voxel.cell, 0}));
  if (number < sums_.size() && sums_[number].normal.dot(normal) < 0.0F)
    number = index_.find_or_add(pack({voxel.cell, 1}));
  if (number == sums_.size()) sums_.emplace_back();
  return sums_[number];
}

void SurfaceVoxels::add(const Eigen::Vector3f& position, const Eigen::Vector3f& normal, float weight) {
  const Eigen::Array3f floor = position.array().floor();
  if (!((floor.abs() < static_cast<float>(voxel_cell_limit - 2)).all())) return;
  Sum& sum = side_of({floor.cast<int>().matrix(), 0}, normal);
  sum.weight += weight;
  sum.offset += weight * (position.array() - floor - 0.5F).matrix();
  sum.normal += weight * normal;
  sum.frames = 1;
}

SurfaceVoxels SurfaceVoxels::in(const TileMask& cells) const {
  SurfaceVoxels found;
  for (std::size_t n = 0; n < sums_.size(); ++n) {
    const std::uint64_t key = index_.keys()[n];
    if (!cells.has_cell(unpack(key).cell.head<2>())) continue;
    found.index_.find_or_add(key);
    found.sums_.push_back(sums_[n]);
  }
  return found;
}

void SurfaceVoxels::merge(const Frame& frame, const TileMask& cells) {
  for (std::size_t n = 0; n < frame.sums.size(); ++n) {
    const VoxelSide voxel = unpack(frame.keys[n]);
    if (!cells.has_cell(voxel.cell.head<2>())) continue;
    const Sum& more = frame.sums[n];
    Sum& sum = side_of(voxel, more.normal);
    sum.weight += more.weight;
    sum.offset += more.offset;
    sum.normal += more.normal;
    ++sum.frames;
  }
}

namespace {

// Maximum distance in voxels between two pieces of a column that are one surface, spread by noise.
constexpr float one_surface = 1.0F;

// Piece of surface in one voxel and its column.
struct Piece {
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  int axis = 2;                   // of the column
  float height = 0.0F;            // along the axis, on the column's center line
  bool is_selected = false;            // selected for its column
  std::array<bool, 4> is_edge{};  // true for neighboring columns without surface
};

class ElementMaker {
 public:
  ElementMaker(const SurfaceVoxels& voxels, bool extend) : voxels_(voxels), pieces_(voxels.size()) {
    each_piece([&](std::size_t n) { pieces_[n] = piece_of(n); });
    each_piece([&](std::size_t n) {
      pieces_[n].is_selected = speaks_for_column(n);
      for (std::size_t step = 0; extend && pieces_[n].is_selected && step < 4; ++step)
        pieces_[n].is_edge[step] = is_empty(neighbor(n, step), pieces_[n]);
    });
  }

  std::vector<SurfaceElement> run() {
    for (std::size_t n = 0; n < pieces_.size(); ++n) {
      const Piece& piece = pieces_[n];
      if (!piece.is_selected) continue;
      const VoxelSide voxel = unpack(key_of(n));
      found_.emplace_back(z_order(key_of(n)),
                          element(voxel.cell, piece.axis, piece.height, piece.normal, false));
      for (std::size_t step = 0; step < 4; ++step)
        if (piece.is_edge[step]) expect(neighbor(n, step), piece, voxels_.sums()[n].weight);
    }
    for (std::size_t n = 0; n < beside_.size(); ++n) {
      const Beside& one = beside_[n];
      const VoxelSide voxel = unpack(beside_index_.keys()[n]);
      found_.emplace_back(
          z_order(beside_index_.keys()[n]),
          element(voxel.cell, one.axis, one.height / one.weight, one.normal.normalized(), true));
    }
    return in_order();
  }

 private:
  // Sums over the neighbors of an empty voxel, for extrapolating the surface into it.
  struct Beside {
    int axis = 2;
    float weight = 0.0F;
    float height = 0.0F;
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  };

  std::uint64_t key_of(std::size_t n) const { return voxels_.index().keys()[n]; }

  Piece piece_of(std::size_t n) const {
    const SurfaceVoxels::Sum& sum = voxels_.sums()[n];
    const Eigen::Vector3f offset = sum.offset / sum.weight;
    Piece piece;
    const float length = sum.normal.norm();
    piece.normal = length > 0.0F ? Eigen::Vector3f(sum.normal / length) : Eigen::Vector3f::UnitZ();
    piece.normal.cwiseAbs().maxCoeff(&piece.axis);
    const int cell = unpack(key_of(n)).cell[piece.axis];
    // Intersects the plane through the mean with the column's center line.
    const float along = piece.normal.dot(offset) / piece.normal[piece.axis];
    piece.height = static_cast<float>(cell) + 0.5F + along;
    return piece;
  }

  // Index of the piece on the same side in another voxel of the column; nullopt if there is none.
  std::optional<std::size_t> piece_at(Eigen::Vector3i cell, int axis, int height,
                                      const Eigen::Vector3f& normal) const {
    cell[axis] = height;
    for (int side = 0; side < 2; ++side) {
      const std::uint32_t n = voxels_.index().find(pack({cell, side}));
      if (n != VoxelIndex::none && pieces_[n].normal.dot(normal) > 0.0F) return n;
    }
    return std::nullopt;
  }

  bool speaks_for_column(std::size_t n) const {
    const Piece& piece = pieces_[n];
    const VoxelSide voxel = unpack(key_of(n));
    const int cell = voxel.cell[piece.axis];
    for (const int beside : {cell - 1, cell + 1}) {
      const auto other = piece_at(voxel.cell, piece.axis, beside, piece.normal);
      if (!other || pieces_[*other].axis != piece.axis ||
          std::abs(pieces_[*other].height - piece.height) > one_surface)
        continue;
      const float own = voxels_.sums()[n].weight;
      const float others = voxels_.sums()[*other].weight;
      if (others > own || (others == own && key_of(*other) < key_of(n))) return false;
    }
    return true;
  }

  // Continuation of a piece in an adjacent column.
  struct Neighbor {
    VoxelSide voxel;
    float height = 0.0F;
  };

  template <typename Use>
  void each_piece(const Use& use) {
    parallel_for(pieces_.size(), 4096, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) use(n);
    });
  }

  Neighbor neighbor(std::size_t n, std::size_t step) const {
    const Piece& piece = pieces_[n];
    const int lateral = (piece.axis + 1 + static_cast<int>(step) / 2) % 3;
    const int direction = step % 2 == 0 ? 1 : -1;
    const float slope = -piece.normal[lateral] / piece.normal[piece.axis];
    Neighbor there{unpack(key_of(n)), piece.height + slope * static_cast<float>(direction)};
    there.voxel.cell[lateral] += direction;
    there.voxel.cell[piece.axis] = static_cast<int>(std::floor(there.height));
    return there;
  }

  bool is_empty(const Neighbor& there, const Piece& piece) const {
    const int cell = there.voxel.cell[piece.axis];
    for (const int height : {cell, cell - 1, cell + 1})
      if (piece_at(there.voxel.cell, piece.axis, height, piece.normal)) return false;
    return true;
  }

  void expect(const Neighbor& there, const Piece& piece, float weight) {
    const std::uint32_t n = beside_index_.find_or_add(pack(there.voxel));
    Beside& beside =
        n < beside_.size() ? beside_[n] : beside_.emplace_back(Beside{.axis = piece.axis});
    // Columns along another axis have another center line.
    if (beside.axis != piece.axis) return;
    beside.weight += weight;
    beside.height += weight * there.height;
    beside.normal += weight * piece.normal;
  }

  std::vector<SurfaceElement> in_order() const {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
    order.reserve(found_.size());
    for (const auto& [key, element] : found_)
      order.emplace_back(key, static_cast<std::uint32_t>(order.size()));
    // Two elements with the same key are a measured one, followed by an extended one.
    std::sort(order.begin(), order.end());
    std::vector<SurfaceElement> elements;
    elements.reserve(order.size());
    for (const auto& [key, number] : order) elements.push_back(found_[number].second);
    return elements;
  }

  static SurfaceElement element(const Eigen::Vector3i& cell, int axis, float height,
                                const Eigen::Vector3f& normal, bool extended) {
    SurfaceElement made;
    made.position = cell.cast<float>().array() + 0.5F;
    made.position[axis] = height;
    made.normal = normal;
    made.extended = extended;
    return made;
  }

  const SurfaceVoxels& voxels_;
  std::vector<Piece> pieces_;
  VoxelIndex beside_index_;
  std::vector<Beside> beside_;
  std::vector<std::pair<std::uint64_t, SurfaceElement>> found_;
};

}  // namespace

std::vector<SurfaceElement> surface_elements(const SurfaceVoxels& voxels, bool extend) {
  return ElementMaker(voxels, extend).run();
}

}  // namespace libmap
