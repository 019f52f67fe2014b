// Several depth cameras on one robot, as YAML:
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
//
// The folder of their images, and which of them belong together:
//
//   FOLDER/rig.yaml            or given apart
//   FOLDER/NAME/STAMP.png      16-bit gray, one folder per camera; STAMP in seconds, e.g. 12.340000
//   FOLDER/images.csv          instead of names that are stamps: columns camera, stamp_s, file
//                              (relative to FOLDER); where it exists, it alone counts
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"

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

inline constexpr const char* rig_images_file_name = "images.csv";

// One depth image of a rig's camera, not read yet.
struct RigImage {
  std::size_t camera = 0;  // index in the rig
  double stamp_s = 0.0;
  std::filesystem::path file{};
};

// "NAME/STAMP.png" with six decimals, as list_rig_images finds it in a folder.
std::string rig_image_name(const std::string& camera, double stamp_s);

// The images of the rig's cameras that lie in `folder`, by camera, then stamp, then file. A camera
// without a folder or a row has none. Throws Error: no such folder, no image at all, a PNG whose
// name is no stamp, a row of images.csv with an unknown camera.
std::vector<RigImage> list_rig_images(const std::filesystem::path& folder, const CameraRig& rig);

// The file as it is: units of the camera's depth scale. Throws Error naming the file: not a 16-bit
// gray PNG, or of another size than the camera's calibration.
Image<std::uint16_t> read_rig_units(const RigImage& image, const RigCamera& camera);

// Its depth: units of the file times the camera's depth scale; 0 and 65535, where the sensor was
// saturated, are 0. Throws as read_rig_units.
DepthImage read_rig_depth(const RigImage& image, const RigCamera& camera);

// What each camera saw at one time.
struct SynchronizedSet {
  double stamp_s = 0.0;
  struct Camera {
    enum class State { seen, late, missing };  // of its image in this set
    State state = State::missing;  // late: the nearest image is outside the tolerance; missing: the
                                   // camera has no image at all
    std::size_t image = 0;         // index of its image nearest to stamp_s, unless missing
    double offset_s = 0.0;         // that image's stamp minus stamp_s
  };
  std::vector<Camera> cameras{};  // one for each of the rig

  std::size_t seen() const;  // how many cameras have an image of this set
};

// What the cameras saw at `stamp_s`: of each camera the image nearest in time, the earlier of two
// equally near ones, if it lies within `tolerance_s` >= 0.
SynchronizedSet synchronized_set_at(const std::vector<RigImage>& images, std::size_t camera_count,
                                    double stamp_s, double tolerance_s);

// The image's stamp at which most cameras saw something; of several, the one with the smallest sum
// of offsets, then the earliest. `images` may not be empty.
SynchronizedSet fullest_synchronized_set(const std::vector<RigImage>& images,
                                         std::size_t camera_count, double tolerance_s);

// All synchronized sets of a recording, ascending; each image is in one of them. The earliest image
// that is in none yet begins one; its stamp is that of an image at most `tolerance_s` later at
// which most cameras saw something (of several the one with the smallest sum of offsets, then the
// earliest), counting images that are in no set yet. A camera without an image in a set is
// `missing`.
std::vector<SynchronizedSet> synchronized_sets(const std::vector<RigImage>& images,
                                               std::size_t camera_count, double tolerance_s);

}  // namespace libmap
