// Depth images as RTAB-Map stores them: RVL (Wilson 2017, "Fast lossless depth image compression"),
// 16-bit PNG, both in whole millimeters, or the bytes of float32 meters as the four channels of a
// PNG.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/core/image.h"

namespace libmap {

// RTAB-Map's "no measurement" besides 0.
inline constexpr std::uint16_t no_depth_mm = 65535;

using MillimeterImage = Image<std::uint16_t>;  // 0 and 65535: nothing was measured

enum class DepthFormat { rvl, png16, float_png };  // how a depth image is stored
std::string to_text(DepthFormat format);           // "RVL", "16-bit PNG", "float PNG"

struct DepthInfo {
  DepthFormat format = DepthFormat::rvl;
  int width = 0;
  int height = 0;
};

// From the header alone: `bytes` may end after it. Nothing if it is another kind of image, such as
// the right one of a stereo pair. Throws Error if it is no image.
std::optional<DepthInfo> read_depth_info(std::string_view bytes);

// In meters; 0 where nothing was measured: 0 and 65535 mm; NaN, infinity and values <= 0 of floats.
// Sizes are checked before memory is taken, and every read is bounded. Throws Error.
DepthImage decode_depth(std::string_view bytes);

// RVL with RTAB-Map's header: "DEPTHRVL", columns, rows.
MillimeterImage decode_rvl(std::string_view bytes);
std::string encode_rvl(const MillimeterImage& image);

// Floats keep their bits.
DepthImage decode_float_png(std::string_view bytes);
std::string encode_float_png(const DepthImage& image);

// Nearest millimeter; 0 for what is not finite, not above 0 or beyond 65.534 m.
MillimeterImage to_millimeters(const DepthImage& image);
DepthImage to_meters(const MillimeterImage& image);

}  // namespace libmap
