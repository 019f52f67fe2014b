// The photographs of a scan as files of their own, one a camera.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libmap/scan/rgbd_frame.h"
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

}  // namespace libmap
