// Frames that stand still against each other, as /tf_static tells of them.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/pose.h"

namespace libmap {

// Each frame hangs on one parent. Names are without a leading '/', as of tf2.
class TransformTree {
 public:
  // Throws Error: empty names, a frame that is its own parent, a pose that is not finite, one that
  // is there already with another parent or elsewhere by more than 1e-5 (m, or of the rotation's
  // entries): then it does not stand still.
  void add(const std::string& parent, const std::string& child, const Pose& parent_from_child);

  bool empty() const { return frames_.empty(); }
  bool has(const std::string& frame) const;  // whether the tree knows the frame
  std::vector<std::string> frames() const;   // ascending

  // The frame that hangs on no other, above `frame`. Throws Error: an unknown frame (with the
  // nearest known one), or one that hangs on itself.
  std::string root_of(const std::string& frame) const;

  // Throws Error as root_of, and if no transforms lead from one to the other.
  Pose target_from_source(const std::string& target, const std::string& source) const;

 private:
  struct Link {
    std::string parent;
    Pose parent_from_child = Pose::Identity();
  };
  // `frame` and all above it.
  std::vector<std::string> chain_of(const std::string& frame) const;

  std::map<std::string, Link> links_;  // by child
  std::set<std::string> frames_;
};

// "/base_link" -> "base_link".
std::string plain_frame(const std::string& name);

// Adds a message's transforms to `tree`. Throws Error: the message ends before its last transform,
// a quaternion whose norm differs from 1 by 0.01 or more, and as TransformTree::add.
void add_transforms(MessageEncoding encoding, std::string_view bytes, TransformTree& tree);

}  // namespace libmap
