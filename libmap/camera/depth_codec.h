// Reads and writes depth images in RTAB-Map's formats: RVL (Wilson 2017, "Fast lossless depth image
// compression") and 16-bit PNG in millimeters; float32 in meters as the four channels of a PNG.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/core/image.h"

namespace libmap {

// RTAB-Map's second value for "no measurement", besides 0.
inline constexpr std::uint16_t no_depth_mm = 65535;

using MillimeterImage = Image<std::uint16_t>;  // 0 and 65535: no measurement

enum class DepthFormat { rvl, png16, float_png };  // storage format of a depth image
std::string to_text(DepthFormat format);           // "RVL", "16-bit PNG", "float PNG"

struct DepthInfo {
  DepthFormat format = DepthFormat::rvl;
  int width = 0;
  int height = 0;
};

// Reads format and size from the header; `bytes` may end after the header. Returns nullopt for an
// image of another format, such as the right image of a stereo pair. Throws Error if the bytes are
// not an image or the size is invalid.
std::optional<DepthInfo> read_depth_info(std::string_view bytes);

// Decodes a depth image, m; 0 for 0 and 65535 mm, and for floats that are <= 0 or not finite. Sizes
// are checked before memory is allocated. Throws Error for another format or damaged data.
DepthImage decode_depth(std::string_view bytes);

// RVL with RTAB-Map's header: "DEPTHRVL", columns, rows. decode_rvl throws Error for damaged data.
MillimeterImage decode_rvl(std::string_view bytes);
std::string encode_rvl(const MillimeterImage& image);

// float32 (m) as PNG; all bits are preserved. decode_float_png throws Error for damaged data.
DepthImage decode_float_png(std::string_view bytes);
std::string encode_float_png(const DepthImage& image);

// Convert between meters and millimeters. to_millimeters rounds to the nearest millimeter; 0 for
// values that are not finite, <= 0 or above 65.534 m. to_meters: 0 for 65535.
MillimeterImage to_millimeters(const DepthImage& image);
DepthImage to_meters(const MillimeterImage& image);

}  // namespace libmap
