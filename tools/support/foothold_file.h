// Extracts footholds from a cloud that `graspmap footholds` wrote.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace graspmap_tools {

struct FootholdMark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d approach = Eigen::Vector3d::Zero();  // direction of the approach, any length > 0
  double score = 0.0;                                  // graspability, 0 to 1
};

// Returns the footholds in the frame of the cloud. Throws Error naming `file` if the cloud does not
// have the fields of footholds, or if an approach direction is zero or not finite.
std::vector<FootholdMark> foothold_marks(const libmap::PointCloud& cloud, const std::string& file);

}  // namespace graspmap_tools
