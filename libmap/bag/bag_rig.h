// The depth images of a robot's cameras out of a bag, as a rig and a folder of images (rig_io.h).
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
  // "TOPIC" or "NAME=TOPIC"; none: all topics that carry depth images, a compressed one only where
  // there is no raw one.
  std::vector<std::string> topics{};
  // Instead of camera infos and transforms. A topic belongs to the camera whose name it was given,
  // or which stands in it between slashes.
  std::optional<CameraRig> rig{};
  std::string base_frame = "auto";  // the robot's; auto: base_link, or what all else hangs on
  std::string transform_topic = "/tf_static";
  double depth_unit_m = 0.001;  // > 0; a unit of 16-bit images in the bag
  double depth_scale_m = 0.0;   // a unit of the images written; 0: the rig's, or as in the bag,
                                // 0.1 mm for 32FC1
  double near_m = 0.0;          // of the rig; 0 and infinity: the given rig's own
  double far_m = std::numeric_limits<double>::infinity();
  double tolerance_s = 0.02;  // images of one set lie so near to its stamp
  int every = 1;              // >= 1: the first of so many sets
};
void bind(ParameterTable& table, BagRigOptions& options);

// One of the bag's images that is wanted.
struct BagImage {
  std::size_t camera = 0;
  std::int64_t stamp_ns = 0;

  auto operator<=>(const BagImage&) const = default;
};

struct BagRigPlan {
  CameraRig rig{};
  std::vector<std::string> topics{};    // of each camera; empty: it has none
  std::vector<BagImage> images{};       // ascending; of the sets chosen
  std::vector<SynchronizedSet> sets{};  // their cameras' `image` means nothing
  std::size_t all_sets = 0;
  std::vector<std::string> warnings{};
  double depth_unit_m = 0.001;
  double tolerance_s = 0.02;
};

// What is to be taken: all synchronized sets, every N-th, or that nearest to `stamp_s`. An image's
// stamp is its header's, or when it was recorded if that is empty. Each image has the calibration
// of the camera info nearest to it in time; images whose calibration is another than their camera's
// first are left out, with a warning. Throws Error: no depth images, topics, infos, frames or
// transforms missing, a broken bag.
BagRigPlan plan_bag_rig(const std::filesystem::path& bag, const BagRigOptions& options,
                        const std::optional<double>& stamp_s = std::nullopt);

// One line a synchronized set: stamp_s, cameras, spread_s.
inline constexpr const char* synchronized_sets_file_name = "moments.csv";
// What export_bag_rig writes into its folder: rig.yaml, moments.csv and the cameras' folders.
std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan);

struct BagRigExport {
  std::size_t images = 0;
  std::vector<SynchronizedSet> sets{};  // the plan's, without the images that cannot be used
  std::size_t pixels_beyond = 0;  // whose depth 16 bits cannot hold at the camera's depth scale
  // Images that cannot be used, with the reason of the first of each camera.
  std::size_t broken = 0;
  std::vector<std::string> warnings{};
};

// Writes the plan's images, on all threads, into `folder`, which is there. Memory holds some dozen
// images. Throws Error: a broken bag, no image that can be used, a failed write.
BagRigExport export_bag_rig(const std::filesystem::path& bag, const BagRigPlan& plan,
                            const std::filesystem::path& folder);

}  // namespace libmap
