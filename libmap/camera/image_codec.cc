#include "libmap/camera/image_codec.h"

#include <png.h>
#include <turbojpeg.h>

#include <algorithm>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <memory>
#include <vector>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/error.h"

namespace libmap {

namespace {

// Images up to this size are not checked against the number of bytes.
constexpr std::int64_t always_allowed_pixels = std::int64_t{1} << 18;
// A Huffman-coded JPEG has at least one bit per block of 8 x 8 pixels.
constexpr std::int64_t jpeg_pixels_per_byte = 4096;
constexpr std::string_view png_signature("\x89PNG\r\n\x1a\n", 8);

std::uint32_t big_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  return value;
}

void check_size(const ImageInfo& info, std::size_t bytes, std::int64_t max_pixels) {
  const std::int64_t pixels = std::int64_t{info.width} * info.height;
  const std::string text = size_text(info.width, info.height) + " pixels";
  if (pixels > max_pixels)
    throw Error("image too large", {.field = "image size",
                                    .value = text,
                                    .bound = "<= " + std::to_string(max_pixels) + " pixels"});
  if (pixels <= always_allowed_pixels) return;
  const std::int64_t held = static_cast<std::int64_t>(bytes);
  const std::int64_t wanted = info.format == ImageFormat::png
                                  ? std::int64_t{info.height} *
                                        (std::int64_t{info.width} * info.bits / 8) /
                                        static_cast<std::int64_t>(deflate_ratio)
                                  : pixels / jpeg_pixels_per_byte;
  if (wanted > held)
    throw Error("more than " + std::to_string(held) + " bytes can contain",
                {.field = "image size", .value = text});
}

// ---------------------------------------------------------------------------------------- headers

std::optional<ImageInfo> png_info(std::string_view bytes) {
  if (bytes.size() < 33) return std::nullopt;  // signature and IHDR
  if (bytes.substr(12, 4) != "IHDR") throw Error("PNG has no header");
  const std::uint32_t width = big_endian(bytes, 16, 4);
  const std::uint32_t height = big_endian(bytes, 20, 4);
  constexpr std::uint32_t most = 0x7fffffff;
  if (width == 0 || height == 0 || width > most || height > most)
    throw Error("invalid", {.field = "size of the PNG image", .value = size_text(width, height)});
  ImageInfo info{.format = ImageFormat::png,
                 .width = static_cast<int>(width),
                 .height = static_cast<int>(height),
                 .bits = static_cast<std::uint8_t>(bytes[24])};
  switch (bytes[25]) {
    case PNG_COLOR_TYPE_GRAY:
      info.channels = 1;
      break;
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      info.channels = 2;
      break;
    case PNG_COLOR_TYPE_RGB:
    case PNG_COLOR_TYPE_PALETTE:
      info.channels = 3;
      break;
    case PNG_COLOR_TYPE_RGB_ALPHA:
      info.channels = 4;
      break;
    default:
      throw Error("PNG has an unknown color type");
  }
  return info;
}

// Markers up to the frame header (ITU-T T.81, B.1.1.3 and B.2.2).
std::optional<ImageInfo> jpeg_info(std::string_view bytes) {
  std::size_t at = 2;
  while (at + 4 <= bytes.size()) {
    if (bytes[at] != '\xff') throw Error("damaged", {.field = "JPEG header"});
    const auto marker = static_cast<std::uint8_t>(bytes[at + 1]);
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    const std::size_t length = big_endian(bytes, at + 2, 2);
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (length < 2 || marker < 0xc0 || marker == 0xd8 || marker == 0xd9 || marker == 0xda)
      throw Error("damaged", {.field = "JPEG header"});
    if (is_frame) {
      if (at + 10 > bytes.size()) return std::nullopt;
      ImageInfo info;
      info.bits = static_cast<std::uint8_t>(bytes[at + 4]);
      info.height = static_cast<int>(big_endian(bytes, at + 5, 2));
      info.width = static_cast<int>(big_endian(bytes, at + 7, 2));
      info.channels = static_cast<std::uint8_t>(bytes[at + 9]);
      if (info.width == 0 || info.height == 0)
        throw Error("invalid", {.field = "size of the JPEG image",
                                .value = size_text(info.width, info.height)});
      return info;
    }
    at += 2 + length;
  }
  return std::nullopt;
}

ImageInfo checked_info(std::string_view bytes, std::int64_t max_pixels = max_frame_pixels) {
  const std::optional<ImageInfo> info = read_image_info(bytes);
  if (!info)
    throw Error("truncated after " + std::to_string(bytes.size()) + " bytes",
                {.field = "image header"});
  check_size(*info, bytes.size(), max_pixels);
  return *info;
}

// ------------------------------------------------------------------------------------------- JPEG

using JpegHandle = std::unique_ptr<void, decltype(&tjDestroy)>;

void decode_jpeg(std::string_view bytes, const ImageInfo& info, int pixel_format,
                 std::uint8_t* pixels) {
  const JpegHandle handle(tjInitDecompress(), &tjDestroy);
  if (!handle) throw Error("libjpeg-turbo could not be initialized", {}, ErrorKind::failed);
  const int flags = TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS;
  const int result =
      tjDecompress2(handle.get(), reinterpret_cast<const unsigned char*>(bytes.data()),
                    static_cast<unsigned long>(bytes.size()), pixels, info.width, 0, info.height,
                    pixel_format, flags);
  if (result != 0)
    throw Error(std::string("damaged: ") + tjGetErrorStr2(handle.get()), {.field = "JPEG data"});
}

std::string encode_jpeg(const std::uint8_t* pixels, int width, int height, int pixel_format,
                        int subsampling, int quality) {
  if (width <= 0 || height <= 0)
    throw Error("an empty image cannot be written", {.field = "image size"});
  const JpegHandle handle(tjInitCompress(), &tjDestroy);
  if (!handle) throw Error("libjpeg-turbo could not be initialized", {}, ErrorKind::failed);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  const int result = tjCompress2(handle.get(), pixels, width, 0, height, pixel_format, &buffer,
                                 &size, subsampling, quality, TJFLAG_ACCURATEDCT);
  const std::unique_ptr<unsigned char, decltype(&tjFree)> owner(buffer, &tjFree);
  if (result != 0)
    throw Error(std::string("JPEG could not be encoded: ") + tjGetErrorStr2(handle.get()),
                {.field = "image size", .value = size_text(width, height)}, ErrorKind::failed);
  return std::string(reinterpret_cast<const char*>(buffer), size);
}

// -------------------------------------------------------------------------------------------- PNG

// State shared with libpng's callbacks. Functions that libpng may leave by longjmp must not have
// objects with destructors.
struct PngText {
  std::jmp_buf jump;
  char message[128] = "";
};

struct PngSource : PngText {
  const char* next = nullptr;
  std::size_t left = 0;
};

struct PngSink : PngText {
  std::string bytes;
};

void remember_error(png_structp png, png_const_charp message) {
  auto* text = static_cast<PngText*>(png_get_error_ptr(png));
  std::strncpy(text->message, message, sizeof text->message - 1);
  std::longjmp(text->jump, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_bytes(png_structp png, png_bytep target, png_size_t count) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  if (count > source->left) png_error(png, "ends too early");
  std::memcpy(target, source->next, count);
  source->next += count;
  source->left -= count;
}

enum class PngWanted { color, gray, gray16, rgba };

// Decodes all rows into `target`. Returns false if the PNG is damaged.
bool decode_png_rows(PngSource& source, PngWanted wanted, std::uint8_t* target,
                     std::size_t row_bytes, png_structp png, png_infop info) {
  if (setjmp(source.jump) != 0) return false;
  png_set_read_fn(png, &source, read_bytes);
  // Ancillary chunks do not affect pixels, and libpng allocates the stated size of a text or eXIf
  // chunk before reading it, in spite of png_set_chunk_malloc_max (1.6.39: only a warning).
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_read_info(png, info);
  if (wanted == PngWanted::color || wanted == PngWanted::gray) {
    png_set_expand(png);
    png_set_scale_16(png);
    png_set_strip_alpha(png);
    if (wanted == PngWanted::color) png_set_gray_to_rgb(png);
  } else if (wanted == PngWanted::gray16 && std::endian::native == std::endian::little) {
    png_set_swap(png);
  }
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != row_bytes) png_error(png, "rows of another length");
  const png_uint_32 height = png_get_image_height(png, info);
  for (int pass = 0; pass < passes; ++pass)
    for (png_uint_32 row = 0; row < height; ++row)
      png_read_row(png, target + row * row_bytes, nullptr);
  png_read_end(png, nullptr);
  return true;
}

void decode_png(std::string_view bytes, PngWanted wanted, std::uint8_t* target,
                std::size_t row_bytes) {
  PngSource source;
  source.next = bytes.data();
  source.left = bytes.size();
  png_structp png =
      png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, remember_error, ignore_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  const bool is_sound =
      info != nullptr && decode_png_rows(source, wanted, target, row_bytes, png, info);
  png_destroy_read_struct(&png, &info, nullptr);
  if (!is_sound) throw Error(std::string("damaged: ") + source.message, {.field = "PNG data"});
}

void append_bytes(png_structp png, png_bytep data, png_size_t count) {
  auto* sink = static_cast<PngSink*>(png_get_io_ptr(png));
  bool is_written = true;
  try {
    sink->bytes.append(reinterpret_cast<const char*>(data), count);
  } catch (const std::exception&) {
    is_written = false;
  }
  if (!is_written) png_error(png, "out of memory");
}

void flush_nothing(png_structp) {}

struct PngPixels {
  const std::uint8_t* data;
  int width;
  int height;
  int color_type;
  int bits;
  std::size_t row_bytes;
};

bool encode_png_rows(PngSink& sink, const PngPixels& pixels, png_structp png, png_infop info) {
  if (setjmp(sink.jump) != 0) return false;
  png_set_write_fn(png, &sink, append_bytes, flush_nothing);
  png_set_IHDR(png, info, static_cast<png_uint_32>(pixels.width),
               static_cast<png_uint_32>(pixels.height), pixels.bits, pixels.color_type,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // Higher levels save a few percent of bytes but take several times as long.
  png_set_compression_level(png, 3);
  png_write_info(png, info);
  if (pixels.bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  for (int row = 0; row < pixels.height; ++row)
    png_write_row(png, pixels.data + static_cast<std::size_t>(row) * pixels.row_bytes);
  png_write_end(png, nullptr);
  return true;
}

std::string encode_png(const PngPixels& pixels) {
  if (pixels.width <= 0 || pixels.height <= 0)
    throw Error("an empty image cannot be written", {.field = "image size"});
  PngSink sink;
  png_structp png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, remember_error, ignore_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  const bool is_written = info != nullptr && encode_png_rows(sink, pixels, png, info);
  png_destroy_write_struct(&png, &info);
  if (!is_written)
    throw Error(std::string("PNG could not be encoded: ") + sink.message,
                {.field = "image size", .value = size_text(pixels.width, pixels.height)},
                ErrorKind::failed);
  return std::move(sink.bytes);
}

template <typename Pixel>
std::string encode_png(const Image<Pixel>& image, int color_type, int bits) {
  return encode_png(PngPixels{reinterpret_cast<const std::uint8_t*>(image.pixels.data()),
                              image.width, image.height, color_type, bits,
                              static_cast<std::size_t>(image.width) * sizeof(Pixel)});
}

template <typename Pixel>
Image<Pixel> decode_png_as(std::string_view bytes, const ImageInfo& info, PngWanted wanted) {
  Image<Pixel> image(info.width, info.height);
  decode_png(bytes, wanted, reinterpret_cast<std::uint8_t*>(image.pixels.data()),
             static_cast<std::size_t>(info.width) * sizeof(Pixel));
  return image;
}

// Throws Error unless the image is a PNG with these channels and bits.
ImageInfo require_png(std::string_view bytes, int channels, int bits) {
  const ImageInfo info = checked_info(bytes);
  if (info.format != ImageFormat::png || info.channels != channels || info.bits != bits)
    throw Error("unsupported image",
                {.value = to_text(info.format) + " of " + std::to_string(info.channels) + " x " +
                          std::to_string(info.bits) + " bits per pixel",
                 .bound = "a PNG of " + std::to_string(channels) + " x " + std::to_string(bits) +
                          " bits per pixel"});
  return info;
}

}  // namespace

std::string to_text(ImageFormat format) { return format == ImageFormat::jpeg ? "JPEG" : "PNG"; }

std::string file_extension(ImageFormat format) {
  return format == ImageFormat::jpeg ? ".jpg" : ".png";
}

std::optional<ImageFormat> image_format(std::string_view bytes) {
  if (bytes.starts_with("\xff\xd8\xff")) return ImageFormat::jpeg;
  if (bytes.starts_with(png_signature)) return ImageFormat::png;
  return std::nullopt;
}

std::optional<ImageInfo> read_image_info(std::string_view bytes) {
  const std::optional<ImageFormat> format = image_format(bytes);
  if (!format) throw Error("unknown format", {.field = "image", .bound = "JPEG or PNG"});
  return *format == ImageFormat::jpeg ? jpeg_info(bytes) : png_info(bytes);
}

ColorImage decode_color(std::string_view bytes, std::int64_t max_pixels) {
  const ImageInfo info = checked_info(bytes, max_pixels);
  if (info.format == ImageFormat::png) return decode_png_as<Color>(bytes, info, PngWanted::color);
  ColorImage image(info.width, info.height);
  decode_jpeg(bytes, info, TJPF_RGB, image.pixels.data()->data());
  return image;
}

GrayImage decode_gray(std::string_view bytes) {
  const ImageInfo info = checked_info(bytes);
  if (info.format == ImageFormat::jpeg) {
    GrayImage image(info.width, info.height);
    decode_jpeg(bytes, info, TJPF_GRAY, image.pixels.data());
    return image;
  }
  if (info.channels <= 2) return decode_png_as<std::uint8_t>(bytes, info, PngWanted::gray);
  const ColorImage color = decode_png_as<Color>(bytes, info, PngWanted::color);
  GrayImage image(info.width, info.height);
  std::transform(
      color.pixels.begin(), color.pixels.end(), image.pixels.begin(), [](const Color& c) {
        return static_cast<std::uint8_t>((299 * c[0] + 587 * c[1] + 114 * c[2] + 500) / 1000);
      });
  return image;
}

Image<std::uint16_t> decode_gray16(std::string_view bytes) {
  return decode_png_as<std::uint16_t>(bytes, require_png(bytes, 1, 16), PngWanted::gray16);
}

RgbaImage decode_rgba(std::string_view bytes) {
  return decode_png_as<std::array<std::uint8_t, 4>>(bytes, require_png(bytes, 4, 8),
                                                    PngWanted::rgba);
}

std::string encode_jpeg(const ColorImage& image, int quality) {
  return encode_jpeg(reinterpret_cast<const std::uint8_t*>(image.pixels.data()), image.width,
                     image.height, TJPF_RGB, TJSAMP_420, quality);
}

std::string encode_jpeg(const GrayImage& image, int quality) {
  return encode_jpeg(image.pixels.data(), image.width, image.height, TJPF_GRAY, TJSAMP_GRAY,
                     quality);
}

std::string encode_png(const ColorImage& image) { return encode_png(image, PNG_COLOR_TYPE_RGB, 8); }
std::string encode_png(const GrayImage& image) { return encode_png(image, PNG_COLOR_TYPE_GRAY, 8); }
std::string encode_png(const Image<std::uint16_t>& image) {
  return encode_png(image, PNG_COLOR_TYPE_GRAY, 16);
}
std::string encode_png(const RgbaImage& image) {
  return encode_png(image, PNG_COLOR_TYPE_RGB_ALPHA, 8);
}

}  // namespace libmap
