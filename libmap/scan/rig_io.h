// Reads and writes rigs (several depth cameras on one robot), reads their images, and finds sets of
// synchronized images. A rig is a YAML file:
//
//   depth_scale_m: 0.001       # meters per unit of the depth images
//   near_m: 0.28               # measurements outside near..far are dropped
//   far_m: 1.5                 # .inf: no limit
//   cameras:
//     - name: front
//       image_width: 640       # intrinsics and distortion as in camera_io.h ...
//       image_height: 360
//       camera_matrix: [337.2, 0, 319.5, 0, 337.2, 179.5, 0, 0, 1]
//       robot_from_camera: [0, 0, 1, 0.2, -1, 0, 0, 0, 0, -1, 0, 0.1]   # 3 x 4, row by row
//     - name: left
//       calibration: left.yaml            # ... or a camera file, relative to this file
//       position_m: [0.1, 0.17, 0.1]      # instead of robot_from_camera: pose of the camera's body
//       roll_pitch_yaw_deg: [0, 0, 60]    # frame (x forward, z up); angles about fixed axes
//       far_m: 2.0                        # replaces the rig's far_m (also depth_scale_m, near_m)
//
// robot_from_camera is the pose of the optical frame (z forward). A camera without a pose in this
// file has the local_transform of the camera file.
//
// The images are in a folder:
//
//   FOLDER/rig.yaml            the rig; may also be elsewhere
//   FOLDER/NAME/STAMP.png      16-bit gray, one folder per camera; STAMP in seconds, e.g. 12.340000
//   FOLDER/images.csv          replaces the stamps in the file names: columns camera, stamp_s, file
//                              (relative to FOLDER)
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
  std::string name{};                                      // name of a folder, unique in the rig
  Camera camera{};                                         // base_from_camera: robot_from_camera
  double depth_scale_m = 0.001;                            // > 0: meters per unit of the images
  double near_m = 0.0;                                     // >= 0: minimum valid depth
  double far_m = std::numeric_limits<double>::infinity();  // > near_m: maximum valid depth
};

struct CameraRig {
  std::vector<RigCamera> cameras{};

  // Throws Error naming camera, field, value and bound if a value is invalid.
  void check() const;
};

inline constexpr const char* rig_file_name = "rig.yaml";

// Parse or read a rig, and check it. Camera files are relative to the folder of the rig's file.
// Throw Error naming file, camera and key; for an unknown key, also the nearest known key.
CameraRig parse_rig(const std::string& text, const std::string& file);
CameraRig read_rig(const std::filesystem::path& path);

// Returns text that parse_rig reads as the same rig, including the intrinsics of all cameras.
std::string to_yaml(const CameraRig& rig);

inline constexpr const char* rig_images_file_name = "images.csv";

// File of a depth image of a rig's camera.
struct RigImage {
  std::size_t camera = 0;  // index in CameraRig::cameras
  double stamp_s = 0.0;
  std::filesystem::path file{};  // path of the PNG
};

// Returns "NAME/STAMP.png" with six decimals, the file name that list_rig_images expects.
std::string rig_image_name(const std::string& camera, double stamp_s);

// Lists the images of the rig's cameras in `folder` by camera, then stamp, then file. A camera may
// have no images. Throws Error if the folder is missing, no camera has an image, the name of a PNG
// is not a stamp, or images.csv is invalid.
std::vector<RigImage> list_rig_images(const std::filesystem::path& folder, const CameraRig& rig);

// Reads an image in units of the camera's depth_scale_m. Throws Error naming the file if it is not
// a 16-bit gray PNG or has another size than the camera's calibration.
Image<std::uint16_t> read_rig_units(const RigImage& image, const RigCamera& camera);

// Reads an image in meters; 0 where the stored value is 0 or 65535 (saturated). Does not apply
// near_m and far_m. Throws as read_rig_units does.
DepthImage read_rig_depth(const RigImage& image, const RigCamera& camera);

// Images of a rig at one time, at most one per camera.
struct SynchronizedSet {
  double stamp_s = 0.0;
  struct Camera {
    // seen: the set has an image of the camera. late: the nearest image, earlier or later, is not
    // within the tolerance (not in results of synchronized_sets). missing: no image is available.
    enum class State { seen, late, missing };
    State state = State::missing;
    std::size_t image = 0;  // index of the image nearest to the set's stamp, unless missing
    double offset_s = 0.0;  // stamp of the image minus stamp of the set
  };
  std::vector<Camera> cameras{};  // one per camera of the rig

  std::size_t seen() const;  // number of cameras with an image in this set
};

// Returns the set at `stamp_s`: each camera's image nearest in time (the earlier one of equal
// distances), if it is within `tolerance_s` >= 0.
SynchronizedSet synchronized_set_at(const std::vector<RigImage>& images, std::size_t camera_count,
                                    double stamp_s, double tolerance_s);

// Returns the set with the most cameras among the sets at all images' stamps; ties are resolved by
// the smallest sum of absolute offsets, then the earliest stamp. Throws Error if `images` is empty.
SynchronizedSet fullest_synchronized_set(const std::vector<RigImage>& images,
                                         std::size_t camera_count, double tolerance_s);

// Splits a recording into sets, ascending by stamp; each image is in exactly one set. Each set
// contains the earliest remaining image. Its stamp is that of a remaining image, at most
// `tolerance_s` later: the stamp whose set has the most cameras; ties are resolved as in
// fullest_synchronized_set.
std::vector<SynchronizedSet> synchronized_sets(const std::vector<RigImage>& images,
                                               std::size_t camera_count, double tolerance_s);

}  // namespace libmap
