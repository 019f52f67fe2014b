#include "libmap/scan/laser_scan.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/image/matrix_codec.h"
#include "libmap/scan/rtabmap_graph.h"

namespace libmap {

namespace {

// Places of a point's numbers among its channels; -1 where it has none.
struct Channels {
  const char* name;
  int count;
  int z = -1;
  int intensity = -1;
  int color = -1;
  int normal = -1;
  int ring = -1;
  int time = -1;
};

constexpr std::array<Channels, 13> layouts{{
    {"unknown", 0},
    {"XY", 2},
    {"XYI", 3, -1, 2},
    {"XYNormal", 5, -1, -1, -1, 2},
    {"XYINormal", 6, -1, 2, -1, 3},
    {"XYZ", 3, 2},
    {"XYZI", 4, 2, 3},
    {"XYZRGB", 4, 2, -1, 3},
    {"XYZNormal", 6, 2, -1, -1, 3},
    {"XYZINormal", 7, 2, 3, -1, 4},
    {"XYZRGBNormal", 7, 2, -1, 3, 4},
    {"XYZIT", 5, 2, 3, -1, -1, -1, 4},
    {"XYZIRT", 6, 2, 3, -1, -1, 4, 5},
}};

const Channels& channels(LaserScanFormat format) {
  return layouts.at(static_cast<std::size_t>(format));
}

LaserScanFormat format_of(float number) {
  if (!(number >= 0) || number > 12 || number != std::floor(number))
    throw Error("laser scan of an unknown format", {.value = to_text(number)});
  return static_cast<LaserScanFormat>(static_cast<int>(number));
}

// Before 0.16.1 the format is not stored: the channels that those versions used.
LaserScanFormat format_of_channels(int count) {
  using enum LaserScanFormat;
  constexpr std::array formats{xy, xyz, xyz_rgb, xy_normal, xyz_normal, xyz_rgb_normal};
  if (count < 2 || count > 7)
    throw Error("laser scan of an unknown number of channels", {.value = std::to_string(count)});
  return formats[static_cast<std::size_t>(count - 2)];
}

void read_info(LaserScan& scan, std::string_view info) {
  constexpr std::size_t pose_bytes = 48;
  if (info.empty()) return;
  std::vector<float> numbers(info.size() / sizeof(float));
  if (!numbers.empty()) std::memcpy(numbers.data(), info.data(), numbers.size() * sizeof(float));
  float points = 0;
  if (info.size() == 76) {
    scan.format = format_of(numbers[0]);
    scan.range_min_m = static_cast<double>(numbers[1]);
    scan.range_max_m = static_cast<double>(numbers[2]);
    scan.angle_min_rad = static_cast<double>(numbers[3]);
    scan.angle_max_rad = static_cast<double>(numbers[4]);
    scan.angle_increment_rad = static_cast<double>(numbers[5]);
    points = numbers[6];
  } else if (info.size() == 60 || info.size() == 56) {
    points = numbers[0];
    scan.range_max_m = static_cast<double>(numbers[1]);
    if (info.size() == 60) scan.format = format_of(numbers[2]);
  } else {
    throw Error("scan_info of an unknown length",
                {.value = std::to_string(info.size()) + " bytes", .bound = "56, 60 or 76"});
  }
  if (!(points >= 0 && points <= 2e9F))
    throw Error("scan_info contains no number of points", {.value = to_text(points)});
  scan.max_points = static_cast<int>(points);
  scan.base_from_scan =
      decode_pose(info.substr(info.size() - pose_bytes)).value_or(Pose::Identity());
}

struct Columns {
  std::vector<double>* intensity = nullptr;
  std::vector<double>* ring = nullptr;
  std::vector<double>* time = nullptr;
};

std::vector<double>* add_field(PointCloud& cloud, int place, const char* name) {
  return place < 0 ? nullptr : &cloud.add_field(name, ScalarType::float32).values;
}

void add_point(PointCloud& cloud, const Channels& layout, const float* point,
               const Columns& columns) {
  const auto number = [&](int place) { return static_cast<double>(point[place]); };
  cloud.positions.emplace_back(number(0), number(1), layout.z < 0 ? 0.0 : number(layout.z));
  if (layout.normal >= 0)
    cloud.normals.emplace_back(point[layout.normal], point[layout.normal + 1],
                               point[layout.normal + 2]);
  if (layout.color >= 0) {
    const auto rgb = std::bit_cast<std::uint32_t>(point[layout.color]);
    cloud.colors.push_back({static_cast<std::uint8_t>(rgb >> 16),
                            static_cast<std::uint8_t>(rgb >> 8), static_cast<std::uint8_t>(rgb)});
  }
  if (columns.intensity != nullptr) columns.intensity->push_back(number(layout.intensity));
  if (columns.ring != nullptr) columns.ring->push_back(number(layout.ring));
  if (columns.time != nullptr) columns.time->push_back(number(layout.time));
}

void read_points(LaserScan& scan, const StoredMatrix& matrix) {
  const Channels& layout = channels(scan.format);
  const auto step = static_cast<std::size_t>(layout.count);
  const std::size_t count = matrix.bytes.size() / (step * sizeof(float));
  scan.points.positions.reserve(count);
  // Fields are made first: a later one may move the earlier.
  add_field(scan.points, layout.intensity, "intensity");
  add_field(scan.points, layout.ring, "ring");
  add_field(scan.points, layout.time, "time");
  const auto values_of = [&](const char* name) {
    ScalarField* field = scan.points.find_field(name);
    return field == nullptr ? nullptr : &field->values;
  };
  const Columns columns{values_of("intensity"), values_of("ring"), values_of("time")};
  std::array<float, 7> numbers{};
  const float* point = numbers.data();
  for (std::size_t n = 0; n < count; ++n) {
    std::memcpy(numbers.data(), matrix.bytes.data() + n * step * sizeof(float),
                step * sizeof(float));
    const bool is_finite = std::isfinite(point[0]) && std::isfinite(point[1]) &&
                           (layout.z < 0 || std::isfinite(point[layout.z]));
    if (is_finite)
      add_point(scan.points, layout, point, columns);
    else
      ++scan.dropped_points;
  }
}

}  // namespace

std::string to_text(LaserScanFormat format) { return channels(format).name; }

int channels_of(LaserScanFormat format) { return channels(format).count; }

LaserScan decode_laser_scan(std::string_view scan_blob, std::string_view info) {
  LaserScan scan;
  read_info(scan, info);
  const StoredMatrix matrix = decode_matrix(scan_blob);
  if (matrix.element != MatrixElement::float32) throw Error("laser scan that is not of float32");
  if (scan.format == LaserScanFormat::unknown) scan.format = format_of_channels(matrix.channels);
  if (matrix.channels != channels_of(scan.format))
    throw Error("laser scan " + to_text(scan.format) + " of another number of channels",
                {.value = std::to_string(matrix.channels),
                 .bound = std::to_string(channels_of(scan.format))});
  read_points(scan, matrix);
  return scan;
}

}  // namespace libmap
