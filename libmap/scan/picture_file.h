// The photographs of a scan as files of their own, one per camera; few of them that still show all
// of a scene.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// "000012.jpg"; of several cameras of node 12 the second is "000012_1.png".
std::string picture_name(int node, std::size_t camera, const std::string& extension);

struct PictureFile {
  std::string name{};
  std::string bytes{};  // as a database stores it, where that is this picture alone; else a PNG
};

// `views` are those of the node's frame, with color.
PictureFile picture_file(const ScanSource& scan, int node, const std::vector<CameraView>& views,
                         std::size_t camera);

// The cameras of a node's frame with their images. Throws Error naming the node: no color image,
// no calibration.
std::vector<CameraView> read_pictures(const ScanSource& scan, int node, FrameParts parts);

struct ViewSelectionOptions {
  double radius_m = 0.5;    // >= 0; 0: all views are kept
  double angle_deg = 30.0;  // 0..180, between the optical axes
};
void bind(ParameterTable& table, ViewSelectionOptions& options);

// Which views are kept, ascending: the best first, each that no kept one resembles, and two
// resemble each other if they lie nearer than the radius and look within the angle. So no two that
// are kept resemble each other, and each that is not kept resembles a better one that is.
// `qualities`, one a view, say which is better; of equal ones the first. Poses are of optical
// frames.
std::vector<std::size_t> select_views(const std::vector<Pose>& world_from_camera,
                                      const std::vector<double>& qualities,
                                      const ViewSelectionOptions& options = {});

// One image and the camera that took it, for Bundler v0.3 (Snavely, Seitz and Szeliski 2006), as
// MeshLab takes them for "registered rasters": bundle.out, list.txt and images.
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
