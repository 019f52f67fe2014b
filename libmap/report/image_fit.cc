#include "libmap/report/image_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

struct ImageLevel {
  int max_side;
  int quality;
};
constexpr std::array<ImageLevel, max_image_level + 1> levels{
    {{0, 0}, {100'000, 92}, {1400, 90}, {1100, 88}, {900, 85}, {700, 82}, {520, 80}, {360, 75}}};

constexpr std::size_t max_svg_bytes = std::size_t{4} << 20;

bool is_svg(std::string_view bytes) {
  const std::string_view head = trim(bytes.substr(0, 4096));
  return (head.starts_with("<") || head.starts_with("\xEF\xBB\xBF<")) &&
         head.find("<svg") != std::string_view::npos &&
         bytes.find("</svg>") != std::string_view::npos;
}

// Decodes an image; transparent pixels are blended with white.
ColorImage decode_on_white(const std::string& bytes) {
  const auto info = read_image_info(bytes);
  if (!info || info->channels != 4 || info->bits != 8)
    return decode_color(bytes, max_decoded_pixels);
  const RgbaImage image = decode_rgba(bytes);
  ColorImage flat(image.width, image.height);
  for (std::size_t n = 0; n < image.pixels.size(); ++n)
    for (std::size_t c = 0; c < 3; ++c) {
      const unsigned alpha = image.pixels[n][3];
      flat.pixels[n][c] = static_cast<std::uint8_t>(
          (image.pixels[n][c] * alpha + 255U * (255U - alpha) + 127U) / 255U);
    }
  return flat;
}

}  // namespace

ReportImage read_image_bytes(std::string bytes) {
  ReportImage report_image;
  if (is_svg(bytes)) {
    if (bytes.size() > max_svg_bytes)
      throw Error("too large for the report's page",
                  {.value = std::to_string(bytes.size()) + " bytes",
                   .bound = "<= " + std::to_string(max_svg_bytes)});
    report_image.media_type = "image/svg+xml";
    report_image.bytes = std::move(bytes);
    return report_image;
  }
  const auto format = image_format(bytes);
  if (!format) throw Error("unknown format", {.field = "image", .bound = "PNG, JPEG or SVG"});
  const ColorImage image = decode_color(bytes, max_decoded_pixels);
  report_image.media_type = *format == ImageFormat::png ? "image/png" : "image/jpeg";
  report_image.width = image.width;
  report_image.height = image.height;
  report_image.bytes = std::move(bytes);
  return report_image;
}

ColorImage shrink_image(const ColorImage& image, int width, int height) {
  ColorImage small(width, height);
  // OpenCV does not modify the source.
  const cv::Mat from(image.height, image.width, CV_8UC3,
                     const_cast<Color*>(image.pixels.data()));  // NOLINT
  cv::Mat to(height, width, CV_8UC3, small.pixels.data());
  cv::resize(from, to, to.size(), 0.0, 0.0, cv::INTER_AREA);
  return small;
}

ReportImage fit_image(const ReportImage& report_image, int level) {
  if (level <= 0 || report_image.media_type == "image/svg+xml") return report_image;
  const ImageLevel& bound = levels[static_cast<std::size_t>(std::min(level, max_image_level))];
  ColorImage image = decode_on_white(report_image.bytes);
  const int side = std::max(image.width, image.height);
  const bool scaled = side > bound.max_side;
  if (scaled) {
    const double fraction = static_cast<double>(bound.max_side) / side;
    const auto shrunk = [&](int length) {
      return std::max(1, static_cast<int>(std::lround(length * fraction)));
    };
    image = shrink_image(image, shrunk(image.width), shrunk(image.height));
  }
  ReportImage fitted = report_image;
  fitted.bytes = encode_jpeg(image, bound.quality);
  if (fitted.bytes.size() >= report_image.bytes.size()) return report_image;
  fitted.media_type = "image/jpeg";
  fitted.change = "JPEG, quality " + std::to_string(bound.quality);
  if (scaled)
    fitted.change += ", " + std::to_string(image.width) + " instead of " +
                     std::to_string(report_image.width) + " pixels wide";
  fitted.width = image.width;
  fitted.height = image.height;
  return fitted;
}

}  // namespace libmap
