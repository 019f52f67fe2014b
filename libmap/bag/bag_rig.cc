#include "libmap/bag/bag_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/depth_message.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/bag/transform_tree.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

// Metadata of a topic of depth images: stamps, calibrations, frames.
struct ImageTopic {
  std::string topic{};
  bool compressed = false;
  std::string encoding{};  // encoding of the first message; empty if none could be read
  std::string frame{};     // frame of the first message
  std::vector<std::int64_t> stamps_ns{};
  bool unstamped = false;  // true if headers have no stamp and recording times replace it

  std::string info_topic{};
  std::vector<Camera> calibrations{};                         // without duplicates
  std::vector<std::pair<std::int64_t, std::size_t>> infos{};  // stamp and calibration, ascending
  std::string info_error{};  // reason for the first unusable camera info

  // Returns the index of the calibration nearest in time, the earlier one for equal distances.
  std::size_t calibration_at(std::int64_t stamp_ns) const {
    const auto after =
        std::lower_bound(infos.begin(), infos.end(), stamp_ns,
                         [](const auto& info, std::int64_t value) { return info.first < value; });
    if (after == infos.begin()) return after->second;
    const auto before = after - 1;
    if (after == infos.end()) return before->second;
    return after->first - stamp_ns < stamp_ns - before->first ? after->second : before->second;
  }
};

struct BagTopics {
  std::vector<ImageTopic> images{};  // in the order of the topics
  TransformTree transforms{};
};

bool same_calibration(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion;
}

// True for topics of rectified images, "image_rect" or "image_rect_raw", with or without a
// transport. Their drivers publish the calibration of the raw images, and P for the rectified ones.
bool is_rectified(const std::string& topic) {
  const std::size_t name = topic.find("/image_rect");
  if (name == std::string::npos) return false;
  const char after = topic.c_str()[name + std::string_view("/image_rect").size()];
  return after == '\0' || after == '_' || after == '/';
}

void take_image(const BagMessage& message, ImageTopic& images) {
  DepthMessageHead head;
  try {
    head = read_image_head(message.topic.encoding, message.bytes, images.compressed);
  } catch (const Error&) {
    return;  // the error is reported when the image is decoded
  }
  if (images.encoding.empty()) {
    images.encoding = head.encoding;
    images.frame = head.frame;
  }
  images.unstamped = images.unstamped || head.stamp_ns == 0;
  images.stamps_ns.push_back(head.stamp_ns == 0 ? message.recorded_ns : head.stamp_ns);
}

void take_info(const BagMessage& message, ImageTopic& images) {
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
  in_field(message.topic.name,
           [&] { add_transforms(message.topic.encoding, message.bytes, tree); });
}

// "/camera/depth/image_raw" and "/camera/depth/image_raw/compressedDepth" -> "/camera/depth".
std::string namespace_of_image(const std::string& topic, bool compressed) {
  std::string name = topic;
  for (int parts = compressed ? 2 : 1; parts > 0; --parts) {
    const std::size_t slash = name.rfind('/');
    name = slash == std::string::npos ? std::string() : name.substr(0, slash);
  }
  return name;
}

