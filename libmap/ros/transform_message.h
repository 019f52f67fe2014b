// Transforms out of messages (tf2_msgs/TFMessage), from their encoded bytes.
#pragma once

#include <string_view>

#include "libmap/ros/bag_reader.h"
#include "libmap/ros/transform_tree.h"

namespace libmap {

// Adds a message's transforms to `tree`. Throws Error: the message ends before its last transform,
// a quaternion whose norm differs from 1 by 0.01 or more, and as TransformTree::add.
void add_transforms(MessageEncoding encoding, std::string_view bytes, TransformTree& tree);

}  // namespace libmap
