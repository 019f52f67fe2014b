// The surface through each pixel of a depth image: a plane fitted to the pixels around it.
//
// The inverse depth of a plane is affine in the image coordinates of a pinhole camera, and noise of
// the depth does not move a measurement to another pixel: averaged there, a slanted surface keeps
// its place.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "libmap/cloud/depth_noise.h"
#include "libmap/cloud/depth_plane_loops.h"
#include "libmap/cloud/depth_projection.h"
#include "libmap/core/image.h"
#include "libmap/core/result_table.h"

namespace libmap {

struct DepthPlaneOptions {
  double min_depth_m = 0.1;
  double max_depth_m = 4.0;
  DepthNoise noise{};
  int radius_px = 3;                // 1 to 7: of the disc of pixels that a plane is fitted to
  double min_pair_share = 0.5;      // of the pairs of opposite pixels in it that must agree
  double max_incidence_deg = 85.0;  // between line of sight and normal: more is grazing
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

// The same, use(y, planes) for each row in which there are planes. `only`, if it is not empty,
// marks the pixels whose planes are wanted, not 0; others have none, and the counts say nothing.
using UsePlaneRow = std::function<void(int y, const DepthPlaneLoops::Planes& planes)>;
DepthPixelCounts each_plane_row(const DepthImage& depth, const PixelRays& rays,
                                const DepthPlaneOptions& options,
                                const std::vector<std::uint8_t>& only, const UsePlaneRow& use);

// No plane is further than this from the depth of its pixel, along the axis, m.
double max_plane_distance_m(const DepthPlaneOptions& options);

// The marked pixels, not 0, and those that decide on their planes: with these as `only`, the planes
// of the marked pixels are those of the whole image.
std::vector<std::uint8_t> grown_marks(const std::vector<std::uint8_t>& marks, int width,
                                      int height);

}  // namespace libmap
