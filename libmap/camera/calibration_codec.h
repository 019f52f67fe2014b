// Reads camera calibrations in RTAB-Map databases in all layouts, and writes the newest layout.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"

namespace libmap {

// Layout of column Data.calibration by version of RTAB-Map. L: base_from_camera, 3 x 4, by rows.
enum class CalibrationLayout {
  records,           // since 0.18.0: one record per camera or stereo pair
  floats_with_size,  // 0.11.2 to 0.17: fx fy cx cy [baseline] width height L, float32
  floats             // 0.10.0 to 0.11.1: fx fy cx cy [baseline] L, float32
};
std::string to_text(CalibrationLayout layout);  // "records", "floats with size", "floats"

struct CalibrationRecord {
  std::array<std::int32_t, 3> version{};  // version of RTAB-Map that wrote the record
  std::int32_t width = 0;                 // pixels; 0 if not stored
  std::int32_t height = 0;                // pixels; 0 if not stored
  std::vector<double> k{};                // 3 x 3 or empty: camera matrix K of the raw image
  std::vector<double> d{};                // distortion terms D of the raw image, in OpenCV's order
  std::vector<double> r{};  // 3 x 3 or empty: rotation that rectifies the camera frame
  std::vector<double> p{};  // 3 x 4 or empty: projection P of the rectified image
  std::vector<float> l{};   // 3 x 4 or empty: base_from_camera; lengths in meters

  bool operator==(const CalibrationRecord&) const = default;
};

struct StereoCalibrationRecord {
  std::array<std::int32_t, 3> version{};  // version of RTAB-Map that wrote the record
  std::vector<double> r{};                // 3 x 3 or empty: rotation of right_from_left
  std::vector<double> t{};                // 3 or empty: translation of right_from_left, m
  std::vector<double> e{};                // 3 x 3 or empty: essential matrix
  std::vector<double> f{};                // 3 x 3 or empty: fundamental matrix
  CalibrationRecord left{};
  CalibrationRecord right{};  // k, d, r and p are empty in the layouts floats_with_size and floats
  float baseline_m = 0;       // used only in the layouts floats_with_size and floats

  bool operator==(const StereoCalibrationRecord&) const = default;
};

struct Calibration {
  CalibrationLayout layout = CalibrationLayout::records;
  std::vector<CalibrationRecord> cameras{};       // images side by side in the stored image
  std::vector<StereoCalibrationRecord> stereo{};  // left images side by side after these

  bool empty() const { return cameras.empty() && stereo.empty(); }
  bool operator==(const Calibration&) const = default;
};

// Decodes a calibration; the layout is recognized from the bytes. Throws Error for an unknown
// layout or truncated data.
Calibration decode_calibration(std::string_view bytes);
// Encodes a calibration in layout `records`. Records that were decoded are reproduced exactly.
std::string encode_calibration(const Calibration& calibration);

// Returns the cameras, then the left cameras of stereo pairs. A camera is the pinhole camera of P
// if P is stored (rectified images), else K and D; 6 terms of D are k1 k2 0 0 k3 k4 of an
// equidistant lens. A camera without stored size has an equal part of `image_width`, and
// `image_height`. Throws Error if K and P are missing or a camera is invalid.
std::vector<Camera> cameras_of(const Calibration& calibration, int image_width, int image_height);
// Returns the stereo pairs, with cameras as in cameras_of. Also throws if a baseline is not > 0.
std::vector<StereoCamera> stereo_cameras_of(const Calibration& calibration, int image_width,
                                            int image_height);

// Returns a record with K, L, and D for a distorted camera, P = [K | 0] for an undistorted camera.
CalibrationRecord record_of(const Camera& camera);

}  // namespace libmap
