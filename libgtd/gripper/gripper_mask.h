// The gripper mask: the volume around a pivot voxel in which ground helps the gripper (solid) or
// stands in its way (void), as a stack of voxel layers.
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

// thesis: the author's program (eq. 3-6..3-16). envelope: its alternative design (5.1), in which
// what the fingers cannot reach is not counted. climblab: the base of both. corrected: the idea of
// `thesis` with an odd side, centered on the pivot's voxel, radii not rounded. calibrated: the mask
// of `corrected`, and a score that is the probability to hold the load (closing_force.h).
enum class Method { thesis, envelope, climblab, corrected, calibrated };

const std::vector<std::pair<std::string, Method>>& method_names();
std::string name_of(Method method);  // its name, as flags and files have it

struct GripperMaskOptions {
  Method method = Method::corrected;
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;  // H_add; ClimbLab's mask has none
  double load_n = 5.0;        // of method calibrated
};

// side x side x layers voxels. z = 0 is the lowest layer, farthest from the palm; the layers with
// z >= solid_layers are the extra void layers on top. The pivot stands at (pivot_xy, pivot_xy,
// pivot_z) of the window.
struct GripperMask {
  Method method = Method::corrected;           // never calibrated
  std::shared_ptr<const ClosingPath> closing;  // of method calibrated, else null
  // Of `corrected`: what the spines hold falls outward by more than this between these circles.
  double closed_radius_m = 0.0;  // of the closed spines
  double open_radius_m = 0.0;    // of the open fingers
  double min_fall_m = 0.0;
  double voxel_size_m = 0.01;
  double palm_diameter_m = 0.0;  // of the gripper
  int side = 0;
  int layers = 0;
  int solid_layers = 0;
  int pivot_xy = 0;
  int pivot_z = 0;
  std::vector<std::uint8_t> solid;    // M, at index(x, y, z)
  std::vector<std::uint8_t> counted;  // V: voxels that enter SSV and GSV

  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(side) +
            static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(side) +
           static_cast<std::size_t>(y);
  }
  bool is_solid(int x, int y, int z) const { return solid[index(x, y, z)] != 0; }
  bool is_counted(int x, int y, int z) const { return counted[index(x, y, z)] != 0; }
};

// Throws Error if the gripper breaks a bound, or if the voxel size gives a mask without a layer or
// without a ring around its center, or one of more than 2^28 voxels (it says how much memory
// it would take).
GripperMask make_gripper_mask(const Gripper& gripper, const GripperMaskOptions& options);

// The mask as text, layer by layer from the lowest: "z 0", then `side` lines (x) of `side`
// characters (y), '1' for solid.
std::string to_text(const GripperMask& mask);

// A point at the center of each solid voxel, meters, the pivot in the origin, z toward the palm;
// fields `layer` (0 is the lowest) and `counted`.
libmap::PointCloud to_cloud(const GripperMask& mask);

}  // namespace libgtd
