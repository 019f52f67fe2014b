// Decodes depth images and camera calibrations from messages (sensor_msgs/Image, CompressedImage,
// CameraInfo).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/camera.h"
#include "libmap/core/image.h"

namespace libmap {

// Metadata in the first bytes of an image's message.
struct DepthMessageHead {
  std::int64_t stamp_ns = 0;  // 0: none
  std::string frame{};        // optical frame of the camera
  std::string encoding{};     // field encoding of an Image, e.g. "16UC1", or format if compressed
};

// Decodes the metadata; 1 KiB of the message is enough. Throws Error if `bytes` ends too early.
DepthMessageHead read_image_head(MessageEncoding encoding, std::string_view bytes, bool compressed);

// True for 16UC1, mono16, 32FC1; for a CompressedImage, formats of
// compressed_depth_image_transport.
bool is_depth_encoding(const std::string& encoding, bool compressed);

struct DepthUnits {
  double message_unit_m = 0.001;  // meters per unit of 16-bit messages (REP-118: 0.001)
  double image_unit_m = 0.001;    // meters per unit of the decoded images
};

struct DepthMessageImage {
  Image<std::uint16_t> image;       // in image units; 0: no measurement; 65535: saturated
  std::size_t overflow_pixels = 0;  // number of pixels that exceed 16 bits and are set to 0
};

// Decodes a depth image. Throws Error for an encoding that is not of depth, RVL compression, an
// empty image or more than 2^27 pixels, truncated data or rows, and a damaged PNG.
DepthMessageImage decode_depth(MessageEncoding encoding, std::string_view bytes, bool compressed,
                               const DepthUnits& units);

struct CameraInfoMessage {
  std::int64_t stamp_ns = 0;
  Camera camera{};  // base_from_camera is not set
};

// Decodes K and D; for `rectified` images P, if it is set, without distortion. Applies binning and
// region of interest as image_geometry does. Throws Error for an uncalibrated camera or an unknown
// distortion model.
CameraInfoMessage decode_camera_info(MessageEncoding encoding, std::string_view bytes,
                                     bool rectified);

}  // namespace libmap
