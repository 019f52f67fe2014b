// Several depth cameras on one robot, as YAML (rig_images.h: where their images lie):
//
//   depth_scale_m: 0.001       # meters a unit of the depth images
//   near_m: 0.28               # measurements outside near..far are dropped
//   far_m: 1.5                 # .inf: no limit
//   cameras:
//     - name: front
//       image_width: 640       # intrinsics and distortion as in camera_io.h ...
//       image_height: 360
//       camera_matrix: [337.2, 0, 319.5, 0, 337.2, 179.5, 0, 0, 1]
//       robot_from_camera: [0, 0, 1, 0.2, -1, 0, 0, 0, 0, -1, 0, 0.1]   # 3 x 4, row by row
//     - name: left
//       calibration: left.yaml            # ... or a file, relative to this one
//       position_m: [0.1, 0.17, 0.1]      # robot_from_camera by the camera's housing: x forward,
//       roll_pitch_yaw_deg: [0, 0, 60]    # z up (REP-103), not by its optical frame
//       far_m: 2.0                        # overrides the rig's; so do depth_scale_m and near_m
//
// robot_from_camera is that of the optical frame (z forward). A camera without any of these has the
// local_transform of its calibration.
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "libmap/core/camera.h"

namespace libmap {

struct RigCamera {
  std::string name{};            // names its folder: no '/', unique in the rig
  Camera camera{};               // base_from_camera is robot_from_camera
  double depth_scale_m = 0.001;  // > 0
  double near_m = 0.0;           // >= 0
  double far_m = std::numeric_limits<double>::infinity();  // > near_m
};

struct CameraRig {
  std::vector<RigCamera> cameras{};

  // Throws Error naming the camera, the field, its value and its bound.
  void check() const;
};

inline constexpr const char* rig_file_name = "rig.yaml";

// Throws Error naming `file`, the camera and the key; for unknown keys the nearest known one.
// Calibration files are looked for beside `file`.
CameraRig parse_rig(const std::string& text, const std::string& file);
CameraRig read_rig(const std::filesystem::path& path);

// Text that parse_rig reads back as the same numbers, with every camera's intrinsics in it.
std::string to_yaml(const CameraRig& rig);

}  // namespace libmap
