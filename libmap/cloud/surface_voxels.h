// A hashed grid that holds, for each voxel a surface passes through, the weighted means of the
// places and normals measured in it. Voxels exist only where something was measured.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace libmap {

// Where a voxel lies in its grid, and which of the two sides of a thin sheet it holds.
struct VoxelPlace {
  Eigen::Vector3i cell = Eigen::Vector3i::Zero();
  int side = 0;  // 0 or 1
};

// Cells -limit..limit-1 along each axis.
inline constexpr int voxel_cell_limit = 1 << 20;

// 21 bits an axis and one of the side.
std::uint64_t pack(const VoxelPlace& place);
VoxelPlace unpack(std::uint64_t key);

// Keys to consecutive numbers, in the order in which they come (open addressing).
class VoxelIndex {
 public:
  static constexpr std::uint32_t none = 0xffffffff;

  VoxelIndex();                                  // no key yet
  std::uint32_t find(std::uint64_t key) const;   // the key's number, or `none`
  std::uint32_t find_or_add(std::uint64_t key);  // the key's number, the next one if it is new
  std::size_t size() const { return keys_.size(); }
  const std::vector<std::uint64_t>& keys() const { return keys_; }

 private:
  std::size_t slot_of(std::uint64_t key) const;
  void grow();

  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> slots_;  // numbers of keys; a power of 2
  std::uint32_t last_ = 0;            // asked for: pixels side by side share a voxel
};

struct PlanCells;  // plan_cells.h

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
  // All that one frame measured in the columns `cells`.
  void merge_frame(const SurfaceVoxels& frame, const PlanCells& cells);
  // Those in the columns `cells`, in their order.
  SurfaceVoxels in(const PlanCells& cells) const;

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
