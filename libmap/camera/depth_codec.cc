#include "libmap/camera/depth_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr std::string_view rvl_signature = "DEPTHRVL";
constexpr std::size_t rvl_header_bytes = 16;
// 4096 x 4096. A limit is necessary because RVL encodes many zeros in few bytes.
constexpr std::uint64_t max_depth_pixels = std::uint64_t{1} << 24;

std::uint32_t uint32_at(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// Reads the nibbles of 32-bit words, most significant first.
class NibbleReader {
 public:
  explicit NibbleReader(std::string_view words) : words_(words) {}

  // A number in groups of 3 bits, lowest first; bit 3 is set if another group follows.
  std::uint32_t number() {
    std::uint32_t value = 0;
    for (int shift = 0; shift < 32; shift += 3) {
      const std::uint32_t nibble = next();
      value |= (nibble & 7) << shift;
      if ((nibble & 8) == 0) return value;
    }
    throw Error("contains a number of more than 32 bits", {.field = "RVL data"});
  }

  std::size_t bytes_read() const { return at_; }

 private:
  std::uint32_t next() {
    if (left_ == 0) {
      if (at_ + 4 > words_.size())
        throw Error("RVL ends after " + std::to_string(rvl_header_bytes + words_.size()) +
                    " bytes, before the last pixel");
      word_ = uint32_at(words_, at_);
      at_ += 4;
      left_ = 8;
    }
    const std::uint32_t nibble = word_ >> 28;
    word_ <<= 4;
    --left_;
    return nibble;
  }

  std::string_view words_;
  std::size_t at_ = 0;
  std::uint32_t word_ = 0;
  int left_ = 0;
};

class NibbleWriter {
 public:
  explicit NibbleWriter(std::string& bytes) : bytes_(bytes) {}

  void number(std::uint32_t value) {
    do {
      const std::uint32_t rest = value >> 3;
      nibble((value & 7) | (rest != 0 ? 8 : 0));
      value = rest;
    } while (value != 0);
  }

  void finish() {
    while (count_ != 0) nibble(0);
  }

 private:
  void nibble(std::uint32_t value) {
    word_ = word_ << 4 | value;
    if (++count_ < 8) return;
    bytes_.append(reinterpret_cast<const char*>(&word_), sizeof word_);
    word_ = 0;
    count_ = 0;
  }

  std::string& bytes_;
  std::uint32_t word_ = 0;
  int count_ = 0;
};

void check_size(std::uint64_t columns, std::uint64_t rows) {
  if (columns <= max_depth_pixels && rows <= max_depth_pixels &&
      columns * rows <= max_depth_pixels && (columns == 0) == (rows == 0))
    return;
  throw Error("invalid size of a depth image",
              {.field = "image size",
               .value = std::to_string(columns) + " x " + std::to_string(rows),
               .bound = "<= " + std::to_string(max_depth_pixels) + " pixels"});
}

DepthInfo rvl_info(std::string_view bytes) {
  if (bytes.size() < rvl_header_bytes) throw Error("RVL ends in the header");
  const std::uint32_t columns = uint32_at(bytes, 8);
  const std::uint32_t rows = uint32_at(bytes, 12);
  check_size(columns, rows);
  return {DepthFormat::rvl, static_cast<int>(columns), static_cast<int>(rows)};
}

[[noreturn]] void refuse_run(std::uint64_t count, std::uint64_t left) {
  throw Error("longer than the rest of the RVL image", {.field = "run of pixels",
                                                        .value = std::to_string(count),
                                                        .bound = "<= " + std::to_string(left)});
}

}  // namespace

std::string to_text(DepthFormat format) {
  if (format == DepthFormat::rvl) return "RVL";
  return format == DepthFormat::png16 ? "16-bit PNG" : "float PNG";
}

std::optional<DepthInfo> read_depth_info(std::string_view bytes) {
  if (bytes.starts_with(rvl_signature)) return rvl_info(bytes);
  const std::optional<ImageInfo> info = read_image_info(bytes);
  if (!info || info->format != ImageFormat::png) return std::nullopt;
  check_size(static_cast<std::uint64_t>(info->width), static_cast<std::uint64_t>(info->height));
  if (info->channels == 1 && info->bits == 16)
    return DepthInfo{DepthFormat::png16, info->width, info->height};
  if (info->channels == 4 && info->bits == 8)
    return DepthInfo{DepthFormat::float_png, info->width, info->height};
  return std::nullopt;
}

