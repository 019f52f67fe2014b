// The surface through each pixel of a depth image: a plane fitted to the pixels around it.
//
// The inverse depth of a plane is affine in the image coordinates of a pinhole camera, and noise of
// the depth does not move a measurement to another pixel: averaged there, a slanted surface keeps
// its place.
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
  int radius_px = 3;            // 1 to 7: of the disc of pixels that a plane is fitted to
  double min_pair_share = 0.5;  // of the pairs of opposite pixels in it that must agree
};

// What became of each pixel.
struct DepthPixelCounts {
  std::size_t pixels = 0;
  std::size_t unmeasured = 0;  // no depth
  std::size_t out_of_range = 0;
  std::size_t without_ray = 0;  // outside what the lens distortion can undo
  std::size_t flying = 0;       // no surface around them explains them
  std::size_t grazing = 0;
  std::size_t used = 0;
};
void describe(ResultTable& table, const DepthPixelCounts& counts);

// Each used pixel's plane, by row and column; support 0 elsewhere.
struct DepthPlanes {
  int width = 0;
  int height = 0;
  std::vector<float> depth_m;            // z of the plane on the pixel's ray
  std::vector<Eigen::Vector3f> normals;  // optical frame, towards the camera
  std::vector<float> cos_incidence;
  std::vector<std::uint8_t> support;  // pixels that the plane was fitted to
  DepthPixelCounts counts;
};

// For each pixel those pairs of opposite neighbors whose mean agrees with it within the noise:
// their mean inverse depth and its least-squares slopes. A pixel with too few such pairs, at the
// edge of a surface, takes the plane next to it that predicts its depth within the noise; if there
// is none, it is flying. Image and rays have one size.
DepthPlanes fit_depth_planes(const DepthImage& depth, const PixelRays& rays,
                             const DepthPlaneOptions& options = {});

// Which pixels planes are fitted to: all, and the counts are those of the image; or those that may
// be in the cells, and the counts say nothing.
enum class FittedPixels { all, in_cells };

// Fits planes to the pixels of one depth image (m) and adds those in `cells` to the voxels of the
// grid, each weighted by its cosine, its support and the noise of its depth. Both kinds of fitted
// pixels give the same voxels; but of downsampled cells the edges are fitted roughly. What became
// of the pixels.
DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const TileMask& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels);

}  // namespace libmap
