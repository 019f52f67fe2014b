// A gripper's mask cut in three, as the thesis draws it (figures 3-11 and 5-1).
#pragma once

#include <string>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libmap/view/picture_sheet.h"

namespace graspmap_tools {

// Of a voxel in a section; what is not counted enters neither SSV nor GSV.
enum class MaskVoxel { solid, void_space, solid_not_counted, void_not_counted, pivot };
MaskVoxel kind_of(const libgtd::GripperMask& mask, int x, int y, int z);
libmap::Color color_of(MaskVoxel kind);

// The vertical section through the pivot (x to the right, z up), the horizontal ones of the top
// solid layer and of `lower_layer` (x to the right, y up), one square per voxel at its place from
// the pivot, with measures in millimeters as they are in voxels. Throws Error if the mask has no
// such layer.
std::vector<libmap::SheetCell> mask_sections(const libgtd::GripperMask& mask, int lower_layer);

// Of the kinds of voxels that the mask has.
libmap::Legend mask_legend(const libgtd::GripperMask& mask);

}  // namespace graspmap_tools
