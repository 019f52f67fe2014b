// Reads and writes camera calibrations as YAML in the layout of OpenCV's FileStorage, RTAB-Map and
// ROS:
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
//   local_transform: !!opencv-matrix          # base_from_camera, 3 x 4; optional, as all below
//     {rows: 3, cols: 4, dt: d, data: [...]}
//   depth_correction: !!opencv-matrix         # spline_m (DepthCorrection in depth_correction.h)
//     {rows: 1, cols: 14, dt: d, data: [...]}
//   depth_correction_range: !!opencv-matrix   # first_m, step_m of DepthCorrection
//     {rows: 1, cols: 2, dt: d, data: [0.6, 0.2]}
//   depth_correction_radial: !!opencv-matrix  # radial of DepthCorrection
//     {rows: 1, cols: 3, dt: d, data: [...]}
//   depth_scale: 1.008                        # scale of DepthCorrection
//   depth_registration: [1, 0, 0, 0.05, ...]  # color_from_depth, 3 x 4
//   camera_timing: [0.01, 0.02]               # depth_delay_s, rolling_shutter_s of CameraFile
//   frame_motions: !!opencv-matrix            # a row per frame: stamp, velocity, turn rate
//     {rows: 60, cols: 7, dt: d, data: [...]}
//   findings: ["depth bends by ..."]          # sentences on the results of the calibration
//
// Values of distortion_model: plumb_bob (k1 k2 p1 p2 [k3]), rational_polynomial (8 or 12 terms in
// OpenCV's order), equidistant or fisheye (k1 k2 k3 k4, or RTAB-Map's k1 k2 0 0 k3 k4). Without
// this key, `fisheye_model: 1` of OpenCV's calibration sample means equidistant; else the number of
// terms determines the model. If all terms are 0 and the model is not a fisheye, the camera is
// undistorted. Other keys, such as projection_matrix, are ignored.
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

// Velocity of the base at the time of a frame, in the base frame.
struct FrameMotion {
  double stamp_s = 0.0;                                 // RgbdFrame::stamp_s of the frame
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // linear velocity, m/s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // angular velocity, rad/s
};

struct CameraFile {
  std::string name{};  // free text; may be empty
  Camera camera{};
  // Pose of the depth camera and correction of depth, for depth that is registered to `camera`.
  Pose color_from_depth = Pose::Identity();
  DepthCorrection depth{};
  // Delay of depth after the middle row of color, in addition to the difference of the stamps.
  double depth_delay_s = 0.0;
  double rolling_shutter_s = 0.0;       // time from the first to the last row of the color image
  std::vector<FrameMotion> motions{};   // frames from which the delay was estimated, by stamp
  std::vector<std::string> findings{};  // results of the calibration, one sentence each

  // Pose of the depth camera for the frame with this stamp, including the motion during the delay;
  // color_from_depth if `motions` has no such stamp. `depth_stamp_offset_s` as in RgbdFrame.
  Pose color_from_depth_at(double stamp_s, double depth_stamp_offset_s = 0.0) const;
  // True if the calibration can change the depth of a frame.
  bool changes_depth() const {
    return !depth.empty() || !color_from_depth.matrix().isIdentity(0.0) ||
           (depth_delay_s != 0.0 && !motions.empty());
  }
};

// Read a camera. Throw Error naming `file`, key, value and bound for invalid YAML, a missing key, a
// matrix of wrong size, a camera matrix with skew, a transform without a valid rotation, or an
// unknown distortion model. camera_from_yaml reads a parsed document and does not name the file.
CameraFile parse_camera(const std::string& text, const std::string& file);
CameraFile read_camera(const std::filesystem::path& path);
CameraFile camera_from_yaml(const YAML::Node& root);
// Reads a pose from a matrix of 3 x 4 or 4 x 4. Throws Error naming `field` if it is not a pose.
Pose pose_from_yaml(const YAML::Node& matrix, const std::string& field);

// Returns YAML that parse_camera reads back exactly, and that cv::FileStorage and RTAB-Map can
// read. The text begins with the lines of `comment`, each after "# ".
std::string to_yaml(const CameraFile& camera, const std::string& comment = {});

}  // namespace libmap
