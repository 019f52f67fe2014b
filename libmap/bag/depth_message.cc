#include "libmap/bag/depth_message.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "libmap/bag/message_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"

namespace libmap {

namespace {

constexpr std::uint16_t saturated = 65535;
constexpr std::uint64_t max_pixels = std::uint64_t{1} << 27;

// Header before the PNG in compressed_depth_image_transport: type of the image, and the two
// parameters of inverse depth.
struct CompressionHeader {
  std::int32_t format = 0;
  float depth_quantization_a = 0;
  float depth_quantization_b = 0;
};

// Image of 16-bit units, which converts depths in meters to these units.
class UnitImage {
 public:
  UnitImage(int width, int height, double unit_m) : unit_m_(unit_m) {
    result_.image = Image<std::uint16_t>(width, height);
  }
  void set(std::size_t pixel, double depth_m) {
    if (!(depth_m > 0) || !std::isfinite(depth_m)) return;
    const double units = std::round(depth_m / unit_m_);
    if (units < saturated)
      result_.image.pixels[pixel] = static_cast<std::uint16_t>(units);
    else
      ++result_.overflow_pixels;
  }
  void set_saturated(std::size_t pixel) { result_.image.pixels[pixel] = saturated; }
  DepthMessageImage take() { return std::move(result_); }

