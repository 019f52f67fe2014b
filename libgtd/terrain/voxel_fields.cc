#include "libgtd/terrain/voxel_fields.h"

#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr double index_bound = 0x1p29;
constexpr std::array<const char*, 3> names = {"i", "j", "k"};

}  // namespace

const std::vector<double>& values_of(const libmap::PointCloud& map, const char* name) {
  if (const libmap::ScalarField* field = map.find_field(name)) return field->values;
  throw libmap::Error("the map has no such field", {.field = name});
}

VoxelFields::VoxelFields(const libmap::PointCloud& map) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const libmap::ScalarField* field = map.find_field(names[axis]);
    if (field == nullptr)
      throw libmap::Error("not a graspability map: it has no such field", {.field = names[axis]});
    values_[axis] = &field->values;
  }
}

int VoxelFields::index(std::size_t axis, std::size_t n) const {
  const double value = (*values_[axis])[n];
  if (!(std::abs(value) <= index_bound) || value != std::floor(value))
    throw libmap::Error("no index of a voxel", {.field = names[axis],
                                                .value = libmap::to_text(value),
                                                .bound = "a whole number within +-2^29"});
  return static_cast<int>(value);
}

Voxel VoxelFields::at(std::size_t n) const { return {index(0, n), index(1, n), index(2, n)}; }

std::vector<Voxel> VoxelFields::all() const {
  std::vector<Voxel> voxels(values_[0]->size());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = at(n);
  return voxels;
}

}  // namespace libgtd
