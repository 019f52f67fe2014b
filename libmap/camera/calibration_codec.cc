#include "libmap/camera/calibration_codec.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "libmap/core/bytes.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr std::array<std::int32_t, 3> written_version{0, 23, 8};
constexpr std::size_t local_transform_numbers = 12;

void require_count(const char* field, std::int32_t count, std::int32_t full) {
  if (count != 0 && count != full)
    throw Error("wrong", {.field = std::string("number of elements of ") + field,
                          .value = std::to_string(count),
                          .bound = "0 or " + std::to_string(full)});
}

// ---------------------------------------------------------------------------------------- records

// CameraModel: 11 int32 {version, 0, w, h, nK, nD, nR, nP, nL}, then K D R P as float64, L as
// float32.
CalibrationRecord read_record(ByteReader& reader) {
  CalibrationRecord record;
  record.version = reader.number<std::array<std::int32_t, 3>>();
  const auto kind = reader.number<std::int32_t>();
  if (kind != 0)
    throw Error("unknown",
                {.field = "kind of calibration", .value = std::to_string(kind), .bound = "0"});
  record.width = reader.number<std::int32_t>();
  record.height = reader.number<std::int32_t>();
  const auto counts = reader.number<std::array<std::int32_t, 5>>();
  require_count("K", counts[0], 9);
  require_count("R", counts[2], 9);
  require_count("P", counts[3], 12);
  require_count("L", counts[4], local_transform_numbers);
  record.k = reader.numbers<double>(counts[0]);
  record.d = reader.numbers<double>(counts[1]);
  record.r = reader.numbers<double>(counts[2]);
  record.p = reader.numbers<double>(counts[3]);
  record.l = reader.numbers<float>(counts[4]);
  return record;
}

void append_record(ByteWriter& bytes, const CalibrationRecord& record) {
  bytes.number(record.version);
  bytes.number(std::int32_t{0});
  bytes.number(record.width);
  bytes.number(record.height);
  for (const std::size_t count :
       {record.k.size(), record.d.size(), record.r.size(), record.p.size(), record.l.size()})
    bytes.number(static_cast<std::int32_t>(count));
  bytes.numbers(record.k);
  bytes.numbers(record.d);
  bytes.numbers(record.r);
  bytes.numbers(record.p);
  bytes.numbers(record.l);
}

// StereoCameraModel: 10 int32 {version, 1, nR, nT, nE, nF, bytes of left, of right}, then R T E F
// as float64 and two records.
StereoCalibrationRecord read_stereo_record(ByteReader& reader) {
  StereoCalibrationRecord stereo;
  stereo.version = reader.number<std::array<std::int32_t, 3>>();
  reader.number<std::int32_t>();  // 1
  const auto counts = reader.number<std::array<std::int32_t, 4>>();
  const auto sizes = reader.number<std::array<std::int32_t, 2>>();
  require_count("R", counts[0], 9);
  require_count("T", counts[1], 3);
  require_count("E", counts[2], 9);
  require_count("F", counts[3], 9);
  stereo.r = reader.numbers<double>(counts[0]);
  stereo.t = reader.numbers<double>(counts[1]);
  stereo.e = reader.numbers<double>(counts[2]);
  stereo.f = reader.numbers<double>(counts[3]);
  for (const auto& [side, size] : {std::pair{&stereo.left, sizes[0]}, {&stereo.right, sizes[1]}}) {
    const std::size_t before = reader.rest().size();
    *side = read_record(reader);
    if (static_cast<std::int64_t>(before - reader.rest().size()) != size)
      throw Error("wrong", {.field = "length of a calibration in a stereo calibration",
                            .value = std::to_string(size)});
  }
  return stereo;
}

void append_stereo_record(ByteWriter& bytes, const StereoCalibrationRecord& stereo) {
  ByteWriter left;
  ByteWriter right;
  append_record(left, stereo.left);
  append_record(right, stereo.right);
  bytes.number(stereo.version);
  bytes.number(std::int32_t{1});
  for (const std::size_t count : {stereo.r.size(), stereo.t.size(), stereo.e.size(),
                                  stereo.f.size(), left.content().size(), right.content().size()})
    bytes.number(static_cast<std::int32_t>(count));
  bytes.numbers(stereo.r);
  bytes.numbers(stereo.t);
  bytes.numbers(stereo.e);
  bytes.numbers(stereo.f);
  bytes.bytes(left.content()).bytes(right.content());
}

// Records begin with four small int32; float32 values read as int32 are large unless they are 0.
bool begins_with_record(std::string_view bytes) {
  if (bytes.size() < 4 * sizeof(std::int32_t)) return false;
  const auto numbers = ByteReader(bytes).number<std::array<std::int32_t, 4>>();
  return std::all_of(numbers.begin(), numbers.end(),
                     [](std::int32_t n) { return n >= 0 && n < 10000; }) &&
         numbers[3] <= 1;
}