// Reads the bag once. `topics` contains topics of images, each with true if it is compressed; no
// transforms are read if `transform_topic` is empty. Throws Error for a damaged bag or message, or
// transforms that change.
BagTopics read_bag_topics(const std::filesystem::path& bag,
                          const std::vector<std::pair<std::string, bool>>& topics,
                          const std::string& transform_topic) {
  constexpr std::size_t head_bytes = 1024;
  BagTopics bag_topics;
  std::vector<BagRequest> requests;
  for (const auto& [topic, compressed] : topics) {
    bag_topics.images.push_back({.topic = topic, .compressed = compressed});
    bag_topics.images.back().info_topic = namespace_of_image(topic, compressed) + "/camera_info";
    requests.push_back({topic, head_bytes});
    requests.push_back({bag_topics.images.back().info_topic});
  }
  if (!transform_topic.empty()) requests.push_back({transform_topic});
  read_bag(bag, requests, [&](const BagMessage& message) {
    const std::string& topic = message.topic.name;
    if (!transform_topic.empty() && topic == transform_topic &&
        message.topic.has_definition_of(ros_message::TFMessage::type))
      take_transforms(message, bag_topics.transforms);
    for (ImageTopic& images : bag_topics.images) {
      if (topic == images.topic) take_image(message, images);
      if (topic == images.info_topic &&
          message.topic.has_definition_of(ros_message::CameraInfo::type))
        take_info(message, images);
    }
  });
  for (ImageTopic& images : bag_topics.images) std::sort(images.infos.begin(), images.infos.end());
  return bag_topics;
}

constexpr double float_unit_m = 1e-4;  // unit of images of 32FC1: up to 6.5 m
constexpr const char* depth_encodings = "16UC1, mono16, 32FC1 or compressedDepth";

// A topic given by the user, or a candidate for depth images, with its given name, if any.
struct Choice {
  std::string name{};
  std::string topic{};
  bool compressed = false;
};

bool is_compressed_type(const BagTopic& topic) {
  return topic.is(ros_message::CompressedImage::type);
}

Choice chosen(const std::string& text, const BagListing& listing) {
  const std::size_t equals = text.find('=');
  Choice choice;
  if (equals != std::string::npos) choice.name = text.substr(0, equals);
  choice.topic = equals == std::string::npos ? text : text.substr(equals + 1);
  choice.compressed =
      std::any_of(listing.topics.begin(), listing.topics.end(), [&](const BagTopic& topic) {
        return topic.name == choice.topic && is_compressed_type(topic);
      });
  if (choice.compressed)
    require_topic(listing, choice.topic, ros_message::CompressedImage::type);
  else
    require_topic(listing, choice.topic, ros_message::Image::type);
  return choice;
}

std::vector<Choice> choices_of(const BagListing& listing, const BagRigOptions& options) {
  std::vector<Choice> choices;
  for (const std::string& text : options.topics) choices.push_back(chosen(text, listing));
  if (!choices.empty()) return choices;
  for (const BagTopic& topic : listing.topics) {
    const bool compressed = is_compressed_type(topic);
    if (compressed && !topic.name.ends_with("/compressedDepth")) continue;
    if (compressed || topic.is(ros_message::Image::type))
      choices.push_back({{}, topic.name, compressed});
  }
  return choices;
}

// Keeps topics of depth images among the topics not given by the user; prefers a raw topic to a
// compressed one of the same images.
void keep_depth_topics(std::vector<Choice>& choices, BagTopics& bag_topics) {
  std::vector<Choice> kept_choices;
  std::vector<ImageTopic> kept;
  const auto raw_is_there = [&](const std::string& topic) {
    return std::any_of(bag_topics.images.begin(), bag_topics.images.end(),
                       [&](const ImageTopic& images) {
                         return topic == images.topic + "/compressedDepth" &&
                                is_depth_encoding(images.encoding, false);
                       });
  };
  for (std::size_t n = 0; n < choices.size(); ++n) {
    const ImageTopic& images = bag_topics.images[n];
    if (!is_depth_encoding(images.encoding, images.compressed)) continue;
    if (images.compressed && raw_is_there(images.topic)) continue;
    kept_choices.push_back(choices[n]);
    kept.push_back(images);
  }
  choices = kept_choices;
  bag_topics.images = kept;
}

