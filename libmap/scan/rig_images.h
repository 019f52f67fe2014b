// The folder in which the images of a camera rig lie, and which of them belong together:
//
//   FOLDER/rig.yaml            rig_io.h; or given apart
//   FOLDER/NAME/STAMP.png      16-bit gray, one folder per camera; STAMP in seconds, e.g. 12.340000
//   FOLDER/images.csv          instead of names that are stamps: columns camera, stamp_s, file
//                              (relative to FOLDER); where it stands, it alone counts
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/scan/rig_io.h"

namespace libmap {

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
