// Prefilter of locations for the virtual field test: excludes locations next to ground that is too
// high for a gripper that approaches from above. Uses the highest point of each column of the mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "libgtd/gripper/gripper.h"
#include "libmap/core/triangle_mesh.h"

namespace libgtd {

struct CandidateOptions {
  double cell_m = 0.01;          // width of a column; increased to limit the mesh to 1e8 columns
  double start_height_m = 0.15;  // height above the location at which the approach starts
  // Maximum fraction of the columns below the open gripper that are higher than the start of the
  // approach, where a finger may start inside the ground.
  double max_blocked_fraction = 0.15;
};

// At least 99.8 % of the voxels that hold in trials with 32 poses and 8 draws are candidates (1500
// voxels of each of three simulated sites; one site was not used to choose the bounds).
class GripCandidates {
 public:
  // Throws Error if the gripper has no `fingers`.
  GripCandidates(const libmap::TriangleMesh& mesh, const Gripper& gripper,
                 const CandidateOptions& options);

  // Returns false if the ground in the column of the location, or in too many columns around it, is
  // above the start of the approach. For ApproachDirection::up only.
  bool may_hold(const Eigen::Vector3d& location) const;

 private:
  void init_grid(const libmap::TriangleMesh& mesh, double cell_m);
  std::int64_t cell(double coordinate, std::size_t side) const;
  void add_triangle(const std::array<Eigen::Vector3d, 3>& corners);
  float top_at(std::int64_t i, std::int64_t j) const;

  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double cell_m_ = 0.01;
  std::array<std::int64_t, 2> cells_{0, 0};
  std::vector<float> cell_tops_;  // heights of the columns; -infinity without ground
  double start_height_m_ = 0.0;
  std::size_t max_blocked_cells_ = 0;
  std::vector<std::array<std::int64_t, 2>> reach_;  // offsets of columns below the open gripper
};

}  // namespace libgtd