DepthImage decode_depth(std::string_view bytes) {
  const std::optional<DepthInfo> info = read_depth_info(bytes);
  if (!info)
    throw Error("unknown format",
                {.field = "depth image", .bound = "RVL, 16-bit PNG or float PNG"});
  if (info->format == DepthFormat::rvl) return to_meters(decode_rvl(bytes));
  if (info->format == DepthFormat::png16) return to_meters(decode_gray16(bytes));
  DepthImage image = decode_float_png(bytes);
  for (float& depth : image.pixels)
    if (!std::isfinite(depth) || depth < 0) depth = 0;
  return image;
}

MillimeterImage decode_rvl(std::string_view bytes) {
  const DepthInfo info = rvl_info(bytes);
  const std::uint64_t pixels =
      static_cast<std::uint64_t>(info.width) * static_cast<std::uint64_t>(info.height);
  NibbleReader reader(bytes.substr(rvl_header_bytes));
  MillimeterImage image(info.width, info.height);
  std::uint64_t at = 0;
  std::uint32_t previous = 0;
  while (at < pixels) {
    const std::uint32_t zeros = reader.number();
    if (zeros > pixels - at) refuse_run(zeros, pixels - at);
    at += zeros;
    const std::uint32_t values = reader.number();
    if (values > pixels - at) refuse_run(values, pixels - at);
    for (const std::uint64_t end = at + values; at < end; ++at) {
      const std::uint32_t zigzag = reader.number();
      previous += (zigzag >> 1) ^ (0U - (zigzag & 1));
      if (previous > no_depth_mm)
        throw Error("contains a depth of more than 16 bits", {.field = "RVL data"});
      image.pixels[at] = static_cast<std::uint16_t>(previous);
    }
  }
  return image;
}

std::string encode_rvl(const MillimeterImage& image) {
  std::string bytes(rvl_signature);
  const std::array<std::uint32_t, 2> size{static_cast<std::uint32_t>(image.width),
                                          static_cast<std::uint32_t>(image.height)};
  bytes.append(reinterpret_cast<const char*>(size.data()), sizeof size);
  bytes.reserve(rvl_header_bytes + 2 * image.pixels.size());
  NibbleWriter writer(bytes);
  auto at = image.pixels.begin();
  const auto end = image.pixels.end();
  std::int32_t previous = 0;
  while (at != end) {
    const auto first = std::find_if(at, end, [](std::uint16_t value) { return value != 0; });
    const auto last = std::find(first, end, std::uint16_t{0});
    writer.number(static_cast<std::uint32_t>(first - at));
    writer.number(static_cast<std::uint32_t>(last - first));
    for (at = first; at != last; ++at) {
      const std::int32_t delta = *at - previous;
      writer.number((static_cast<std::uint32_t>(delta) << 1) ^ (delta < 0 ? 0xFFFFFFFFU : 0U));
      previous = *at;
    }
  }
  writer.finish();
  return bytes;
}

// OpenCV stores the four bytes of a float as blue, green, red and alpha.
DepthImage decode_float_png(std::string_view bytes) {
  const RgbaImage rgba = decode_rgba(bytes);
  DepthImage image(rgba.width, rgba.height);
  std::transform(rgba.pixels.begin(), rgba.pixels.end(), image.pixels.begin(), [](const auto& p) {
    return std::bit_cast<float>(std::array<std::uint8_t, 4>{p[2], p[1], p[0], p[3]});
  });
  return image;
}

std::string encode_float_png(const DepthImage& image) {
  RgbaImage rgba(image.width, image.height);
  std::transform(image.pixels.begin(), image.pixels.end(), rgba.pixels.begin(), [](float depth) {
    const auto p = std::bit_cast<std::array<std::uint8_t, 4>>(depth);
    return std::array<std::uint8_t, 4>{p[2], p[1], p[0], p[3]};
  });
  return encode_png(rgba);
}

MillimeterImage to_millimeters(const DepthImage& image) {
  MillimeterImage out(image.width, image.height);
  std::transform(image.pixels.begin(), image.pixels.end(), out.pixels.begin(), [](float depth) {
    const double millimeters = std::round(static_cast<double>(depth) * 1000);
    const bool is_representable = millimeters > 0 && millimeters < no_depth_mm;
    return static_cast<std::uint16_t>(is_representable ? millimeters : 0);
  });
  return out;
}

DepthImage to_meters(const MillimeterImage& image) {
  DepthImage out(image.width, image.height);
  std::transform(
      image.pixels.begin(), image.pixels.end(), out.pixels.begin(), [](std::uint16_t millimeters) {
        return millimeters == no_depth_mm ? 0.0F : static_cast<float>(millimeters) / 1000.0F;
      });
  return out;
}

}  // namespace libmap
