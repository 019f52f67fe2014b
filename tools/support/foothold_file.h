// Footholds as `graspmap footholds` writes them.
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

// Throws Error naming `file` for a cloud without the fields of footholds.
std::vector<FootholdMark> foothold_marks(const libmap::PointCloud& cloud, const std::string& file);

}  // namespace graspmap_tools
