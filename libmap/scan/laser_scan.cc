#include "libmap/scan/laser_scan.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/image/matrix_codec.h"
#include "libmap/scan/rtabmap_graph.h"

namespace libmap {

namespace {

struct LaserFormat {
  const char* name;
  int channels;
};

// By RTAB-Map's numbers.
constexpr std::size_t unknown_format = 0;
constexpr std::array<LaserFormat, 13> laser_formats{{{"unknown", 0},
                                                     {"XY", 2},
                                                     {"XYI", 3},
                                                     {"XYNormal", 5},
                                                     {"XYINormal", 6},
                                                     {"XYZ", 3},
                                                     {"XYZI", 4},
                                                     {"XYZRGB", 4},
                                                     {"XYZNormal", 6},
                                                     {"XYZINormal", 7},
                                                     {"XYZRGBNormal", 7},
                                                     {"XYZIT", 5},
                                                     {"XYZIRT", 6}}};

std::size_t format_of(float number) {
  if (!(number >= 0) || number > 12 || number != std::floor(number))
    throw Error("laser scan of an unknown format", {.value = to_text(number)});
  return static_cast<std::size_t>(number);
}

// Checks the description; the format that it states.
std::size_t format_of_info(std::string_view info) {
  constexpr std::size_t pose_bytes = 48;
  if (info.empty()) return unknown_format;
  if (info.size() != 76 && info.size() != 60 && info.size() != 56)
    throw Error("scan_info of an unknown length",
                {.value = std::to_string(info.size()) + " bytes", .bound = "56, 60 or 76"});
  std::vector<float> numbers(info.size() / sizeof(float));
  std::memcpy(numbers.data(), info.data(), info.size());
  const std::size_t format = info.size() == 76   ? format_of(numbers[0])
                             : info.size() == 60 ? format_of(numbers[2])
                                                 : unknown_format;
  const float points = numbers[info.size() == 76 ? 6 : 0];
  if (!(points >= 0 && points <= 2e9F))
    throw Error("scan_info contains no number of points", {.value = to_text(points)});
  decode_pose(info.substr(info.size() - pose_bytes));
  return format;
}

}  // namespace

void check_laser_scan(std::string_view scan, std::string_view info) {
  const std::size_t format = format_of_info(info);
  const StoredMatrix matrix = decode_matrix(scan);
  if (matrix.element != MatrixElement::float32) throw Error("laser scan that is not of float32");
  // Before 0.16.1 the format is not stored: those versions used 2 to 7 channels.
  if (format == unknown_format && (matrix.channels < 2 || matrix.channels > 7))
    throw Error("laser scan of an unknown number of channels",
                {.value = std::to_string(matrix.channels)});
  if (format != unknown_format && matrix.channels != laser_formats[format].channels)
    throw Error(
        "laser scan " + std::string(laser_formats[format].name) + " of another number of channels",
        {.value = std::to_string(matrix.channels),
         .bound = std::to_string(laser_formats[format].channels)});
}

}  // namespace libmap
