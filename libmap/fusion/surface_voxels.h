// A hashed grid that holds, for each voxel a surface passes through, the weighted means of the
// places and normals measured in it. Voxels exist only where something was measured.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "libmap/geometry/voxel_key.h"

namespace libmap {

struct TileMask;  // tile_mask.h

class SurfaceVoxels {
 public:
  // Sums over the measurements of a voxel; lengths in voxels.
  struct Sum {
    float weight = 0.0F;
    Eigen::Vector3f offset = Eigen::Vector3f::Zero();  // from the voxel's center
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    std::uint32_t frames = 0;
  };

  // One measurement, its place in voxels; places beyond voxel_cell_limit are left out. A
  // measurement whose normal points away from the first side's mean belongs to the other side.
  void add(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float weight);
  // What one frame measured, without what finds a voxel: that would be most of the memory.
  struct Frame {
    std::vector<std::uint64_t> keys;
    std::vector<Sum> sums;
  };
  Frame take_frame() && { return {std::move(index_).take_keys(), std::move(sums_)}; }
  // All of it that is in the columns `cells`.
  void merge(const Frame& frame, const TileMask& cells);
  // Those in the columns `cells`, in their order.
  SurfaceVoxels in(const TileMask& cells) const;

  std::size_t size() const { return sums_.size(); }
  const VoxelIndex& index() const { return index_; }
  const std::vector<Sum>& sums() const { return sums_; }

 private:
  Sum& side_of(const VoxelPlace& place, const Eigen::Vector3f& normal);

  VoxelIndex index_;
  std::vector<Sum> sums_;
};

// A small piece of surface, to be refined.
struct SurfaceElement {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // voxels
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // towards the cameras
  bool extended = false;                               // one voxel beyond what was measured
};

// One element for each column of voxels that a piece of surface passes through: columns run along
// the axis that the normal is nearest to, the element lies on the column's center line. Where
// noise spreads a surface over two voxels of a column, the heavier one speaks for it. With
// `extend`, also an element in each empty column beside. Neighbors stand near each other, in an
// order that depends on the voxels alone.
std::vector<SurfaceElement> surface_elements(const SurfaceVoxels& voxels, bool extend);

}  // namespace libmap
