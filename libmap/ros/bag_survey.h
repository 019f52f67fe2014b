// What a bag says of its depth images before they are read: stamps, calibrations, frames. Inner
// part of bag_rig.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/ros/transform_tree.h"

namespace libmap {

struct SurveyedImages {
  std::string topic{};
  bool compressed = false;
  std::string encoding{};  // of the first message; empty if none could be read
  std::string frame{};     // of the first message
  std::vector<std::int64_t> stamps_ns{};
  bool unstamped = false;  // headers without a stamp: those of the recording are taken

  std::string info_topic{};
  std::vector<Camera> calibrations{};                         // different ones
  std::vector<std::pair<std::int64_t, std::size_t>> infos{};  // stamp and calibration, ascending
  std::string info_error{};  // why the first of those that cannot be used cannot

  // Index of the calibration that is nearest in time; of equally near ones the earlier.
  std::size_t calibration_at(std::int64_t stamp_ns) const;
};

struct BagSurvey {
  std::vector<SurveyedImages> images{};  // in the order of the topics
  TransformTree transforms{};
};

// "/camera/depth/image_raw" and "/camera/depth/image_raw/compressedDepth" -> "/camera/depth".
std::string namespace_of_image(const std::string& topic, bool compressed);

// Reads the bag once. `topics` are of images, each with whether it is compressed; no transforms are
// read if `transform_topic` is empty. Throws Error: a broken bag or message, transforms that
// change.
BagSurvey survey_bag(const std::filesystem::path& bag,
                     const std::vector<std::pair<std::string, bool>>& topics,
                     const std::string& transform_topic);

}  // namespace libmap
