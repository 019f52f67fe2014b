// A map's fields: the voxels of its points, as i, j and k say, and others by name.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Throws Error naming the field if it is missing.
const std::vector<double>& values_of(const libmap::PointCloud& map, const char* name);

class VoxelFields {
 public:
  // Throws Error naming the field that is missing. The map outlives it and keeps its fields.
  explicit VoxelFields(const libmap::PointCloud& map);

  // Of point n. Throws Error naming the field whose value is no whole number within +-2^29.
  Voxel at(std::size_t n) const;
  // Of all points.
  std::vector<Voxel> all() const;

 private:
  int index(std::size_t axis, std::size_t n) const;

  std::array<const std::vector<double>*, 3> values_{};
};

}  // namespace libgtd
