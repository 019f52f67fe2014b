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
    float gate;     // factor of `tolerance`, standard deviations
    float axial_m;  // this and the next two: noise as in DepthNoise
    float axial_of_range;
    float axial_of_square;
  };
  // Numbers of pixels without depth and with depth outside the limits.
  struct MeasureCounts {
    int unmeasured;
    int out_of_range;
  };
  // Computes each pixel's inverse depth (0 without depth within the limits) and `tolerance`, its
  // maximum difference from the mean inverse depth of two opposite pixels.
  MeasureCounts (*measure)(const float* depth, int count, const Limits& limits, float* inverse,
                           float* tolerance);

  // A pair of pixels on opposite sides of the fitted pixel, dx columns and dy rows from that pixel.
  struct Offset {
    std::ptrdiff_t pixels;  // offset in the image of inverse depths
    std::int32_t counts;    // 1 + 2^8 dx^2 + 2^20 dy^2: three sums over pairs in one integer
    std::int32_t product;   // dx dy
    float dx;
    float dy;
    float steepest;  // maximum difference of the pair due to slope, divided by the inverse depth
  };
  // Planes around each pixel, in inverse depth.
  struct InversePlanes {
    float* value;           // at the pixel
    float* by_column;       // derivative by the column
    float* by_row;          // derivative by the row
    std::uint8_t* support;  // number of fitted pixels; 0: no plane
  };
  // Fits planes, with at least `min_pairs` pairs, to pixels whose `wanted` is not 0 (nullptr: all).
  void (*fit)(const float* inverse, const float* tolerance, const std::uint8_t* wanted, int count,
              const Offset* offsets, std::size_t offset_count, float min_pairs,
              const InversePlanes& planes);

  // PixelRays of a row, with the offsets of the rows above and below; 0 at the edge of the image.
  struct Rays {
    const float* x;
    const float* y;
    std::ptrdiff_t above;
    std::ptrdiff_t below;
  };
  // Planes of a row in the optical frame: z on the ray, normal, cosine of incidence, support.
  struct Planes {
    float* depth_m;
    float* normal[3];
    float* cosine;
    std::uint8_t* support;
  };
  struct PlaneCounts {  // as in DepthPixelCounts
    int used;
    int flying;
    int grazing;
  };
  // Converts fitted planes to the optical frame; returns numbers of pixels by outcome.
  PlaneCounts (*finish)(const float* inverse, const InversePlanes& fitted, const Rays& rays,
                        int count, float min_cosine, const Planes& planes);

  // Transform from the camera to the grid, and noise as in DepthNoise.
  struct Placement {
    float rotation[9];     // row by row
    float translation[3];  // voxels
    float scale;           // voxels per m
    float axial_m;
    float axial_of_range;
    float axial_of_square;
  };
  struct PlacedElements {
    float* position[3];  // voxels
    float* normal[3];
    float* weight;
  };
  // Transforms planes with support to the grid, weighted by cosine, support and depth noise.
  void (*place)(const Planes& planes, const float* ray_x, const float* ray_y, int count,
                const Placement& placement, const PlacedElements& placed);
  // Transforms measured depths to x and y in the grid.
  void (*place_depths)(const float* depth, const float* ray_x, const float* ray_y, int count,
                       const Placement& placement, float* x, float* y);
};

// Returns the loops for an instruction set, which the processor must support.
const DepthPlaneLoops& depth_plane_loops_of(InstructionSet instructions);

}  // namespace libmap