std::vector<std::string> parts_of(const std::string& topic) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (begin < topic.size()) {
    const std::size_t end = std::min(topic.find('/', begin), topic.size());
    if (end > begin) parts.push_back(topic.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

// Names topics by the parts in which they differ, joined by '_'; a single topic by its first part.
std::vector<std::string> names_by_difference(const std::vector<ImageTopic>& images) {
  std::vector<std::vector<std::string>> parts;
  parts.reserve(images.size());
  for (const ImageTopic& one : images)
    parts.push_back(parts_of(namespace_of_image(one.topic, one.compressed)));
  std::size_t shortest = parts.front().size();
  bool equal_length = true;
  for (const auto& one : parts) {
    equal_length = equal_length && one.size() == shortest;
    shortest = std::min(shortest, one.size());
  }
  std::vector<std::string> names(images.size());
  for (std::size_t n = 0; n < images.size(); ++n) {
    for (std::size_t p = 0; p < parts[n].size(); ++p) {
      const bool differs =
          images.size() == 1
              ? p == 0
              : !equal_length || std::any_of(parts.begin(), parts.end(), [&](const auto& other) {
                  return other[p] != parts[n][p];
                });
      if (differs) names[n] += (names[n].empty() ? "" : "_") + parts[n][p];
    }
    if (names[n].empty()) names[n] = "camera_" + std::to_string(n);
  }
  if (std::set<std::string>(names.begin(), names.end()).size() < names.size())
    for (std::size_t n = 0; n < names.size(); ++n) names[n] = "camera_" + std::to_string(n);
  return names;
}

std::size_t camera_of_rig(const CameraRig& rig, const Choice& choice, const std::string& name) {
  std::vector<std::string> names;
  for (const RigCamera& camera : rig.cameras) names.push_back(camera.name);
  std::vector<std::string> candidates = {choice.name};
  if (choice.name.empty()) {
    candidates = parts_of(choice.topic);
    candidates.insert(candidates.begin(), name);
  }
  for (const std::string& candidate : candidates)
    for (std::size_t n = 0; n < names.size(); ++n)
      if (names[n] == candidate) return n;
  throw Error(
      "matches no camera of the rig; use CAMERA=TOPIC" + did_you_mean(candidates.front(), names),
      {.field = "topic", .value = choice.topic});
}

Camera calibrated_camera(const ImageTopic& images, const BagListing& listing) {
  if (!images.calibrations.empty())
    return images.calibrations[images.calibration_at(images.stamps_ns.front())];
  if (!images.info_error.empty())
    throw Error("no camera info can be used: " + images.info_error, {.field = images.info_topic});
  require_topic(listing, images.info_topic, ros_message::CameraInfo::type);
  throw Error("contains no camera info", {.field = images.info_topic});
}

std::string base_frame_of(const BagTopics& bag_topics, const BagRigOptions& options) {
  if (options.base_frame != "auto") return plain_frame(options.base_frame);
  const std::string usual = "base_link";  // REP-105
  return bag_topics.transforms.has(usual)
             ? usual
             : bag_topics.transforms.root_of(bag_topics.images.front().frame);
}

// Makes a rig from the bag's camera infos and transforms.
void rig_from_bag(const BagTopics& bag_topics, const BagListing& listing,
                  const BagRigOptions& options, BagRigPlan& plan) {
  if (bag_topics.transforms.empty())
    require_topic(listing, options.transform_topic, ros_message::TFMessage::type);
  const std::string base = base_frame_of(bag_topics, options);
  for (std::size_t n = 0; n < bag_topics.images.size(); ++n) {
    const ImageTopic& images = bag_topics.images[n];
    RigCamera& camera = plan.rig.cameras[n];
    in_field(images.topic, [&] {
      camera.camera = calibrated_camera(images, listing);
      camera.camera.base_from_camera = bag_topics.transforms.target_from_source(base, images.frame);
    });
  }
}

void set_limits(const BagTopics& bag_topics, const BagRigOptions& options, BagRigPlan& plan) {
  for (std::size_t n = 0; n < plan.rig.cameras.size(); ++n) {
    RigCamera& camera = plan.rig.cameras[n];
    const auto images =
        std::find_if(bag_topics.images.begin(), bag_topics.images.end(),
                     [&](const ImageTopic& one) { return one.topic == plan.topics[n]; });
    const bool floats =
        images != bag_topics.images.end() && images->encoding.find("32FC1") != std::string::npos;
    if (options.depth_scale_m > 0)
      camera.depth_scale_m = options.depth_scale_m;
    else if (!options.rig)
      camera.depth_scale_m = floats ? float_unit_m : options.depth_unit_m;
    if (options.near_m > 0) camera.near_m = options.near_m;
    if (std::isfinite(options.far_m)) camera.far_m = options.far_m;
  }
}

// Adds the camera's images of its first calibration, ascending, at most one per microsecond.
void add_images(const ImageTopic& images, std::size_t camera, bool calibrated, BagRigPlan& plan) {
  std::vector<std::int64_t> stamps = images.stamps_ns;
  std::sort(stamps.begin(), stamps.end());
  const auto microsecond = [](std::int64_t stamp) { return (stamp + 500) / 1000; };
  std::size_t twice = 0;
  std::size_t otherwise = 0;
  const std::size_t own =
      calibrated ? images.calibration_at(images.stamps_ns.front()) : std::size_t{0};
  for (std::size_t n = 0; n < stamps.size(); ++n) {
    if (n > 0 && microsecond(stamps[n]) == microsecond(stamps[n - 1]))
      ++twice;
    else if (calibrated && images.calibration_at(stamps[n]) != own)
      ++otherwise;
    else
      plan.images.push_back({camera, stamps[n]});
  }
  const auto warn = [&](std::size_t count, const std::string& text) {
    if (count > 0)
      plan.warnings.push_back(images.topic + ": " + std::to_string(count) + " images " + text);
  };
  warn(twice, "are dropped because an earlier image has the same stamp");
  warn(otherwise, "are dropped because the calibration differs from that of the first image");
  if (images.unstamped)
    plan.warnings.push_back(images.topic + ": images have no stamp; the recording times are used");
}

// Selects synchronized sets and keeps their images only.
void choose_sets(const BagRigOptions& options, const std::optional<double>& stamp_s,
                 BagRigPlan& plan) {
  std::vector<RigImage> stamps;
  for (const BagImage& image : plan.images)
    stamps.push_back({image.camera, ros_message::seconds_of(image.stamp_ns)});
  std::vector<SynchronizedSet> sets =
      synchronized_sets(stamps, plan.rig.cameras.size(), options.tolerance_s);
  plan.sets_in_bag = sets.size();
  if (stamp_s) {
    const auto nearest = std::min_element(
        sets.begin(), sets.end(), [&](const SynchronizedSet& a, const SynchronizedSet& b) {
          return std::abs(a.stamp_s - *stamp_s) < std::abs(b.stamp_s - *stamp_s);
        });
    sets = {*nearest};
  }
  std::vector<BagImage> kept;
  for (std::size_t n = 0; n < sets.size(); n += static_cast<std::size_t>(options.every)) {
    plan.sets.push_back(sets[n]);
    for (SynchronizedSet::Camera& camera : plan.sets.back().cameras) {
      if (camera.state != SynchronizedSet::Camera::State::seen) continue;
      kept.push_back(plan.images[camera.image]);
    }
  }
  std::sort(kept.begin(), kept.end());
  plan.images = kept;
}

std::string topics_with_encodings(const BagTopics& bag_topics) {
  std::string text;
  for (const ImageTopic& images : bag_topics.images)
    text += (text.empty() ? "" : ", ") + images.topic + " " + images.encoding;
  return text;
}

BagRigPlan plan_of(const fs::path& bag, const BagRigOptions& options,
                   const std::optional<double>& stamp_s) {
  const BagListing listing = list_bag(bag);
  std::vector<Choice> choices = choices_of(listing, options);
  std::vector<std::pair<std::string, bool>> topics;
  topics.reserve(choices.size());
  for (const Choice& choice : choices) topics.emplace_back(choice.topic, choice.compressed);
  BagTopics bag_topics = read_bag_topics(bag, topics, options.rig ? "" : options.transform_topic);
  const std::string found = topics_with_encodings(bag_topics);
  if (options.topics.empty()) keep_depth_topics(choices, bag_topics);
  if (choices.empty())
    throw Error("no topic contains depth images", {.field = "topics of images",
                                                   .value = found.empty() ? "none" : found,
                                                   .bound = depth_encodings});
  for (const ImageTopic& images : bag_topics.images)
    if (!is_depth_encoding(images.encoding, images.compressed))
      throw Error("not an encoding of depth images", {.field = "encoding of " + images.topic,
                                                      .value = images.encoding,
                                                      .bound = depth_encodings});
  const std::vector<std::string> names = names_by_difference(bag_topics.images);
  BagRigPlan plan;
  plan.depth_unit_m = options.depth_unit_m;
  plan.tolerance_s = options.tolerance_s;
  if (options.rig) plan.rig = *options.rig;
  if (!options.rig) plan.rig.cameras.resize(choices.size());
  plan.topics.resize(plan.rig.cameras.size());
  for (std::size_t n = 0; n < choices.size(); ++n) {
    const std::size_t camera = options.rig ? camera_of_rig(plan.rig, choices[n], names[n]) : n;
    if (!options.rig)
      plan.rig.cameras[n].name = choices[n].name.empty() ? names[n] : choices[n].name;
    if (std::find(plan.topics.begin(), plan.topics.end(), choices[n].topic) != plan.topics.end())
      throw Error("the topic is named twice", {.field = "topic", .value = choices[n].topic});
    if (!plan.topics[camera].empty())
      throw Error("belongs to the same camera as " + plan.topics[camera],
                  {.field = "topic", .value = choices[n].topic});
    plan.topics[camera] = choices[n].topic;
    add_images(bag_topics.images[n], camera,
               !options.rig && !bag_topics.images[n].calibrations.empty(), plan);
  }
  if (!options.rig) rig_from_bag(bag_topics, listing, options, plan);
  set_limits(bag_topics, options, plan);
  plan.rig.check();
  std::sort(plan.images.begin(), plan.images.end());
  choose_sets(options, stamp_s, plan);
  return plan;
}

}  // namespace

void bind(ParameterTable& table, BagRigOptions& options) {
  table.add("base_frame", options.base_frame,
            "frame of the robot in the bag; auto: base_link, else the root of the transforms");
  table.add("transform_topic", options.transform_topic,
            "topic of the static transforms between the cameras and the robot");
  table.add("depth_unit_m", options.depth_unit_m, positive,
            "meters per unit of the 16-bit depth images in the bag");
  table.add("depth_scale_m", options.depth_scale_m, not_negative,
            "meters per unit of the written depth images; 0: as in the rig file, else as in the "
            "bag (0.0001 m for floating-point images)");
  table.add("near_m", options.near_m, not_negative,
            "minimum valid depth in the written rig, m; 0: as in the rig file, if given");
  table.add("far_m", options.far_m, positive,
            "maximum valid depth in the written rig, m; inf: as in the rig file, if given");
  table.add("tolerance_s", options.tolerance_s, not_negative,
            "maximum time between an image and the stamp of its synchronized set, s");
  table.add("every", options.every, {1.0},
            "step between exported synchronized image sets; 1: export all");
}

std::vector<std::string> names_in_rig_folder(const BagRigPlan& plan) {
  std::vector<std::string> names = {rig_file_name, synchronized_sets_file_name};
  for (const RigCamera& camera : plan.rig.cameras) names.push_back(camera.name);
  return names;
}

BagRigPlan plan_bag_rig(const fs::path& bag, const BagRigOptions& options,
                        const std::optional<double>& stamp_s) {
  return in_file(bag, [&] { return plan_of(bag, options, stamp_s); });
}

}  // namespace libmap
