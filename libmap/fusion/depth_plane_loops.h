// The innermost loops of depth_planes over the pixels of one row, each for
// several instruction sets, with the same bits from each: no pixel depends on those in other lanes.
// Plain pointers alone: sources that are compiled for more than the base instruction set must see
// no type whose inline functions other sources compile too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libmap {

// Rows of `count` pixels are read and written up to the next multiple of `lanes`; only those of
// depth images end with the last pixel.
struct DepthPlaneLoops {
  static constexpr int lanes = 16;

  struct Limits {
    float min_depth_m;
    float max_depth_m;
    float gate;  // standard deviations
    float axial_m;
    float axial_of_range;
    float axial_of_square;
  };
  // How many are not measured, and beyond the limits.
  struct MeasureCounts {
    int unmeasured;
    int out_of_range;
  };
  // Inverse depth, and how far the mean of two pixels may lie from that between; both 0 where there
  // is no depth within the limits.
  MeasureCounts (*measure)(const float* depth, int count, const Limits& limits, float* inverse,
                           float* tolerance);

  // A pair of opposite pixels.
  struct Offset {
    std::ptrdiff_t pixels;  // in the image of inverse depths
    std::int32_t counts;    // 1, and by 2^8 and 2^20 the squares of its columns and rows
    std::int32_t product;   // columns by rows
    float dx;
    float dy;
    float steepest;  // the difference that slope alone may make, of the inverse depth
  };
  // The plane around each pixel; `support` is 0 where there is none.
  struct InversePlanes {
    float* value;
    float* by_column;
    float* by_row;
    std::uint8_t* support;
  };
  // `wanted` marks the pixels whose planes are wanted, not 0; nullptr: all.
  void (*fit)(const float* inverse, const float* tolerance, const std::uint8_t* wanted, int count,
              const Offset* offsets, std::size_t offset_count, float min_pairs,
              const InversePlanes& planes);

  struct Rays {
    const float* x;
    const float* y;
    // From the row above to that below, those of an image at its edge itself.
    std::ptrdiff_t above;
    std::ptrdiff_t below;
  };
  // The rows of a plane: z on the pixel's ray, normal, cosine of the incidence, and support.
  struct Planes {
    float* depth_m;
    float* normal[3];
    float* cosine;
    std::uint8_t* support;
  };
  struct PlaneCounts {
    int used;
    int flying;
    int grazing;
  };
  PlaneCounts (*finish)(const float* inverse, const InversePlanes& fitted, const Rays& rays,
                        int count, float min_cosine, const Planes& planes);

  struct Placement {
    float rotation[9];  // row by row
    float translation[3];
    float scale;
    float axial_m;
    float axial_of_range;
    float axial_of_square;
  };
  struct Places {
    float* place[3];
    float* normal[3];
    float* weight;
  };
  // Where support is not 0.
  void (*place)(const Planes& planes, const float* ray_x, const float* ray_y, int count,
                const Placement& placement, const Places& places);
  // Of the depths alone, x and y.
  void (*place_depths)(const float* depth, const float* ray_x, const float* ray_y, int count,
                       const Placement& placement, float* x, float* y);
};

// Of instructions that the processor has.
const DepthPlaneLoops& depth_plane_loops_of(InstructionSet instructions);

}  // namespace libmap
