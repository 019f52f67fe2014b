#include "libmap/bag/transform_tree.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "libmap/bag/message_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr double same_pose = 1e-5;

}  // namespace

std::string plain_frame(const std::string& name) {
  return name.starts_with("/") ? name.substr(1) : name;
}

void TransformTree::add(const std::string& parent, const std::string& child,
                        const Pose& parent_from_child) {
  const std::string above = plain_frame(parent);
  const std::string frame = plain_frame(child);
  if (above.empty() || frame.empty() || above == frame)
    throw Error("does not connect two different frames",
                {.field = "transform", .value = "'" + above + "' from '" + frame + "'"});
  if (!parent_from_child.matrix().allFinite())
    throw Error("the transform of this frame is not finite", {.field = "frame", .value = frame});
  const auto found = links_.find(frame);
  if (found == links_.end()) {
    links_[frame] = {above, parent_from_child};
    frames_.insert({above, frame});
    return;
  }
  const Link& link = found->second;
  const double change =
      (link.parent_from_child.matrix() - parent_from_child.matrix()).cwiseAbs().maxCoeff();
  if (link.parent != above || change > same_pose)
    throw Error("the transform of this frame changes; a static frame is required",
                {.field = "frame", .value = frame});
}

bool TransformTree::has(const std::string& frame) const {
  return frames_.contains(plain_frame(frame));
}

std::vector<std::string> TransformTree::frames() const { return {frames_.begin(), frames_.end()}; }

std::vector<std::string> TransformTree::chain_of(const std::string& given) const {
  const std::string frame = plain_frame(given);
  if (!frames_.contains(frame))
    throw Error("this frame has no static transform" + did_you_mean(frame, frames()),
                {.field = "frame", .value = frame});
  std::vector<std::string> chain = {frame};
  for (auto link = links_.find(frame); link != links_.end();
       link = links_.find(link->second.parent)) {
    if (chain.size() > links_.size())
      throw Error("the transforms above this frame form a cycle",
                  {.field = "frame", .value = frame});
    chain.push_back(link->second.parent);
  }
  return chain;
}

std::string TransformTree::root_of(const std::string& frame) const {
  return chain_of(frame).back();
}

Pose TransformTree::target_from_source(const std::string& target, const std::string& source) const {
  const std::vector<std::string> above_target = chain_of(target);
  const std::vector<std::string> above_source = chain_of(source);
  Pose common_from_source = Pose::Identity();
  for (const std::string& frame : above_source) {
    const auto common = std::find(above_target.begin(), above_target.end(), frame);
    if (common != above_target.end()) {
      Pose common_from_target = Pose::Identity();
      for (auto below = above_target.begin(); below != common; ++below)
        common_from_target = links_.at(*below).parent_from_child * common_from_target;
      return common_from_target.inverse() * common_from_source;
    }
    if (const auto link = links_.find(frame); link != links_.end())
      common_from_source = link->second.parent_from_child * common_from_source;
  }
  throw Error("no transforms connect this frame to " + plain_frame(target),
              {.field = "frame", .value = plain_frame(source)});
}

void add_transforms(MessageEncoding encoding, std::string_view bytes, TransformTree& tree) {
  const auto transforms = ros_message::decode<ros_message::TFMessage>(encoding, bytes);
  for (const ros_message::TransformStamped& transform : transforms.transforms) {
    const auto& t = transform.transform.translation;
    const auto& q = transform.transform.rotation;
    const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
    const std::string& child = transform.child_frame_id;
    if (!(std::abs(rotation.norm() - 1.0) < 0.01))
      throw Error("the norm is not 1", {.field = "quaternion of frame " + child});
    tree.add(transform.header.frame_id, child, make_pose({t.x, t.y, t.z}, rotation));
  }
}

}  // namespace libmap
