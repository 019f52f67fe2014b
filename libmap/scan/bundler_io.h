// Cameras as Bundler v0.3 (Snavely, Seitz and Szeliski 2006), as MeshLab takes them for "registered
// rasters": bundle.out, list.txt and images.
#pragma once

#include <string>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/pose.h"

namespace libmap {

// One image and the camera that took it.
struct BundlerView {
  std::string image{};  // as list.txt names it, relative to its folder
  Camera camera{};      // of an image like centered_pinhole's; base_from_camera is not used
  Pose world_from_camera = Pose::Identity();  // optical frame: z forward, x right, y down
};

// bundle.out: "# Bundle file v0.3", the numbers of cameras and points, then of each camera
// f k1 k2, three rows of R and t. Bundler's camera looks along -z with x right and y up:
//   P = R * X + t,  p = -P.xy / P.z,  pixel = f * (1 + k1 |p|^2 + k2 |p|^4) * p
// from the middle of the image, x to the right, y up. k1 = k2 = 0: not all readers agree on them.
// There are no points: they are not needed to place pictures.
std::string to_bundle_text(const std::vector<BundlerView>& views);

// list.txt: one image per line.
std::string to_bundler_list(const std::vector<BundlerView>& views);

}  // namespace libmap
