#include "libmap/ros/bag_survey.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "libmap/core/error.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/ros/depth_message.h"
#include "libmap/ros/ros_messages.h"
#include "libmap/ros/transform_message.h"

namespace libmap {

namespace {

bool same_calibration(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion;
}

// Drivers of rectified images publish the calibration of the raw ones and say by P how they differ.
// The word stands in the image's name, "image_rect" or "image_rect_raw", before a transport's.
bool is_rectified(const std::string& topic) {
  const std::size_t name = topic.find("/image_rect");
  if (name == std::string::npos) return false;
  const char after = topic.c_str()[name + std::string_view("/image_rect").size()];
  return after == '\0' || after == '_' || after == '/';
}

void take_image(const BagMessage& message, SurveyedImages& images) {
  DepthMessageHead head;
  try {
    head = read_image_head(message.topic.encoding, message.bytes, images.compressed);
  } catch (const Error&) {
    return;  // It is found broken again, and named, where it is read.
  }
  if (images.encoding.empty()) {
    images.encoding = head.encoding;
    images.frame = head.frame;
  }
  images.unstamped = images.unstamped || head.stamp_ns == 0;
  images.stamps_ns.push_back(head.stamp_ns == 0 ? message.recorded_ns : head.stamp_ns);
}

void take_info(const BagMessage& message, SurveyedImages& images) {
  try {
    const CameraInfoMessage info =
        decode_camera_info(message.topic.encoding, message.bytes, is_rectified(images.topic));
    const auto found =
        std::find_if(images.calibrations.begin(), images.calibrations.end(),
                     [&](const Camera& known) { return same_calibration(known, info.camera); });
    const auto index = static_cast<std::size_t>(found - images.calibrations.begin());
    if (found == images.calibrations.end()) images.calibrations.push_back(info.camera);
    images.infos.emplace_back(info.stamp_ns == 0 ? message.recorded_ns : info.stamp_ns, index);
  } catch (const Error& error) {
    if (images.info_error.empty()) images.info_error = error.what();
  }
}

void take_transforms(const BagMessage& message, TransformTree& tree) {
  try {
    add_transforms(message.topic.encoding, message.bytes, tree);
  } catch (const Error& error) {
    throw error.in_field(message.topic.name);
  }
}

}  // namespace

std::size_t SurveyedImages::calibration_at(std::int64_t stamp_ns) const {
  const auto after =
      std::lower_bound(infos.begin(), infos.end(), stamp_ns,
                       [](const auto& info, std::int64_t value) { return info.first < value; });
  if (after == infos.begin()) return after->second;
  const auto before = after - 1;
  if (after == infos.end()) return before->second;
  return after->first - stamp_ns < stamp_ns - before->first ? after->second : before->second;
}

std::string namespace_of_image(const std::string& topic, bool compressed) {
  std::string name = topic;
  for (int parts = compressed ? 2 : 1; parts > 0; --parts) {
    const std::size_t slash = name.rfind('/');
    name = slash == std::string::npos ? std::string() : name.substr(0, slash);
  }
  return name;
}

BagSurvey survey_bag(const std::filesystem::path& bag,
                     const std::vector<std::pair<std::string, bool>>& topics,
                     const std::string& transform_topic) {
  constexpr std::size_t head_bytes = 1024;
  BagSurvey survey;
  std::vector<BagRequest> requests;
  for (const auto& [topic, compressed] : topics) {
    survey.images.push_back({.topic = topic, .compressed = compressed});
    survey.images.back().info_topic = namespace_of_image(topic, compressed) + "/camera_info";
    requests.push_back({topic, head_bytes});
    requests.push_back({survey.images.back().info_topic});
  }
  if (!transform_topic.empty()) requests.push_back({transform_topic});
  read_bag(bag, requests, [&](const BagMessage& message) {
    const std::string& topic = message.topic.name;
    if (!transform_topic.empty() && topic == transform_topic &&
        message.topic.has_definition_of(ros_message::TFMessage::type))
      take_transforms(message, survey.transforms);
    for (SurveyedImages& images : survey.images) {
      if (topic == images.topic) take_image(message, images);
      if (topic == images.info_topic &&
          message.topic.has_definition_of(ros_message::CameraInfo::type))
        take_info(message, images);
    }
  });
  for (SurveyedImages& images : survey.images) std::sort(images.infos.begin(), images.infos.end());
  return survey;
}

}  // namespace libmap
