// Tree of static transforms between frames, as in /tf_static.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/pose.h"

namespace libmap {

// Each frame has one parent, except the root. Names have no leading '/', as in tf2.
class TransformTree {
 public:
  // Adds a transform; a repeated one is ignored. Throws Error if a name is empty, both names are
  // equal, the pose is not finite, or the tree contains `child` with another parent or a pose that
  // differs by more than 1e-5 (m, or entries of the rotation matrix).
  void add(const std::string& parent, const std::string& child, const Pose& parent_from_child);

  bool empty() const { return frames_.empty(); }
  bool has(const std::string& frame) const;  // true if the tree contains the frame
  std::vector<std::string> frames() const;   // ascending

  // Returns the topmost ancestor of `frame`. Throws Error for an unknown frame (with the
  // nearest known one) and for a cycle.
  std::string root_of(const std::string& frame) const;

  // Returns target_from_source: the pose of frame `source` in frame `target`. Throws Error as
  // root_of does, and if no transforms connect the frames.
  Pose target_from_source(const std::string& target, const std::string& source) const;

 private:
  struct Link {
    std::string parent;
    Pose parent_from_child = Pose::Identity();
  };
  // Returns `frame` and all ancestors of `frame`.
  std::vector<std::string> chain_of(const std::string& frame) const;

  std::map<std::string, Link> links_;  // by the child's name
  std::set<std::string> frames_;
};

// Removes a leading '/': "/base_link" -> "base_link".
std::string plain_frame(const std::string& name);

// Adds the transforms of a message tf2_msgs/TFMessage to `tree`. Throws Error for a truncated
// message, a quaternion whose norm differs from 1 by 0.01 or more, and as TransformTree::add does.
void add_transforms(MessageEncoding encoding, std::string_view bytes, TransformTree& tree);

}  // namespace libmap
