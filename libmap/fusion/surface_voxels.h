// Averages measured positions and normals in a hashed voxel grid, and makes surface elements from
// the grid (first pass of fusion). Only occupied voxels are stored.
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
  // Weighted sums over the measurements of a voxel.
  struct Sum {
    float weight = 0.0F;
    Eigen::Vector3f offset = Eigen::Vector3f::Zero();  // from the voxel's center, voxels
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    std::uint32_t frames = 0;  // number of frames
  };

  // Adds one measurement at `position`, in voxels; ignored beyond voxel_cell_limit. A voxel has up
  // to two sums; the second is of normals opposite to the mean normal of the first (thin objects).
  void add(const Eigen::Vector3f& position, const Eigen::Vector3f& normal, float weight);
  // Sums of one frame without the hash index, which would need most of the memory.
  struct Frame {
    std::vector<std::uint64_t> keys;
    std::vector<Sum> sums;
  };
  Frame take_frame() && { return {std::move(index_).take_keys(), std::move(sums_)}; }
  // Adds the sums of the frame in the columns `cells`.
  void merge(const Frame& frame, const TileMask& cells);
  // Returns the voxels in the columns `cells`, in the same order.
  SurfaceVoxels in(const TileMask& cells) const;

  std::size_t size() const { return sums_.size(); }
  const VoxelIndex& index() const { return index_; }
  const std::vector<Sum>& sums() const { return sums_; }

 private:
  Sum& side_of(const VoxelSide& voxel, const Eigen::Vector3f& normal);

  VoxelIndex index_;
  std::vector<Sum> sums_;
};

// Surface element: a point with a normal, to be refined.
struct SurfaceElement {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // grid frame, voxels or m
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // towards the cameras
  bool extended = false;                               // one voxel beyond measured voxels
};

// Returns elements (positions in voxels): in each column of voxels, one per surface. A column is
// parallel to the axis nearest to the normal; its elements are on its center line. If noise spreads
// a surface over two voxels of a column, the voxel with more weight is used. With `extend`, empty
// columns beside a surface get an element too. The order is a function of the occupied voxels.
std::vector<SurfaceElement> surface_elements(const SurfaceVoxels& voxels, bool extend);

}  // namespace libmap
