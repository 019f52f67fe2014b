// Poses as a solver's unknowns: seven numbers each, a unit quaternion x y z w and a translation x y
// z.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <vector>

#include "libmap/core/pose.h"

namespace libmap {

// The poses of a graph in one piece of memory, by ascending node: Ceres orders unknowns by where
// they lie, and its sums must be the same on every run.
class PoseBlocks {
 public:
  // `more` numbers follow the poses.
  explicit PoseBlocks(const std::map<int, Pose>& poses, std::size_t more = 0)
      : values_(7 * poses.size() + more, 0.0) {
    double* block = values_.data();
    for (const auto& [node, pose] : poses) {
      const Eigen::Quaterniond q(pose.linear());
      const Eigen::Vector3d t = pose.translation();
      const std::array<double, 7> numbers = {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
      std::copy(numbers.begin(), numbers.end(), block);
      place_[node] = block;
      block += 7;
    }
    rest_ = block;
  }
  PoseBlocks(const PoseBlocks&) = delete;
  PoseBlocks& operator=(const PoseBlocks&) = delete;

  bool contains(int node) const { return place_.contains(node); }
  double* at(int node) const { return place_.at(node); }
  double* rest() const { return rest_; }
  const std::map<int, double*>& all() const { return place_; }
  Pose pose(int node) const {
    const double* block = place_.at(node);
    return make_pose({block[4], block[5], block[6]},
                     Eigen::Quaterniond(block[3], block[0], block[1], block[2]));
  }

 private:
  std::vector<double> values_;
  std::map<int, double*> place_;
  double* rest_ = nullptr;
};

}  // namespace libmap
