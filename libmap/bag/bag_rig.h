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
  // "TOPIC" or "NAME=TOPIC"; empty: all topics of depth images, compressed ones only if there is no
  // raw one.
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
  double near_m = 0.0;  // depth range of the written rig; 0 and infinity: as in `rig`
  double far_m = std::numeric_limits<double>::infinity();
  double tolerance_s = 0.02;  // maximum time between an image and the stamp of the set
  int every = 1;              // >= 1; only every N-th set is exported
};
void bind(ParameterTable& table, BagRigOptions& options);

// An image of the bag to export.
struct BagImage {
  std::size_t camera = 0;
  std::int64_t stamp_ns = 0;

  auto operator<=>(const BagImage&) const = default;
};

struct BagRigPlan {
  CameraRig rig{};
  std::vector<std::string> topics{};    // topic of each camera; empty: none
  std::vector<BagImage> images{};       // images of the selected sets, ascending
  std::vector<SynchronizedSet> sets{};  // selected sets; Camera::image is not set
  std::size_t sets_in_bag = 0;
  std::vector<std::string> warnings{};
  double depth_unit_m = 0.001;
  double tolerance_s = 0.02;
};

// Selects the images: all synchronized sets, every N-th one, or the one nearest to `stamp_s`. The
// stamp of an image is in the header, or is the time of recording if the header has none. Each
// image has the calibration of the camera info nearest in time. Images with a calibration other
// than the first of the camera are dropped with a warning. Throws Error for a damaged bag, no depth
// images, or missing topics, infos, frames or transforms.
BagRigPlan plan_bag_rig(const std::filesystem::path& bag, const BagRigOptions& options,
                        const std::optional<double>& stamp_s = std::nullopt);

// Table with one line per synchronized set: stamp_s, cameras, spread_s.
inline constexpr const char* synchronized_sets_file_name = "synchronized_sets.csv";
// Names of the entries that export_bag_rig writes: rig.yaml, synchronized_sets.csv and the cameras'
// folders.
std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan);

struct BagRigExport {
  std::size_t images = 0;
  std::vector<SynchronizedSet> sets{};  // synchronized sets of the written images
  // Pixels with a depth beyond 16 bits at the camera's depth scale.
  std::size_t overflow_pixels = 0;
  // Number of unusable images, and the reason for the first one of each camera.
  std::size_t undecodable_images = 0;
  std::vector<std::string> warnings{};
};

// Writes the plan's images on all threads into `folder`, which must exist. Needs memory for a few
// dozen images. Throws Error for a damaged bag, no usable image, or a failed write.
BagRigExport export_bag_rig(const std::filesystem::path& bag, const BagRigPlan& plan,
                            const std::filesystem::path& folder);

}  // namespace libmap
