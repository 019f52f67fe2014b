// Calibrations as RTAB-Map stores them with each node, in all of their layouts.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/camera.h"

namespace libmap {

// How Data.calibration is laid out, by the version of RTAB-Map that wrote it.
enum class CalibrationLayout {
  records,           // 0.18.0 on: a record for each camera or stereo pair
  floats_with_size,  // 0.11.2 to 0.17: fx fy cx cy [baseline] width height L, float32
  floats             // 0.10.0 to 0.11.1: the same without width and height
};
std::string to_text(CalibrationLayout layout);

struct CalibrationRecord {
  std::array<std::int32_t, 3> version{};  // of RTAB-Map
  std::int32_t width = 0;                 // pixels; 0 where not stored
  std::int32_t height = 0;
  std::vector<double> k{};  // 3 x 3 or empty: of the raw image
  std::vector<double> d{};  // distortion of the raw image
  std::vector<double> r{};  // 3 x 3 or empty: rectification
  std::vector<double> p{};  // 3 x 4 or empty: of the rectified image
  std::vector<float> l{};   // 3 x 4 or empty: base_from_camera

  bool operator==(const CalibrationRecord&) const = default;
};

struct StereoCalibrationRecord {
  std::array<std::int32_t, 3> version{};
  std::vector<double> r{};  // 3 x 3 or empty: right_from_left
  std::vector<double> t{};  // 3 or empty
  std::vector<double> e{};  // 3 x 3 or empty
  std::vector<double> f{};  // 3 x 3 or empty
  CalibrationRecord left{};
  CalibrationRecord right{};  // k, d, r and p are empty in the layouts of floats
  float baseline_m = 0;       // in the layouts of floats alone

  bool operator==(const StereoCalibrationRecord&) const = default;
};

struct Calibration {
  CalibrationLayout layout = CalibrationLayout::records;
  std::vector<CalibrationRecord> cameras{};  // side by side in one image
  std::vector<StereoCalibrationRecord> stereo{};

  bool empty() const { return cameras.empty() && stereo.empty(); }
  bool operator==(const Calibration&) const = default;
};

// The layout is recognized by the bytes themselves. Throws Error if they fit none, or are not
// whole.
Calibration decode_calibration(std::string_view bytes);
// In layout `records`, of which decode_calibration keeps all that is stored.
std::string encode_calibration(const Calibration& calibration);

// The cameras of the stored images: P where it is stored, since images are rectified then, else K
// with D. Where the record holds no size, each camera has its share of an image of `image_width` x
// `image_height`. D of 6 terms is equidistant: k1 k2 0 0 k3 k4. Throws Error naming the field.
std::vector<Camera> cameras_of(const Calibration& calibration, int image_width, int image_height);
std::vector<StereoCamera> stereo_cameras_of(const Calibration& calibration, int image_width,
                                            int image_height);

// One record of layout `records`: K, D where it is distorted, L; and P = [K | 0] where it is not.
CalibrationRecord record_of(const Camera& camera);

}  // namespace libmap
