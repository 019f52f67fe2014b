// Exports color images of a scan to files, selects representative views, and writes Bundler models.
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

// Returns the file name "000012.jpg" for node 12, camera 0 and ".jpg"; "000012_1.png" for camera 1.
std::string image_file_name(int node, std::size_t camera, const std::string& extension);

struct ImageFile {
  std::string name{};   // as image_file_name
  std::string bytes{};  // stored file of an RTAB-Map database with one camera; else a new PNG
};

// Returns the image file of camera `camera`; `views` are the views of the node's frame, with color.
ImageFile image_file_of(const ScanSource& scan, int node, const std::vector<CameraView>& views,
                        std::size_t camera);

// Returns one view per camera of a node. Throws Error naming a node without color or calibration.
std::vector<CameraView> read_views(const ScanSource& scan, int node, FrameParts parts);

// Two views are similar if their distance is less than radius_m and the angle between their optical
// axes is at most angle_deg.
struct ViewSelectionOptions {
  double radius_m = 0.5;    // >= 0; 0: no views are similar
  double angle_deg = 30.0;  // 0 to 180
};
void bind(ParameterTable& table, ViewSelectionOptions& options);

// Selects views greedily by descending quality; returns their indices, ascending. A view is
// selected if it is not similar to a selected view, so each other view is similar to a better
// selected one. `qualities` has one value per view; of equal values, the first is better.
std::vector<std::size_t> select_views(const std::vector<Pose>& world_from_camera,
                                      const std::vector<double>& qualities,
                                      const ViewSelectionOptions& options = {});

// Image and camera of a Bundler v0.3 model (Snavely, Seitz and Szeliski 2006). The model consists
// of bundle.out, list.txt and the images; MeshLab imports it as "registered rasters".
struct BundlerView {
  std::string image{};  // name in list.txt, relative to the folder of list.txt
  Camera camera{};      // centered_pinhole (color_image.h); base_from_camera is not used
  Pose world_from_camera = Pose::Identity();  // optical frame: z forward, x right, y down
};

// Returns the text of bundle.out: "# Bundle file v0.3", the numbers of cameras and points (0), then
// for each camera f k1 k2, three rows of R and t. A point X in the world projects to
//   P = R * X + t,  p = -P.xy / P.z,  pixel = f * (1 + k1 |p|^2 + k2 |p|^4) * p
// relative to the image center, x right, y up (Bundler's camera looks along -z). k1 = k2 = 0,
// because readers interpret k1 and k2 differently.
std::string to_bundle_text(const std::vector<BundlerView>& views);

// Returns the text of list.txt: one image name per line.
std::string to_bundler_list(const std::vector<BundlerView>& views);

}  // namespace libmap
