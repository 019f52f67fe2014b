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

// Metadata at the beginning of a message with an image.
struct DepthMessageHead {
  std::int64_t stamp_ns = 0;  // 0: no stamp
  std::string frame{};        // optical frame of the camera
  std::string encoding{};     // `encoding` of an Image, e.g. "16UC1"; `format` of a CompressedImage
};

// Decodes the metadata of an Image or, if `compressed`, of a CompressedImage; its first KiB is
// enough. Throws Error if `bytes` ends within the metadata.
DepthMessageHead read_image_head(MessageEncoding encoding, std::string_view bytes, bool compressed);

// True for depth images: 16UC1, mono16 and 32FC1; for a CompressedImage, the formats of the plugin
// compressed_depth_image_transport.
bool is_depth_encoding(const std::string& encoding, bool compressed);

struct DepthUnits {
  double message_unit_m = 0.001;  // meters per unit of 16-bit messages (REP-118: 0.001)
  double image_unit_m = 0.001;    // meters per unit of the decoded images
};

struct DepthMessageImage {
  Image<std::uint16_t> image;       // unit: image_unit_m; 0: no depth; 65535: saturated in message
  std::size_t overflow_pixels = 0;  // number of pixels set to 0 because they exceed 65534 units
};

// Decodes a depth image. Throws Error for an encoding that is not of depth, RVL compression, an
// empty image or more than 2^27 pixels, truncated data or rows, and a damaged PNG.
DepthMessageImage decode_depth(MessageEncoding encoding, std::string_view bytes, bool compressed,
                               const DepthUnits& units);

struct CameraInfoMessage {
  std::int64_t stamp_ns = 0;  // 0: no stamp
  Camera camera{};            // base_from_camera is not set
};

// Decodes the camera matrix K and distortion D or, if `rectified` is set and the message contains a
// projection P, the pinhole camera of P. Applies binning and region of interest as ROS's
// image_geometry does. Throws Error for an uncalibrated camera or an unknown distortion model.
CameraInfoMessage decode_camera_info(MessageEncoding encoding, std::string_view bytes,
                                     bool rectified);

}  // namespace libmap
