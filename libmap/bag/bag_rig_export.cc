#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/bag_rig.h"
#include "libmap/bag/depth_message.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/parallel.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t images_at_once = 32;

// Receives the messages of the plan's images and writes the images in batches.
class ImageWriter {
 public:
  ImageWriter(const BagRigPlan& plan, const fs::path& folder)
      : plan_(plan), folder_(folder), waiting_(plan.images.begin(), plan.images.end()) {}

  void take(const BagMessage& message) {
    const std::size_t camera = camera_of(message.topic.name);
    const bool compressed = message.topic.is(ros_message::CompressedImage::type);
    DepthMessageHead head;
    try {
      head = read_image_head(message.topic.encoding, message.bytes, compressed);
    } catch (const Error& error) {
      return say_broken(camera, error.what());
    }
    const std::int64_t stamp = head.stamp_ns == 0 ? message.recorded_ns : head.stamp_ns;
    if (waiting_.erase({camera, stamp}) == 0) return;
    batch_.push_back({{camera, stamp},
                      compressed,
                      message.topic.encoding,
                      std::string(message.bytes),
                      {},
                      {},
                      0});
    if (batch_.size() == images_at_once) write_batch();
  }

  BagRigExport finish() {
    write_batch();
    for (const auto& [camera, reason] : reasons_)
      result_.warnings.push_back(plan_.topics[camera] + ": " + std::to_string(reason.second) +
                                 " images cannot be used: " + reason.first);
    result_.sets = plan_.sets;
    if (written_.size() < plan_.images.size() && !written_.empty())
      result_.sets = synchronized_sets(written_, plan_.rig.cameras.size(), plan_.tolerance_s);
    return std::move(result_);
  }

 private:
  struct Waiting {
    BagImage image;
    bool compressed = false;
    MessageEncoding encoding = MessageEncoding::ros1;
    std::string bytes;
    std::string png;
    std::string error;
    std::size_t overflow_pixels = 0;
  };

  std::size_t camera_of(const std::string& topic) const {
    return static_cast<std::size_t>(std::find(plan_.topics.begin(), plan_.topics.end(), topic) -
                                    plan_.topics.begin());
  }

  void say_broken(std::size_t camera, const std::string& reason) {
    ++result_.undecodable_images;
    auto& known = reasons_[camera];
    if (known.second++ == 0) known.first = reason;
  }

  void encode(Waiting& one) const {
    const RigCamera& camera = plan_.rig.cameras[one.image.camera];
    try {
      const DepthMessageImage depth = decode_depth(one.encoding, one.bytes, one.compressed,
                                                   {plan_.depth_unit_m, camera.depth_scale_m});
      if (depth.image.width != camera.camera.width || depth.image.height != camera.camera.height)
        throw Error("does not match the calibration",
                    {.field = "image size",
                     .value = size_text(depth.image.width, depth.image.height),
                     .bound = size_text(camera.camera.width, camera.camera.height)});
      one.overflow_pixels = depth.overflow_pixels;
      one.png = encode_png(depth.image);
    } catch (const Error& error) {
      one.error = error.what();
    }
    one.bytes.clear();
  }

  void write_batch() {
    parallel_each(batch_.size(), [&](std::size_t n) { encode(batch_[n]); });
    for (const Waiting& one : batch_) {
      if (!one.error.empty()) {
        say_broken(one.image.camera, one.error);
        continue;
      }
      const std::string& name = plan_.rig.cameras[one.image.camera].name;
      if (!folder_.empty()) {
        fs::create_directories(folder_ / name);
        write_text(folder_ / rig_image_name(name, ros_message::seconds_of(one.image.stamp_ns)),
                   one.png);
      }
      written_.push_back({one.image.camera, ros_message::seconds_of(one.image.stamp_ns)});
      ++result_.images;
      result_.overflow_pixels += one.overflow_pixels;
    }
    batch_.clear();
  }

  const BagRigPlan& plan_;
  fs::path folder_;
  std::set<BagImage> waiting_;
  std::vector<Waiting> batch_;
  std::vector<RigImage> written_;
  std::map<std::size_t, std::pair<std::string, std::size_t>> reasons_;  // by camera
  BagRigExport result_;
};

std::string sets_table(const std::vector<SynchronizedSet>& sets) {
  Table table;
  table.columns = {"stamp_s", "cameras", "spread_s"};
  for (const SynchronizedSet& set : sets) {
    double first = 0.0;
    double last = 0.0;
    for (const SynchronizedSet::Camera& camera : set.cameras) {
      if (camera.state != SynchronizedSet::Camera::State::seen) continue;
      first = std::min(first, camera.offset_s);
      last = std::max(last, camera.offset_s);
    }
    table.rows.push_back({to_fixed_text(set.stamp_s, 6), std::to_string(set.seen()),
                          to_fixed_text(last - first, 6)});
  }
  return to_csv(table);
}

}  // namespace

BagRigExport export_bag_rig(const fs::path& bag, const BagRigPlan& plan, const fs::path& folder) {
  std::vector<BagRequest> requests;
  for (const std::string& topic : plan.topics)
    if (!topic.empty()) requests.push_back({topic});
  ImageWriter writer(plan, folder);
  read_bag(bag, requests, [&](const BagMessage& message) { writer.take(message); });
  BagRigExport result = writer.finish();
  if (result.images == 0)
    throw Error(result.warnings.empty() ? "no image can be used" : result.warnings.front(),
                {.file = bag.string()});
  if (!folder.empty()) {
    write_text(folder / rig_file_name, to_yaml(plan.rig));
    write_text(folder / synchronized_sets_file_name, sets_table(result.sets));
  }
  return result;
}

}  // namespace libmap
