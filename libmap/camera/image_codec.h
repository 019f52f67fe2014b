// Decodes and encodes images in memory: JPEG (libjpeg-turbo) and PNG (libpng).
//
// Sizes are read from the header and checked before memory is allocated: at most max_frame_pixels
// (decode_color: `max_pixels`), and no more than the file size permits. Decoding throws Error if an
// image is truncated, has a wrong checksum or causes a warning.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/core/image.h"

namespace libmap {

enum class ImageFormat { jpeg, png };            // storage format of an image
std::string to_text(ImageFormat format);         // "JPEG", "PNG"
std::string file_extension(ImageFormat format);  // ".jpg", ".png"

// Returns the format by the first bytes; nullopt for other formats.
std::optional<ImageFormat> image_format(std::string_view bytes);

struct ImageInfo {
  ImageFormat format = ImageFormat::jpeg;
  int width = 0;
  int height = 0;
  int channels = 0;  // as stored; images with a palette have 3
  int bits = 8;      // bits per channel
};

// Reads the header; `bytes` may end after the header. Returns nullopt if the bytes end before the
// size is known. Throws Error if the bytes are neither JPEG nor PNG, or the header is damaged.
std::optional<ImageInfo> read_image_info(std::string_view bytes);

// Maximum pixels of a scan's frame; several threads decode frames, with up to ten bytes per pixel.
inline constexpr std::int64_t max_frame_pixels = std::int64_t{1} << 25;
// Maximum pixels of texture pages and other images, which are decoded one at a time.
inline constexpr std::int64_t max_decoded_pixels = std::int64_t{1} << 27;

// Decodes any image as 8-bit color; gray becomes red = green = blue, transparency is ignored.
// Throws Error above `max_pixels`; the following functions throw Error above max_frame_pixels.
ColorImage decode_color(std::string_view bytes, std::int64_t max_pixels = max_frame_pixels);
// Decodes any image as 8-bit gray; color by ITU-R BT.601 (Y = 0.299 R + 0.587 G + 0.114 B).
GrayImage decode_gray(std::string_view bytes);
// Decodes a PNG with one 16-bit channel; throws Error for any other image.
Image<std::uint16_t> decode_gray16(std::string_view bytes);
using RgbaColor = std::array<std::uint8_t, 4>;  // red, green, blue, opacity
using RgbaImage = Image<RgbaColor>;
// Decodes a PNG with four 8-bit channels, as stored; throws Error for any other image.
RgbaImage decode_rgba(std::string_view bytes);

// Encodes a JPEG with `quality` 1 to 100 and chroma at half resolution. Throws Error for an empty
// image.
std::string encode_jpeg(const ColorImage& image, int quality = 95);
std::string encode_jpeg(const GrayImage& image, int quality = 95);
// Encodes a PNG without loss. Throws Error for an empty image.
std::string encode_png(const ColorImage& image);
std::string encode_png(const GrayImage& image);
std::string encode_png(const Image<std::uint16_t>& image);
std::string encode_png(const RgbaImage& image);

}  // namespace libmap
