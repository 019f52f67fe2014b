// Depth images and camera calibrations out of messages (sensor_msgs/Image, CompressedImage,
// CameraInfo), from their encoded bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// What the first bytes of an image's message say.
struct DepthMessageHead {
  std::int64_t stamp_ns = 0;
  std::string frame{};     // of the camera, optical
  std::string encoding{};  // Image: "16UC1"; CompressedImage: its format
};

// `bytes` may end after the encoding, 1 KiB at most. Throws Error if they end before.
DepthMessageHead read_image_head(MessageEncoding encoding, std::string_view bytes, bool compressed);

// 16UC1, mono16, 32FC1; of a CompressedImage a format of compressed_depth_image_transport.
bool is_depth_encoding(const std::string& encoding, bool compressed);

struct DepthUnits {
  // Meters a unit of 16-bit messages (REP-118: 0.001), and of the images wanted.
  double message_unit_m = 0.001;
  double image_unit_m = 0.001;
};

struct DepthMessageImage {
  Image<std::uint16_t> image;  // in units; 0: nothing measured; 65535: the sensor was saturated
  std::size_t beyond = 0;      // pixels that 16 bits cannot hold, which are 0
};

// Throws Error: an encoding that is no depth, no size or more than 2^27 pixels, data shorter than
// its size says, rows that are shorter than their pixels, a broken PNG.
DepthMessageImage decode_depth(MessageEncoding encoding, std::string_view bytes, bool compressed,
                               const DepthUnits& units);

struct CameraInfoMessage {
  std::int64_t stamp_ns = 0;
  Camera camera{};  // base_from_camera is not set
};

// K and D; of `rectified` images P, which have no distortion any more. Binning and region of
// interest as image_geometry has them. Throws Error: not calibrated, an unknown distortion model.
CameraInfoMessage decode_camera_info(MessageEncoding encoding, std::string_view bytes,
                                     bool rectified);

}  // namespace libmap