 private:
  double unit_m_;
  DepthMessageImage result_;
};

void set_units(std::size_t pixel, std::uint16_t value, const DepthUnits& units, UnitImage& image) {
  if (value == saturated) return image.set_saturated(pixel);
  // In this order of operations, values in equal units are unchanged.
  image.set(pixel, value * units.message_unit_m);
}

template <typename T>
T value_at(const char* bytes, bool swapped) {
  char ordered[sizeof(T)] = {};
  for (std::size_t n = 0; n < sizeof(T); ++n) ordered[n] = bytes[swapped ? sizeof(T) - 1 - n : n];
  T value;
  std::memcpy(&value, ordered, sizeof(T));
  return value;
}

DepthMessageImage decode_raw(const ros_message::Image& message, const DepthUnits& units) {
  const std::string& encoding = message.encoding;
  if (!is_depth_encoding(encoding, false))
    throw Error("not a depth image",
                {.field = "encoding", .value = encoding, .bound = "16UC1, mono16 or 32FC1"});
  const bool is_float = encoding == "32FC1";
  const std::uint64_t width = message.width;
  const std::uint64_t height = message.height;
  const std::uint64_t row = width * (is_float ? 4 : 2);
  const std::string size =
      size_text(static_cast<std::int64_t>(width), static_cast<std::int64_t>(height));
  if (width == 0 || height == 0 || width > max_pixels || width * height > max_pixels)
    throw Error("invalid image size",
                {.field = "size", .value = size, .bound = "1 to 2^27 pixels"});
  if (message.step < row)
    throw Error("shorter than a row of " + std::to_string(width) + " pixels",
                {.field = "step",
                 .value = std::to_string(message.step),
                 .bound = ">= " + std::to_string(row)});
  if (message.data.size() < message.step * (height - 1) + row)
    throw Error("truncated",
                {.field = "data",
                 .value = std::to_string(message.data.size()) + " bytes",
                 .bound = std::to_string(message.step * height) + " bytes for " + size});
  const bool swapped = (message.is_bigendian != 0) != (std::endian::native == std::endian::big);
  UnitImage image(static_cast<int>(width), static_cast<int>(height), units.image_unit_m);
  for (std::uint64_t y = 0; y < height; ++y) {
    const char* bytes = reinterpret_cast<const char*>(message.data.data()) + y * message.step;
    for (std::uint64_t x = 0; x < width; ++x)
      if (is_float)
        image.set(y * width + x, value_at<float>(bytes + 4 * x, swapped));
      else
        set_units(y * width + x, value_at<std::uint16_t>(bytes + 2 * x, swapped), units, image);
  }
  return image.take();
}

DepthMessageImage decode_compressed(const ros_message::CompressedImage& message,
                                    const DepthUnits& units) {
  const std::string& format = message.format;
  if (!is_depth_encoding(format, true))
    throw Error("not a compressed depth image",
                {.field = "format",
                 .value = format,
                 .bound = "16UC1; compressedDepth or 32FC1; compressedDepth"});
  if (format.find("rvl") != std::string::npos)
    throw Error("RVL is not supported, only PNG", {.field = "format", .value = format});
  CompressionHeader header;
  if (message.data.size() < sizeof header)
    throw Error("truncated", {.field = "data",
                              .value = std::to_string(message.data.size()) + " bytes",
                              .bound = ">= " + std::to_string(sizeof header) + " bytes"});
  std::memcpy(&header, message.data.data(), sizeof header);
  const std::string_view png(reinterpret_cast<const char*>(message.data.data()) + sizeof header,
                             message.data.size() - sizeof header);
  const Image<std::uint16_t> values = decode_gray16(png);
  const bool inverse = format.starts_with("32FC1");
  UnitImage image(values.width, values.height, units.image_unit_m);
  for (std::size_t n = 0; n < values.pixels.size(); ++n) {
    const std::uint16_t value = values.pixels[n];
    if (value == 0) continue;
    if (inverse)
      image.set(
          n, static_cast<double>(header.depth_quantization_a) /
                 (static_cast<double>(value) - static_cast<double>(header.depth_quantization_b)));
    else
      set_units(n, value, units, image);
  }
  return image.take();
}

Camera camera_of(const ros_message::CameraInfo& info, bool rectified) {
  Camera camera;
  camera.width = static_cast<int>(std::min<std::uint32_t>(info.width, 1U << 20));
  camera.height = static_cast<int>(std::min<std::uint32_t>(info.height, 1U << 20));
  const bool projected = rectified && info.p[0] > 0;
  camera.fx = projected ? info.p[0] : info.k[0];
  camera.fy = projected ? info.p[5] : info.k[4];
  camera.cx = projected ? info.p[2] : info.k[2];
  camera.cy = projected ? info.p[6] : info.k[5];
  if (projected) return camera;
  camera.distortion.assign(info.d.begin(), info.d.end());
  if (std::all_of(camera.distortion.begin(), camera.distortion.end(),
                  [](double d) { return d == 0; })) {
    camera.distortion.clear();
    return camera;
  }
  const std::string& model = info.distortion_model;
  if (model == "equidistant" || model == "fisheye")
    camera.distortion_model = DistortionModel::equidistant;
  else if (model == "plumb_bob" || model == "rational_polynomial")
    camera.distortion_model = DistortionModel::radial_tangential;
  else
    throw Error("unknown model", {.field = "distortion_model",
                                  .value = model,
                                  .bound = "plumb_bob, rational_polynomial or equidistant"});
  return camera;
}

// Adjusts the camera to binning and region of interest as image_geometry does.
void apply_region(const ros_message::CameraInfo& info, Camera& camera) {
  const double bin_x = std::max<std::uint32_t>(info.binning_x, 1);
  const double bin_y = std::max<std::uint32_t>(info.binning_y, 1);
  const bool cut = info.roi.width > 0 && info.roi.height > 0;
  const std::uint32_t width = cut ? info.roi.width : static_cast<std::uint32_t>(camera.width);
  const std::uint32_t height = cut ? info.roi.height : static_cast<std::uint32_t>(camera.height);
  camera.width = static_cast<int>(std::min(width / bin_x, 1048576.0));
  camera.height = static_cast<int>(std::min(height / bin_y, 1048576.0));
  camera.cx = (camera.cx - (cut ? info.roi.x_offset : 0)) / bin_x;
  camera.cy = (camera.cy - (cut ? info.roi.y_offset : 0)) / bin_y;
  camera.fx /= bin_x;
  camera.fy /= bin_y;
}

}  // namespace

bool is_depth_encoding(const std::string& encoding, bool compressed) {
  if (compressed) return encoding.find("compressedDepth") != std::string::npos;
  return encoding == "16UC1" || encoding == "mono16" || encoding == "32FC1";
}

DepthMessageHead read_image_head(MessageEncoding encoding, std::string_view bytes,
                                 bool compressed) {
  using ros_message::Head;
  if (compressed) {
    const auto head = ros_message::decode<Head<ros_message::CompressedImage>>(encoding, bytes);
    return {head.header.stamp.nanoseconds, head.header.frame_id, head.format};
  }
  const auto head = ros_message::decode<Head<ros_message::Image>>(encoding, bytes);
  return {head.header.stamp.nanoseconds, head.header.frame_id, head.encoding};
}

DepthMessageImage decode_depth(MessageEncoding encoding, std::string_view bytes, bool compressed,
                               const DepthUnits& units) {
  if (compressed)
    return decode_compressed(ros_message::decode<ros_message::CompressedImage>(encoding, bytes),
                             units);
  return decode_raw(ros_message::decode<ros_message::Image>(encoding, bytes), units);
}

CameraInfoMessage decode_camera_info(MessageEncoding encoding, std::string_view bytes,
                                     bool rectified) {
  const auto info = ros_message::decode<ros_message::CameraInfo>(encoding, bytes);
  CameraInfoMessage message{info.header.stamp.nanoseconds, camera_of(info, rectified)};
  apply_region(info, message.camera);
  message.camera.check();
  return message;
}

}  // namespace libmap
