// Reads the footholds that `graspmap footholds` wrote.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace graspmap_tools {

struct FootholdMark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d approach = Eigen::Vector3d::Zero();  // of any length but 0
  double score = 0.0;
};

// Returns the footholds in a cloud (frame of the map, m). Throws Error naming `file` if the cloud
// does not have the fields of footholds, and for an approach direction of length zero.
std::vector<FootholdMark> foothold_marks(const libmap::PointCloud& cloud, const std::string& file);

}  // namespace graspmap_tools
