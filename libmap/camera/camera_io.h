// Camera calibrations as YAML, in the layout that OpenCV's FileStorage, RTAB-Map and ROS share:
//
//   %YAML:1.0
//   ---
//   camera_name: infrared
//   image_width: 512
//   image_height: 424
//   camera_matrix: !!opencv-matrix
//     rows: 3
//     cols: 3
//     dt: d
//     data: [365, 0, 256, 0, 365, 212, 0, 0, 1]
//   distortion_model: plumb_bob
//   distortion_coefficients: !!opencv-matrix
//     {rows: 1, cols: 5, dt: d, data: [...]}
//   local_transform: !!opencv-matrix          # base_from_camera, 3 x 4; may be missing
//     {rows: 3, cols: 4, dt: d, data: [...]}
//   depth_correction: !!opencv-matrix         # DepthCorrection: spline_m; may be missing
//     {rows: 1, cols: 14, dt: d, data: [...]}
//   depth_correction_range: !!opencv-matrix   # first_m, step_m
//     {rows: 1, cols: 2, dt: d, data: [0.6, 0.2]}
//   depth_correction_radial: !!opencv-matrix  # radial
//     {rows: 1, cols: 3, dt: d, data: [...]}
//   depth_scale: 1.008                        # scale; may be missing
//   camera_timing: [0.01, 0.02]               # depth_delay_s, rolling_shutter_s; may be missing
//   frame_motions: !!opencv-matrix            # FrameMotion of each frame; may be missing
//     {rows: 60, cols: 7, dt: d, data: [...]}
//   findings: ["depth bends by ..."]          # CameraFile; may be missing
//
// distortion_model  plumb_bob: k1 k2 p1 p2 [k3]; rational_polynomial: 8 or 12 terms in OpenCV's
// order; equidistant or fisheye: k1 k2 k3 k4, or RTAB-Map's k1 k2 0 0 k3 k4. Without it the number
// of terms decides, and `fisheye_model: 1` of OpenCV's own calibration sample. A camera whose terms
// are all zero is read as undistorted. Keys of other meaning are passed over, as these files carry
// many (projection_matrix, avg_reprojection_error, ...).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/camera/depth_correction.h"
#include "libmap/core/camera.h"

namespace YAML {
class Node;
}

namespace libmap {

// How the base moves when a frame is taken, in its own frame.
struct FrameMotion {
  double stamp_s = 0.0;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // m/s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // rad/s
};

struct CameraFile {
  std::string name{};  // may be empty
  Camera camera{};
  // Of depth that is registered to the camera's pictures: where it was taken from, if not from the
  // camera's own place (depth_registration, 3 x 4; may be missing), and what is added to it.
  Pose color_from_depth = Pose::Identity();
  DepthCorrection depth{};
  // Depth is taken this much after the middle row of the picture, beyond what their stamps say, and
  // the picture's rows one after the other in this time. The motions are those of the scan that
  // they were estimated from.
  double depth_delay_s = 0.0;
  double rolling_shutter_s = 0.0;
  std::vector<FrameMotion> motions{};   // by ascending stamp
  std::vector<std::string> findings{};  // what the estimation found, a sentence each

  // Of the frame of this stamp; the base does not move in frames that `motions` does not list.
  // `depth_later_s` as in RgbdFrame.
  Pose color_from_depth_at(double stamp_s, double depth_later_s = 0.0) const;
  bool changes_depth() const {
    return !depth.empty() || !color_from_depth.matrix().isIdentity(0.0) ||
           (depth_delay_s != 0.0 && !motions.empty());
  }
};

// Throws Error naming `file`, the key, its value and its bound: no YAML, a key that is missing, a
// matrix of another size, skew, a transform that is no rotation, terms that are no known model's.
CameraFile parse_camera(const std::string& text, const std::string& file);
CameraFile read_camera(const std::filesystem::path& path);
CameraFile camera_from_yaml(const YAML::Node& root);
// Of a matrix of 3 x 4 or 4 x 4.
Pose pose_from_yaml(const YAML::Node& matrix, const std::string& field);

// Text that parse_camera reads back as the same numbers, and cv::FileStorage and RTAB-Map as well.
// `comment` stands at its head, line by line.
std::string to_yaml(const CameraFile& camera, const std::string& comment = {});

}  // namespace libmap
