// Exports the depth images of a robot's cameras from a ROS bag to a folder that rig_io.h reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/scan/rig_io.h"

namespace libmap {

struct BagRigOptions {
  // "TOPIC" or "NAME=TOPIC"; empty: all topics of depth images (raw ones rather than compressed).
  std::vector<std::string> topics{};
  // If set, replaces the bag's camera infos and transforms. A topic belongs to the camera NAME of
  // "NAME=TOPIC"; without NAME, to the camera whose name is a part of the topic between slashes.
  std::optional<CameraRig> rig{};
  std::string base_frame = "auto";  // robot frame; auto: base_link, else the root of all transforms
  std::string transform_topic = "/tf_static";  // topic of the static transforms
  double depth_unit_m = 0.001;                 // > 0: meters per unit of 16-bit images in the bag
  // Meters per unit of the written images; 0: as in `rig`. 0 without `rig`: depth_unit_m for 16-bit
  // images, 0.1 mm for 32FC1 images.
  double depth_scale_m = 0.0;
  double near_m = 0.0;  // minimum valid depth of the written rig; 0: as in `rig`, if given
  double far_m = std::numeric_limits<double>::infinity();  // maximum; infinity: as in `rig`
  double tolerance_s = 0.02;  // >= 0: maximum time from an image to its synchronized set's stamp
  int every = 1;  // >= 1: step between exported sets of synchronized images; 1: all are exported
};
void bind(ParameterTable& table, BagRigOptions& options);

// An image of the bag that is exported.
struct BagImage {
  std::size_t camera = 0;     // index in BagRigPlan::rig
  std::int64_t stamp_ns = 0;  // stamp of the header, else recording time

  auto operator<=>(const BagImage&) const = default;
};

struct BagRigPlan {
  CameraRig rig{};                    // rig to write
  std::vector<std::string> topics{};  // topic of each camera of the rig; empty: no images
  std::vector<BagImage> images{};     // images of the selected sets, ascending by camera and stamp
  // Selected synchronized sets (rig_io.h); SynchronizedSet::Camera::image has no meaning here.
  std::vector<SynchronizedSet> sets{};
  std::size_t sets_in_bag = 0;          // number of synchronized sets, selected or not
  std::vector<std::string> warnings{};  // dropped images and missing stamps, by topic
  double depth_unit_m = 0.001;          // as in BagRigOptions
  double tolerance_s = 0.02;            // as in BagRigOptions
};

// Selects the images of the synchronized sets: of every N-th set (BagRigOptions::every) or, if
// `stamp_s` is given, of the set nearest to this time. The stamp of an image is the stamp of the
// header, or the recording time if the header has none. Without `rig`, an image belongs to the
// camera info nearest in time; images whose calibration differs from the camera's first one are
// dropped with a warning. Throws Error for a damaged bag, no depth images, or missing topics,
// camera infos, frames or transforms.
BagRigPlan plan_bag_rig(const std::filesystem::path& bag, const BagRigOptions& options,
                        const std::optional<double>& stamp_s = std::nullopt);

// CSV file with one row per synchronized set: stamp_s, cameras (number), spread_s (last - first).
inline constexpr const char* synchronized_sets_file_name = "synchronized_sets.csv";
// Names of the entries that export_bag_rig writes: rig.yaml, synchronized_sets.csv, camera folders.
std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan);

struct BagRigExport {
  std::size_t images = 0;  // number of written images
  // Synchronized sets of the written images; SynchronizedSet::Camera::image has no meaning here.
  std::vector<SynchronizedSet> sets{};
  // Number of pixels written as 0 because their depth exceeds 65534 units of the written images.
  std::size_t overflow_pixels = 0;
  std::size_t undecodable_images = 0;   // unusable images: damaged, or not of the calibrated size
  std::vector<std::string> warnings{};  // reason for the first unusable image of each camera
};

// Writes the plan's images to `folder`, which must exist; only decodes them if `folder` is empty.
// Uses all threads, and memory for a few dozen images. Throws Error for a damaged bag, no usable
// image, or a failed write.
BagRigExport export_bag_rig(const std::filesystem::path& bag, const BagRigPlan& plan,
                            const std::filesystem::path& folder);

}  // namespace libmap
