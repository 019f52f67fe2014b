// Reads RTAB-Map's calibrations of nodes in all layouts, and writes them in the newest layout.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"

namespace libmap {

// Layout of column Data.calibration by version of RTAB-Map. L: base_from_camera, 12 numbers.
enum class CalibrationLayout {
  records,           // since 0.18.0: one record per camera or stereo pair
  floats_with_size,  // 0.11.2 to 0.17: fx fy cx cy [baseline] width height L, float32
  floats             // 0.10.0 to 0.11.1: fx fy cx cy [baseline] L, float32
};
std::string to_text(CalibrationLayout layout);

struct CalibrationRecord {
  std::array<std::int32_t, 3> version{};  // version of RTAB-Map that wrote the record
  std::int32_t width = 0;                 // pixels; 0 if not stored
  std::int32_t height = 0;
  std::vector<double> k{};  // 3 x 3 or empty: camera matrix of the raw image
  std::vector<double> d{};  // distortion of the raw image
  std::vector<double> r{};  // 3 x 3 or empty: rectification
  std::vector<double> p{};  // 3 x 4 or empty: projection of the rectified image
  std::vector<float> l{};   // 3 x 4 or empty: base_from_camera

  bool operator==(const CalibrationRecord&) const = default;
};

struct StereoCalibrationRecord {
  std::array<std::int32_t, 3> version{};
  std::vector<double> r{};  // 3 x 3 or empty: rotation of right_from_left
  std::vector<double> t{};  // 3 or empty: translation of right_from_left, m
  std::vector<double> e{};  // 3 x 3 or empty: essential matrix
  std::vector<double> f{};  // 3 x 3 or empty: fundamental matrix
  CalibrationRecord left{};
  CalibrationRecord right{};  // k, d, r and p are empty in the float layouts
  float baseline_m = 0;       // only in the float layouts

  bool operator==(const StereoCalibrationRecord&) const = default;
};

struct Calibration {
  CalibrationLayout layout = CalibrationLayout::records;
  std::vector<CalibrationRecord> cameras{};  // side by side in one image
  std::vector<StereoCalibrationRecord> stereo{};

  bool empty() const { return cameras.empty() && stereo.empty(); }
  bool operator==(const Calibration&) const = default;
};

// Decodes a calibration; the layout is recognized from the bytes. Throws Error for an unknown
// layout or truncated data.
Calibration decode_calibration(std::string_view bytes);
// Encodes a calibration in layout `records`. Decoded records are reproduced exactly.
std::string encode_calibration(const Calibration& calibration);

// Return the cameras of the stored images (left ones of stereo pairs), and the stereo pairs: from P
// if it is stored (rectified images), else from K and D; 6 terms of D are equidistant: k1 k2 0 0 k3
// k4. A camera without a stored size has an equal share of `image_width` and all of `image_height`.
// Throw Error if K and P are missing, or a camera or a baseline is invalid.
std::vector<Camera> cameras_of(const Calibration& calibration, int image_width, int image_height);
std::vector<StereoCamera> stereo_cameras_of(const Calibration& calibration, int image_width,
                                            int image_height);

// Record of a camera in layout `records`: K, L, and D if it is distorted, else P = [K | 0].
CalibrationRecord record_of(const Camera& camera);

}  // namespace libmap