Calibration read_records(std::string_view bytes) {
  Calibration calibration{.layout = CalibrationLayout::records};
  ByteReader reader(bytes);
  while (!reader.empty()) {
    const std::string_view rest = reader.rest();
    if (!begins_with_record(rest)) throw Error("invalid", {.field = "records"});
    if (rest[12] == 0)
      calibration.cameras.push_back(read_record(reader));
    else
      calibration.stereo.push_back(read_stereo_record(reader));
  }
  if (!calibration.cameras.empty() && !calibration.stereo.empty())
    throw Error("both single and stereo ones, which is not supported", {.field = "cameras"});
  return calibration;
}

// ----------------------------------------------------------------------------------------- floats

constexpr std::size_t floats_bytes(CalibrationLayout layout, bool is_stereo) {
  return 4 * (4 + (is_stereo ? 1U : 0U) + (layout == CalibrationLayout::floats ? 0U : 2U) +
              local_transform_numbers);
}

bool is_size(float number) { return number >= 0 && number < 1e6F && number == std::floor(number); }

std::int32_t size_of(float number) {
  if (!is_size(number))
    throw Error("not an image size",
                {.field = "width or height of a calibration", .value = to_text(number)});
  return static_cast<std::int32_t>(number);
}

// Multiples of 576 bytes match both layouts (8 or 9 cameras). Image sizes distinguish them: the
// other layout has numbers of a rotation at their positions.
bool contains_sizes(std::string_view bytes) {
  constexpr std::size_t step = floats_bytes(CalibrationLayout::floats_with_size, false);
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    ByteReader reader(bytes.substr(at));
    const auto numbers = reader.number<std::array<float, 6>>();
    if (!is_size(numbers[4]) || !is_size(numbers[5]) || numbers[4] < 2 || numbers[5] < 2)
      return false;
  }
  return true;
}

std::optional<std::pair<CalibrationLayout, bool>> floats_layout(std::string_view bytes) {
  using enum CalibrationLayout;
  if (bytes.size() == floats_bytes(floats_with_size, true))
    return std::pair{floats_with_size, true};
  if (bytes.size() == floats_bytes(floats, true)) return std::pair{floats, true};
  const bool fits_with_size = bytes.size() % floats_bytes(floats_with_size, false) == 0;
  const bool fits_without = bytes.size() % floats_bytes(floats, false) == 0;
  if (fits_with_size && (!fits_without || contains_sizes(bytes)))
    return std::pair{floats_with_size, false};
  if (fits_without) return std::pair{floats, false};
  return std::nullopt;
}

Calibration read_floats(std::string_view bytes, CalibrationLayout layout, bool is_stereo) {
  Calibration calibration{.layout = layout};
  ByteReader reader(bytes);
  while (!reader.empty()) {
    CalibrationRecord record;
    const auto [fx, fy, cx, cy] = reader.number<std::array<float, 4>>();
    record.k = {fx, 0, cx, 0, fy, cy, 0, 0, 1};
    const float baseline_m = is_stereo ? reader.number<float>() : 0;
    if (layout == CalibrationLayout::floats_with_size) {
      record.width = size_of(reader.number<float>());
      record.height = size_of(reader.number<float>());
    }
    record.l = reader.numbers<float>(local_transform_numbers);
    if (is_stereo)
      calibration.stereo.push_back(
          {.version = {}, .left = record, .right = {}, .baseline_m = baseline_m});
    else
      calibration.cameras.push_back(record);
  }
  return calibration;
}

// ---------------------------------------------------------------------------------------- cameras

Pose base_from_camera_of(const CalibrationRecord& record) {
  if (record.l.empty()) return optical_to_body_rotation();
  Eigen::Matrix<double, 3, 4> stored;
  for (int i = 0; i < 12; ++i)
    stored(i / 4, i % 4) = static_cast<double>(record.l[static_cast<std::size_t>(i)]);
  if (!stored.allFinite()) throw Error("calibration contains a camera pose that is not finite");
  if (stored.isZero(0)) return optical_to_body_rotation();
  Pose pose = Pose::Identity();
  pose.linear() = nearest_rotation(stored.leftCols<3>());
  pose.translation() = stored.col(3);
  return pose;
}

void set_distortion(Camera& camera, std::vector<double> terms) {
  // A fisheye lens with zero terms is not a pinhole: radii are proportional to angles.
  if (terms.size() == 6) {
    camera.distortion_model = DistortionModel::equidistant;
    camera.distortion = {terms[0], terms[1], terms[4], terms[5]};
    return;
  }
  if (std::all_of(terms.begin(), terms.end(), [](double term) { return term == 0; })) return;
  // Terms 13 and 14 describe a tilted sensor.
  if (terms.size() == 14 && terms[12] == 0 && terms[13] == 0) terms.resize(12);
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = std::move(terms);
}

bool is_used(const std::vector<double>& p) { return p.size() == 12 && p[0] > 0 && p[5] > 0; }

