// Exports depth images of a robot's cameras from a ROS bag to a rig with images (rig_io.h).
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
  // "TOPIC" or "NAME=TOPIC"; empty: all topics of depth images, raw ones rather than compressed.
  std::vector<std::string> topics{};
  // Replaces the bag's camera infos and transforms. A topic belongs to the camera NAME of
  // "NAME=TOPIC"; without NAME, to the camera whose name is a part of the topic between slashes.
  std::optional<CameraRig> rig{};
  std::string base_frame = "auto";  // robot frame; auto: base_link, or the root of all transforms
  std::string transform_topic = "/tf_static";
  double depth_unit_m = 0.001;  // > 0, meters per unit of 16-bit images in the bag
  // Meters per unit of the written images; 0: as in `rig`; without `rig`, depth_unit_m, or 0.1 mm
  // for images in 32FC1.
  double depth_scale_m = 0.0;
  double near_m = 0.0;  // depth range of the written rig; 0 and infinity: as in `rig`, if given
  double far_m = std::numeric_limits<double>::infinity();
  double tolerance_s = 0.02;  // >= 0, maximum time between an image and the stamp of its set
  int every = 1;              // >= 1; only every N-th set is exported
};
void bind(ParameterTable& table, BagRigOptions& options);

// An image of the bag to export.
struct BagImage {
  std::size_t camera = 0;  // index in the rig
  std::int64_t stamp_ns = 0;

  auto operator<=>(const BagImage&) const = default;
};

struct BagRigPlan {
  CameraRig rig{};
  std::vector<std::string> topics{};    // topic of each camera; empty: none
  std::vector<BagImage> images{};       // images of the selected sets, ascending
  std::vector<SynchronizedSet> sets{};  // selected sets; Camera::image is no index of `images`
  std::size_t sets_in_bag = 0;          // number of synchronized sets, selected or not
  std::vector<std::string> warnings{};
  double depth_unit_m = 0.001;  // as in BagRigOptions
  double tolerance_s = 0.02;    // as in BagRigOptions
};

// Selects the images of all synchronized sets, of every N-th one, or of the one nearest to
// `stamp_s`. The stamp of an image is in the header, or is the time of recording if the header has
// none. Each image has the calibration of the camera info nearest in time. Images with a
// calibration other than that of the camera's first image are dropped with a warning. Throws Error
// for a damaged bag, no depth images, or missing topics, infos, frames or transforms.
BagRigPlan plan_bag_rig(const std::filesystem::path& bag, const BagRigOptions& options,
                        const std::optional<double>& stamp_s = std::nullopt);

// Table with one line per synchronized set: stamp_s, cameras (number), spread_s (first to last).
inline constexpr const char* synchronized_sets_file_name = "synchronized_sets.csv";
// Names of the entries that export_bag_rig writes: rig.yaml, synchronized_sets.csv, camera folders.
std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan);

struct BagRigExport {
  std::size_t images = 0;               // number of written images
  std::vector<SynchronizedSet> sets{};  // synchronized sets of the written images
  // Number of pixels that are written as 0 because their depth exceeds 16 bits in depth_scale_m.
  std::size_t overflow_pixels = 0;
  std::size_t undecodable_images = 0;   // number of unusable images
  std::vector<std::string> warnings{};  // reason for the first unusable image of each camera
};

// Writes the plan's images on all threads into `folder`, which must exist; decodes them only if
// `folder` is empty. Needs memory for a few dozen images. Throws Error for a damaged bag, no usable
// image, or a failed write.
BagRigExport export_bag_rig(const std::filesystem::path& bag, const BagRigPlan& plan,
                            const std::filesystem::path& folder);

}  // namespace libmap
