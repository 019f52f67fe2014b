// Provides the inner loops of depth_planes.h over the pixels of one row, for several instruction
// sets with identical results. Only plain pointers are used, because sources compiled for an
// extended instruction set must not include inline functions that other sources compile, too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libmap {

// Functions on rows of `count` pixels. Rows are read and written up to the next multiple of
// `lanes`, except rows of depth images, which end with the last pixel.
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
  // Numbers of pixels without depth and with depth outside the limits.
  struct MeasureCounts {
    int unmeasured;
    int out_of_range;
  };
  // Computes each pixel's inverse depth (0 without depth within the limits) and its maximum
  // difference from the mean of two opposite pixels.
  MeasureCounts (*measure)(const float* depth, int count, const Limits& limits, float* inverse,
                           float* tolerance);

  // A pair of pixels on opposite sides of the fitted pixel.
  struct Offset {
    std::ptrdiff_t pixels;  // offset in the image of inverse depths
    std::int32_t counts;    // 1 + 2^8 columns^2 + 2^20 rows^2
    std::int32_t product;   // columns x rows
    float dx;
    float dy;
    float steepest;  // maximum difference of the pair due to slope, per inverse depth
  };
  // Planes around each pixel; `support` is 0 without a plane.
  struct InversePlanes {
    float* value;
    float* by_column;
    float* by_row;
    std::uint8_t* support;
  };
  // Fits planes to the pixels with `wanted` not 0; nullptr: to all pixels.
  void (*fit)(const float* inverse, const float* tolerance, const std::uint8_t* wanted, int count,
              const Offset* offsets, std::size_t offset_count, float min_pairs,
              const InversePlanes& planes);

  struct Rays {
    const float* x;
    const float* y;
    // Offsets of the rows above and below; 0 at the edge of the image.
    std::ptrdiff_t above;
    std::ptrdiff_t below;
  };
  // Planes of a row in the optical frame: z on the pixel's ray, normal, cosine of incidence,
  // support.
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
  // Converts fitted planes to the optical frame; returns numbers of pixels by outcome.
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
  struct PlacedElements {
    float* position[3];
    float* normal[3];
    float* weight;
  };
  // Transforms planes with support to the grid.
  void (*place)(const Planes& planes, const float* ray_x, const float* ray_y, int count,
                const Placement& placement, const PlacedElements& placed);
  // Transforms measured depths to x and y in the grid.
  void (*place_depths)(const float* depth, const float* ray_x, const float* ray_y, int count,
                       const Placement& placement, float* x, float* y);
};

// Returns the loops for an instruction set that the processor has.
const DepthPlaneLoops& depth_plane_loops_of(InstructionSet instructions);

}  // namespace libmap
