// Image files as bytes in memory: JPEG (libjpeg-turbo) and PNG (libpng).
//
// Sizes are taken from the header and checked before memory is taken: at most 2^27 pixels, and no
// more than that many bytes can hold. An image that ends too early, fails its check sums or makes
// the decoder warn is an Error; what() does not name the file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/core/image.h"

namespace libmap {

enum class ImageFormat { jpeg, png };            // how a color image is stored, by its first bytes
std::string to_text(ImageFormat format);         // "JPEG", "PNG"
std::string file_extension(ImageFormat format);  // ".jpg", ".png"

// By the first bytes; nothing if it is neither.
std::optional<ImageFormat> image_format(std::string_view bytes);

struct ImageInfo {
  ImageFormat format = ImageFormat::jpeg;
  int width = 0;
  int height = 0;
  int channels = 0;  // as stored; a palette counts as 3
  int bits = 8;      // of a channel
};

// From the header alone: `bytes` may end after it. Nothing if it ends before the size is known;
// throws Error if this is no JPEG or PNG.
std::optional<ImageInfo> read_image_info(std::string_view bytes);

// Decoding takes up to ten bytes per pixel. Frames of a scan are decoded by several threads at
// once.
inline constexpr std::int64_t max_frame_pixels = std::int64_t{1} << 25;
// Pages of a texture and pictures come one at a time.
inline constexpr std::int64_t max_picture_pixels = std::int64_t{1} << 27;

// Any image as 8-bit color; gray becomes red = green = blue, transparency is ignored. Throws Error
// if there are more than `max_pixels`, as the following do beyond max_frame_pixels.
ColorImage decode_color(std::string_view bytes, std::int64_t max_pixels = max_frame_pixels);
// Any image as 8-bit gray; color by ITU-R BT.601 (Y = 0.299 R + 0.587 G + 0.114 B).
GrayImage decode_gray(std::string_view bytes);
// A PNG of one channel of 16 bits; throws Error for any other.
Image<std::uint16_t> decode_gray16(std::string_view bytes);
using RgbaColor = std::array<std::uint8_t, 4>;  // red, green, blue, opacity
using RgbaImage = Image<RgbaColor>;
// A PNG of four channels of 8 bits, as stored; throws Error for any other.
RgbaImage decode_rgba(std::string_view bytes);

// `quality` 1 to 100; chroma at half resolution. Throws Error for an empty image.
std::string encode_jpeg(const ColorImage& image, int quality = 95);
std::string encode_jpeg(const GrayImage& image, int quality = 95);
// Without loss. Throws Error for an empty image.
std::string encode_png(const ColorImage& image);
std::string encode_png(const GrayImage& image);
std::string encode_png(const Image<std::uint16_t>& image);
std::string encode_png(const RgbaImage& image);

}  // namespace libmap
