// Gripper mask: a stack of voxel layers around a pivot voxel. Each voxel is solid (ground in it
// supports the gripper) or void (ground in it obstructs the gripper).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

struct ClosingPath;  // closing_path.h

// thesis: as the program of the thesis's author (eq. 3-6..3-16). envelope: the alternative design
// of the thesis (5.1), which does not count voxels outside the reach of the fingers. climblab: mask
// of ClimbLab v3 (MATLAB), without void layers. corrected: as thesis, with an odd side centered on
// the pivot voxel and exact radii. calibrated: the mask of `corrected`; the score is the hold
// probability (closing_force.h).
enum class Method { thesis, envelope, climblab, corrected, calibrated };

const std::vector<std::pair<std::string, Method>>& method_names();
std::string name_of(Method method);  // as in flags and files

struct GripperMaskOptions {
  Method method = Method::corrected;
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;  // void layers on top of the mask (H_add); not used by climblab
  double load_n = 5.0;        // calibrated only: load of the hold probability, N
};

// Mask of side x side x layers voxels. z = 0 is the lowest layer, farthest from the palm; layers
// with z >= solid_layers are the extra void layers on top. Pivot: (pivot_xy, pivot_xy, pivot_z).
struct GripperMask {
  Method method = Method::corrected;           // mask layout: `corrected` for Method::calibrated
  std::shared_ptr<const ClosingPath> closing;  // set for Method::calibrated, else null
  double closed_radius_m = 0.0;  // corrected only: radius of the circle of closed spines
  double open_radius_m = 0.0;    // corrected only: radius of the circle of open fingers
  // corrected only: spines can hold if the ground falls by more than this from the circle of
  // closed_radius_m outward to the circle of open_radius_m.
  double min_fall_m = 0.0;
  double voxel_size_m = 0.01;
  double palm_diameter_m = 0.0;  // diameter of the gripper's palm
  int side = 0;
  int layers = 0;
  int solid_layers = 0;
  int pivot_xy = 0;
  int pivot_z = 0;
  std::vector<std::uint8_t> solid;    // M: 1 for solid, 0 for void, at index(x, y, z)
  std::vector<std::uint8_t> counted;  // V: 1 if the voxel is counted in VoxelCounts

  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(side) +
            static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(side) +
           static_cast<std::size_t>(y);
  }
  bool is_solid(int x, int y, int z) const { return solid[index(x, y, z)] != 0; }
  bool is_counted(int x, int y, int z) const { return counted[index(x, y, z)] != 0; }
};

// Makes a mask. Throws Error for a value out of range, missing `fingers` (calibrated), and voxel
// sizes that give fewer than two solid layers, a side below 3 voxels or more than 2^28 voxels.
GripperMask make_gripper_mask(const Gripper& gripper, const GripperMaskOptions& options);

// Returns the mask as text: comment, "side side layers", then for each layer N, from 0, "z N",
// then `side` lines (x) of `side` characters (y), '1' for solid.
std::string to_text(const GripperMask& mask);

// Returns a point at the center of each solid voxel in meters, pivot at the origin, z toward the
// palm, with the fields `layer` (0 is the lowest) and `counted`.
libmap::PointCloud to_cloud(const GripperMask& mask);

}  // namespace libgtd
