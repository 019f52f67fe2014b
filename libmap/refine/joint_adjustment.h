// Poses, motions, points and the numbers of cameras that agree best with all observations:
// Levenberg and Marquardt's steps of the dense normal equations, the points eliminated. Inner part
// of libmap/refine.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <vector>

#include "libmap/refine/bundle_residuals.h"
#include "libmap/refine/pose_graph_optimization.h"

namespace libmap {

struct JointObservation {
  std::size_t node = 0;       // its place among the poses
  Eigen::Index first = 0;     // number of its camera
  CalibratedFeature feature;  // what is seen
};

struct JointProblem {
  std::vector<JointObservation> observations;  // those of a point side by side
  std::vector<std::size_t> begin = {0};        // of each point's; one more than points
  double robust_scale = 3.0;                   // of Cauchy's loss
  std::vector<bool> held;                      // of each pose
  bool numbers_held = false;                   // those of the cameras
  bool moving = false;                         // motions are unknown
  std::vector<Vector6d> motion_mean;           // what is known of them beforehand
  std::vector<Vector6d> motion_deviation;
  // What is known of the cameras' numbers beforehand: residuals a x - b.
  Eigen::MatrixXd prior;
  Eigen::VectorXd prior_mean;
  std::vector<GraphLinkResult> links;

  std::size_t points() const { return begin.size() - 1; }
};

struct JointState {
  std::map<int, Pose> poses;
  std::vector<Vector6d> motions;  // of each pose
  Eigen::VectorXd numbers;        // of all cameras
  std::vector<Eigen::Vector3d> points;
};

// Half the sum of squares of steps (rigid_motion.h) of poses, each followed by its motion if that
// is unknown, then of the cameras' numbers.
struct JointSystem {
  Eigen::MatrixXd matrix;  // lower triangle
  Eigen::VectorXd side;    // minus the gradient
};

struct JointSummary {
  double initial_cost = 0.0;
  double final_cost = 0.0;
  int iterations = 0;
  bool converged = false;
};

// Steps until the cost falls by less than `tolerance` of itself. The state never gets worse. The
// same for any number of threads.
JointSummary adjust_jointly(const JointProblem& problem, JointState& state, int max_iterations,
                            double tolerance);

// The normal equations at a state. Unknowns that nothing binds, and held poses, have a diagonal
// of 1.
JointSystem joint_system(const JointProblem& problem, const JointState& state);

}  // namespace libmap