Camera camera_of(const CalibrationRecord& record, int width, int height) {
  Camera camera;
  camera.width = record.width > 0 ? record.width : width;
  camera.height = record.height > 0 ? record.height : height;
  camera.base_from_camera = base_from_camera_of(record);
  if (is_used(record.p)) {
    camera.fx = record.p[0];
    camera.fy = record.p[5];
    camera.cx = record.p[2];
    camera.cy = record.p[6];
  } else if (record.k.size() == 9) {
    camera.fx = record.k[0];
    camera.fy = record.k[4];
    camera.cx = record.k[2];
    camera.cy = record.k[5];
    set_distortion(camera, record.d);
  } else {
    throw Error("both are missing", {.field = "K and P"});
  }
  camera.check();
  return camera;
}

StereoCamera stereo_camera_of(const StereoCalibrationRecord& record, int width, int height) {
  StereoCamera stereo;
  stereo.left = camera_of(record.left, width, height);
  const bool has_right = !record.right.k.empty() || !record.right.p.empty();
  stereo.right = has_right ? camera_of(record.right, width, height) : stereo.left;
  if (!has_right)
    stereo.baseline_m = static_cast<double>(record.baseline_m);
  else if (is_used(record.right.p))
    stereo.baseline_m = -record.right.p[3] / record.right.p[0];
  else if (record.t.size() == 3)
    stereo.baseline_m = Eigen::Vector3d(record.t[0], record.t[1], record.t[2]).norm();
  if (!(stereo.baseline_m > 0) || !std::isfinite(stereo.baseline_m))
    throw Error("invalid stereo camera",
                {.field = "baseline_m", .value = to_text(stereo.baseline_m), .bound = "> 0"});
  stereo.right_from_left.translation().x() = -stereo.baseline_m;
  // Raw images have the stored relative pose.
  if (has_right && !is_used(record.right.p) && record.r.size() == 9 && record.t.size() == 3) {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    stereo.right_from_left.linear() = nearest_rotation(Eigen::Map<const RowMajor>(record.r.data()));
    stereo.right_from_left.translation() = Eigen::Map<const Eigen::Vector3d>(record.t.data());
  }
  return stereo;
}

}  // namespace

std::string to_text(CalibrationLayout layout) {
  if (layout == CalibrationLayout::records) return "records";
  return layout == CalibrationLayout::floats_with_size ? "floats with size" : "floats";
}

Calibration decode_calibration(std::string_view bytes) {
  if (bytes.empty()) throw no_elements("bytes");
  if (begins_with_record(bytes)) {
    try {
      return read_records(bytes);
    } catch (const std::length_error&) {
      throw Error("truncated after " + std::to_string(bytes.size()) + " bytes",
                  {.field = "records"});
    }
  }
  const auto layout = floats_layout(bytes);
  if (!layout)
    throw Error("unknown", {.field = "layout", .value = std::to_string(bytes.size()) + " bytes"});
  return read_floats(bytes, layout->first, layout->second);
}

std::string encode_calibration(const Calibration& calibration) {
  ByteWriter bytes;
  for (const CalibrationRecord& record : calibration.cameras) append_record(bytes, record);
  for (const StereoCalibrationRecord& stereo : calibration.stereo)
    append_stereo_record(bytes, stereo);
  return bytes.content();
}

std::vector<Camera> cameras_of(const Calibration& calibration, int image_width, int image_height) {
  std::vector<Camera> cameras;
  const int count = static_cast<int>(calibration.cameras.size() + calibration.stereo.size());
  for (const CalibrationRecord& record : calibration.cameras)
    cameras.push_back(camera_of(record, image_width / count, image_height));
  for (const StereoCalibrationRecord& record : calibration.stereo)
    cameras.push_back(camera_of(record.left, image_width / count, image_height));
  return cameras;
}

std::vector<StereoCamera> stereo_cameras_of(const Calibration& calibration, int image_width,
                                            int image_height) {
  std::vector<StereoCamera> cameras;
  const int count = static_cast<int>(calibration.stereo.size());
  for (const StereoCalibrationRecord& record : calibration.stereo)
    cameras.push_back(stereo_camera_of(record, image_width / count, image_height));
  return cameras;
}

CalibrationRecord record_of(const Camera& camera) {
  CalibrationRecord record{
      .version = written_version, .width = camera.width, .height = camera.height};
  record.k = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  if (camera.is_distorted()) {
    record.d = camera.distortion;
    if (camera.distortion_model == DistortionModel::equidistant)
      record.d = {camera.distortion[0], camera.distortion[1], 0, 0,
                  camera.distortion[2], camera.distortion[3]};
  } else {
    record.d = {0, 0, 0, 0, 0};
    record.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    record.p = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  }
  for (int i = 0; i < 12; ++i)
    record.l.push_back(static_cast<float>(camera.base_from_camera.matrix()(i / 4, i % 4)));
  return record;
}

}  // namespace libmap
