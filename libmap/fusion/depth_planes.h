// Fits a plane to the pixels around each pixel of a depth image.
//
// The inverse depth of a plane is affine in the image coordinates of a pinhole camera, and depth
// noise does not move a measurement to another pixel. Averages of inverse depth are therefore
// unbiased on slanted surfaces.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/pose.h"
#include "libmap/core/result_table.h"
#include "libmap/fusion/depth_noise.h"
#include "libmap/fusion/depth_projection.h"
#include "libmap/fusion/surface_voxels.h"
#include "libmap/fusion/tile_mask.h"

namespace libmap {

struct DepthPlaneOptions : DepthSensor {
  int radius_px = 3;               // 1 to 7: radius of the disc of pixels that a plane is fitted to
  double min_pair_fraction = 0.5;  // 0 to 1: minimum share of agreeing pairs (fit_depth_planes)
};

// Numbers of pixels by outcome.
struct DepthPixelCounts {
  std::size_t pixels = 0;
  std::size_t unmeasured = 0;  // no depth
  std::size_t out_of_range = 0;
  std::size_t without_ray = 0;  // lens distortion cannot be inverted
  std::size_t flying = 0;       // not on a surface of neighboring pixels
  std::size_t grazing = 0;      // incidence above the maximum
  std::size_t used = 0;         // pixels with a plane
};
void describe(ResultTable& table, const DepthPixelCounts& counts);

// Planes of all pixels, row by row; all values are 0 for pixels without a plane.
struct DepthPlanes {
  int width = 0;
  int height = 0;
  std::vector<float> depth_m;            // z of the plane on the pixel's ray
  std::vector<Eigen::Vector3f> normals;  // optical frame, towards the camera
  std::vector<float> cos_incidence;
  std::vector<std::uint8_t> support;  // number of pixels that the plane was fitted to
  DepthPixelCounts counts;
};

// Fits a plane to each pixel and its agreeing pairs of opposite neighbors: pairs whose mean inverse
// depth equals the pixel's within the noise. A pixel with too few agreeing pairs, at the edge of a
// surface, takes the plane of an adjacent pixel if that plane predicts its depth within the noise;
// otherwise it is a flying pixel. Image (depth in m) and rays must have the same size.
DepthPlanes fit_depth_planes(const DepthImage& depth, const PixelRays& rays,
                             const DepthPlaneOptions& options = {});

// Pixels to which planes are fitted. all: all pixels. in_cells: only pixels whose planes may be in
// the selected cells; the counts are then meaningless.
enum class FittedPixels { all, in_cells };

// Fits planes to the pixels of one depth image (m) and adds the planes in `cells` to the voxels of
// the grid, weighted by cosine, support and depth noise. Both values of `fitted` result in the same
// voxels, except at block edges if cells.subsampling_level > 0. Returns numbers of pixels.
DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const TileMask& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels);

}  // namespace libmap
