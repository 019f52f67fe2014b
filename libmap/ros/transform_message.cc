#include "libmap/ros/transform_message.h"

#include <cmath>
#include <string>

#include "libmap/core/error.h"
#include "libmap/ros/message_codec.h"

namespace libmap {

void add_transforms(MessageEncoding encoding, std::string_view bytes, TransformTree& tree) {
  const auto transforms = ros_message::decode<ros_message::TFMessage>(encoding, bytes);
  for (const ros_message::TransformStamped& transform : transforms.transforms) {
    const auto& t = transform.transform.translation;
    const auto& q = transform.transform.rotation;
    const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
    const std::string& child = transform.child_frame_id;
    if (!(std::abs(rotation.norm() - 1.0) < 0.01))
      throw Error("is no rotation", {.field = "quaternion of frame " + child});
    tree.add(transform.header.frame_id, child, make_pose({t.x, t.y, t.z}, rotation));
  }
}

}  // namespace libmap
