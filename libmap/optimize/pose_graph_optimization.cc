#include "libmap/optimize/pose_graph_optimization.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/median.h"
#include "libmap/geometry/disjoint_sets.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/optimize/graph_links.h"

namespace libmap {

namespace {

constexpr double min_scale = 0.01;  // bounds of the factor of a group's standard deviations
constexpr double max_scale = 20.0;
constexpr double settled = 0.02;         // relative change of the scales at convergence
constexpr double min_redundancy = 0.1;   // per residual of a link used for its group's scale
constexpr std::size_t min_links = 3;     // of a group whose scale is estimated
constexpr double worst_fraction = 0.25;  // of the worst chi-square; closures above are rejected too
constexpr int max_rejections = 20;
constexpr std::size_t simplicial_below = 120;              // poses
constexpr double unknown_landmark_information = 1.001e-4;  // RTAB-Map: variance >= 9999

// Removes the information about the rotation of a landmark that is a point.
Matrix6d usable_information(const PoseLink& link) {
  Matrix6d information = link.information;
  if (link.type == LinkType::landmark && information(5, 5) <= unknown_landmark_information) {
    information.rightCols<3>().setZero();
    information.bottomRows<3>().setZero();
  }
  return information;
}

constexpr int pose_size = 16;  // values of a Pose in memory

// Stores the poses of a graph contiguously, by ascending node. Ceres orders unknowns by address,
// and its sums must be deterministic.
class PoseBlocks {
 public:
  explicit PoseBlocks(const std::map<int, Pose>& poses) {
    poses_.reserve(poses.size());
    for (const auto& [node, pose] : poses) {
      row_[node] = poses_.size();
      poses_.push_back(pose);
    }
  }
  double* at(int node) { return poses_[row_.at(node)].data(); }
  const Pose& pose(int node) const { return poses_[row_.at(node)]; }

 private:
  std::vector<Pose> poses_;
  std::map<int, std::size_t> row_;
};

Pose pose_of(const double* block) { return Pose(Eigen::Map<const Eigen::Matrix4d>(block)); }

// Manifold of pose steps (rigid_motion.h). Costs store their derivatives by a step in the first six
// columns, so that derivatives by the 16 values of a pose are not needed.
class StepManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return pose_size; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* pose, const double* step, double* result) const override {
    Eigen::Map<Eigen::Matrix4d> out(result);
    out = moved(pose_of(pose), Eigen::Map<const Vector6d>(step)).matrix();
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, pose_size, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* to, const double* from, double* step) const override {
    Eigen::Map<Vector6d> out(step);
    out = step_between(pose_of(from), pose_of(to));
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, pose_size, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }
};

template <typename Derivative>
void set_jacobian(const Derivative& by_step, double* jacobian) {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, pose_size, Eigen::RowMajor>> out(
      jacobian, by_step.rows(), pose_size);
  out.setZero();
  out.leftCols<6>() = by_step;
}

// L^T of information = L L^T, which transforms residuals to unit variance.
Matrix6d whitening(const Matrix6d& information) {
  const Eigen::LLT<Matrix6d> root(information);
  if (root.info() == Eigen::Success) return root.matrixL().transpose();
  // Square root of a semidefinite matrix.
  const SymmetricEigen<6> eigen = symmetric_eigen(information);
  return eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
}

// Whitened link_residual.
class LinkCost : public ceres::CostFunction {
 public:
  explicit LinkCost(const PoseLink& link)
      : link_(link), whitening_(whitening(link_information(link))) {
    set_num_residuals(6);
    mutable_parameter_block_sizes()->assign(is_absolute(link) ? 1 : 2, pose_size);
  }
  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    const Pose from = pose_of(blocks[0]);
    const Pose to = is_absolute(link_) ? from : pose_of(blocks[1]);
    Eigen::Map<Vector6d> out(residual);
    out = whitening_ * link_residual(link_, from, to);
    if (jacobians == nullptr) return true;
    const LinkJacobian jacobian = link_jacobian(link_, from, to);
    if (jacobians[0] != nullptr) set_jacobian(whitening_ * jacobian.by_from, jacobians[0]);
    if (!is_absolute(link_) && jacobians[1] != nullptr)
      set_jacobian(whitening_ * jacobian.by_to, jacobians[1]);
    return true;
  }

 private:
  PoseLink link_;
  Matrix6d whitening_;
};

// Fixes a node's position and rotation about the map's z axis; gravity does not constrain these.
class YawGaugeCost : public ceres::SizedCostFunction<4, pose_size> {
 public:
  explicit YawGaugeCost(const Pose& fixed) : fixed_(fixed) {}
  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    constexpr double weight = 1e3;
    const Pose pose = pose_of(blocks[0]);
    const Eigen::Vector3d turn = rotation_vector_of(pose.linear() * fixed_.linear().transpose());
    Eigen::Map<Eigen::Vector4d> out(residual);
    out << pose.translation() - fixed_.translation(), turn.z();
    out *= weight;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    Eigen::Matrix<double, 4, 6> by_step = Eigen::Matrix<double, 4, 6>::Zero();
    by_step.topLeftCorner<3, 3>() = pose.linear();
    by_step.bottomRightCorner<1, 3>() =
        (rotation_vector_derivative(turn).transpose() * pose.linear()).row(2);
    set_jacobian(weight * by_step, jacobians[0]);
    return true;
  }

 private:
  Pose fixed_;
};

struct Scales {
  double translation = 1.0;
  double rotation = 1.0;
};

class Optimization {
 public:
  Optimization(const std::map<int, Pose>& map_from_base, const std::vector<GraphLink>& links,
               const PoseGraphOptions& options)
      : links_(links), options_(options), start_(map_from_base) {
    result_.map_from_base = map_from_base;
    for (const GraphLink& link : links) {
      require_usable(link.link);
      result_.links.push_back({link.link, false, 1.0, 0.0});
      result_.links.back().link.information = usable_information(link.link);
      ++result_.groups[link.group].links;
    }
    add_landmarks();
    for (const GraphLink& link : links_) used_.push_back(has_ends(link.link));
  }

  PoseGraphResult run();

 private:
  bool has_ends(const PoseLink& link) const {
    return result_.map_from_base.contains(link.from) && result_.map_from_base.contains(link.to) &&
           (link.from != link.to || is_absolute(link));
  }
  ceres::LossFunction* new_loss() const {
    return options_.robust_scale > 0.0 ? new ceres::CauchyLoss(options_.robust_scale) : nullptr;
  }
  void add_landmarks();
  void find_components();
  void solve();
  void fix_gauges(ceres::Problem& problem, PoseBlocks& blocks);
  void update_residuals();
  bool reject();
  bool recalibrate();
  void apply_scales();
  void summarize();

  const std::vector<GraphLink>& links_;
  const PoseGraphOptions& options_;
  std::map<int, Pose> start_;
  PoseGraphResult result_;
  std::vector<bool> used_;
  std::map<std::string, Scales> scales_;
};

// Landmarks start at their first observation.
void Optimization::add_landmarks() {
  for (const GraphLink& link : links_) {
    if (link.link.type != LinkType::landmark || link.link.to >= 0) continue;
    const auto seen_from = result_.map_from_base.find(link.link.from);
    if (seen_from == result_.map_from_base.end()) continue;
    result_.map_from_base.try_emplace(link.link.to, seen_from->second * link.link.from_from_to);
    start_.try_emplace(link.link.to, seen_from->second * link.link.from_from_to);
  }
}

void Optimization::find_components() {
  std::map<int, std::size_t> rows;
  for (const auto& [node, pose] : result_.map_from_base) rows.emplace(node, rows.size());
  DisjointSets<std::size_t> sets(rows.size());
  std::set<int> linked;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n] || result_.links[n].rejected) continue;
    const PoseLink& link = links_[n].link;
    if (is_absolute(link)) continue;
    linked.insert({link.from, link.to});
    sets.join(rows.at(link.from), rows.at(link.to));
  }
  std::map<std::size_t, std::vector<int>> members;
  for (const auto& [node, row] : rows) members[sets.find(row)].push_back(node);
  result_.components.clear();
  result_.without_links.clear();
  for (auto& [first, nodes] : members) {
    GraphComponent component{std::move(nodes), 0};
    // Landmarks have negative numbers.
    const auto node =
        std::find_if(component.nodes.begin(), component.nodes.end(), [](int id) { return id > 0; });
    component.gauge_node = node != component.nodes.end() ? *node : component.nodes.front();
    if (std::binary_search(component.nodes.begin(), component.nodes.end(), options_.gauge_node))
      component.gauge_node = options_.gauge_node;
    result_.components.push_back(std::move(component));
  }
  std::stable_sort(result_.components.begin(), result_.components.end(),
                   [](const GraphComponent& a, const GraphComponent& b) {
                     return a.nodes.size() > b.nodes.size();
                   });
  for (const auto& [node, pose] : result_.map_from_base)
    if (node > 0 && !linked.contains(node)) result_.without_links.push_back(node);
}

// Relative links do not constrain the motion of a whole component, so one node is fixed. Components
// with priors need no gauge. With gravity, only position and yaw are fixed.
void Optimization::fix_gauges(ceres::Problem& problem, PoseBlocks& blocks) {
  std::set<int> with_prior;
  std::set<int> with_gravity;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n]) continue;
    if (links_[n].link.type == LinkType::pose_prior) with_prior.insert(links_[n].link.from);
    if (links_[n].link.type == LinkType::gravity) with_gravity.insert(links_[n].link.from);
  }
  for (const GraphComponent& component : result_.components) {
    const auto holds = [&](const std::set<int>& nodes) {
      return std::any_of(component.nodes.begin(), component.nodes.end(),
                         [&](int node) { return nodes.contains(node); });
    };
    double* block = blocks.at(component.gauge_node);
    if (!problem.HasParameterBlock(block) || holds(with_prior)) continue;
    if (holds(with_gravity))
      problem.AddResidualBlock(new YawGaugeCost(start_.at(component.gauge_node)), nullptr, block);
    else
      problem.SetParameterBlockConstant(block);
  }
}

void Optimization::solve() {
  find_components();
  PoseBlocks blocks(result_.map_from_base);
  ceres::Problem problem;
  std::vector<double*> ends;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n] || result_.links[n].rejected) continue;
    const PoseLink& link = result_.links[n].link;
    ends = {blocks.at(link.from)};
    if (!is_absolute(link)) ends.push_back(blocks.at(link.to));
    problem.AddResidualBlock(new LinkCost(link), new_loss(), ends);
  }
  if (ends.empty()) return;
  auto* const manifold = new StepManifold;  // owned by the problem
  for (const auto& [node, pose] : result_.map_from_base)
    if (problem.HasParameterBlock(blocks.at(node))) problem.SetManifold(blocks.at(node), manifold);
  fix_gauges(problem, blocks);
  ceres::Solver::Options settings;
  settings.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // CHOLMOD's supernodes are faster with much fill-in.
  settings.sparse_linear_algebra_library_type =
      result_.map_from_base.size() < simplicial_below ? ceres::EIGEN_SPARSE : ceres::SUITE_SPARSE;
  settings.num_threads = 1;
  settings.max_num_iterations = 100;
  settings.function_tolerance = 1e-12;
  settings.gradient_tolerance = 1e-12;
  settings.parameter_tolerance = 1e-12;
  settings.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(settings, &problem, &summary);
  for (auto& [node, pose] : result_.map_from_base) pose = blocks.pose(node);
  result_.initial_cost = summary.initial_cost;
  result_.final_cost = summary.final_cost;
  result_.iterations += static_cast<int>(summary.iterations.size());
  result_.converged = summary.IsSolutionUsable();
}

Vector6d residual_of(const PoseLink& link, const std::map<int, Pose>& poses) {
  return link_residual(link, poses.at(link.from),
                       poses.at(is_absolute(link) ? link.from : link.to));
}

void Optimization::update_residuals() {
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n]) continue;
    GraphLinkResult& link = result_.links[n];
    const Vector6d residual = residual_of(link.link, result_.map_from_base);
    link.chi_square = residual.dot(link.link.information * residual);
    const double square = options_.robust_scale * options_.robust_scale;
    link.weight = link.rejected ? 0.0 : square > 0.0 ? square / (square + link.chi_square) : 1.0;
  }
}

// Rejects the closures with the largest chi-square. Returns false if all are below the limit.
bool Optimization::reject() {
  double worst = options_.max_chi_square;
  for (std::size_t n = 0; n < links_.size(); ++n)
    if (used_[n] && links_[n].may_be_rejected && !result_.links[n].rejected)
      worst = std::max(worst, result_.links[n].chi_square);
  if (worst <= options_.max_chi_square) return false;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    GraphLinkResult& link = result_.links[n];
    if (used_[n] && links_[n].may_be_rejected && !link.rejected &&
        link.chi_square > std::max(options_.max_chi_square, worst_fraction * worst))
      link.rejected = true;
  }
  return true;
}

// Variance factor of a group: the median of its links' squared residuals over redundancies
// (Foerstner 1979), so that up to half of the links may be wrong. 0 if there are too few links.
double group_variance(const std::vector<double>& ratios) {
  return ratios.size() < min_links ? 0.0 : median(ratios);
}

bool Optimization::recalibrate() {
  PoseGraphResult unweighted = result_;
  for (GraphLinkResult& link : unweighted.links) link.weight = 1.0;
  const GraphCovariance covariance(unweighted);
  if (!covariance.valid()) return false;
  std::map<std::string, std::array<std::vector<double>, 2>> ratios;
  for (auto& [name, group] : result_.groups) group.redundancy = 0.0;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    const PoseLink& link = result_.links[n].link;
    if (!used_[n] || result_.links[n].rejected || is_absolute(link) ||
        link.type == LinkType::landmark)
      continue;
    const Vector6d residual = residual_of(link, result_.map_from_base);
    const std::string& group = links_[n].group;
    // Translation and rotation are separate if the link's information has no mixed terms.
    const bool apart = link.information.topRightCorner<3, 3>().isZero(0.0);
    const Matrix6d fraction = link.information * covariance.of_relative(link.from, link.to);
    for (std::size_t part = 0; part < 2; ++part) {
      const auto first = static_cast<Eigen::Index>(apart ? 3 * part : 0);
      const Eigen::Index size = apart ? 3 : 6;
      const double all = static_cast<double>(size);
      const double redundancy = all - fraction.diagonal().segment(first, size).sum();
      if (redundancy < min_redundancy * all) continue;
      const double square = residual.segment(first, size)
                                .dot(link.information.block(first, first, size, size) *
                                     residual.segment(first, size));
      result_.groups[group].redundancy += apart ? redundancy : 0.5 * redundancy;
      // The median of chi-square is less than its mean (Wilson and Hilferty 1931).
      ratios[group][part].push_back(square / redundancy / std::pow(1.0 - 2.0 / (9.0 * all), 3));
    }
  }
  double change = 0.0;
  for (auto& [group, parts] : ratios) {
    Scales& scales = scales_[group];
    double* const values[2] = {&scales.translation, &scales.rotation};
    for (std::size_t part = 0; part < 2; ++part) {
      const double variance = group_variance(parts[part]);
      if (!(variance > 0.0)) continue;
      const double before = *values[part];
      *values[part] = std::clamp(before * std::sqrt(variance), min_scale, max_scale);
      change = std::max(change, std::abs(*values[part] / before - 1.0));
    }
  }
  apply_scales();
  return change > settled;
}

void Optimization::apply_scales() {
  for (std::size_t n = 0; n < links_.size(); ++n) {
    const auto scales = scales_.find(links_[n].group);
    if (scales == scales_.end()) continue;
    Vector6d factor;
    factor << Eigen::Vector3d::Constant(1.0 / scales->second.translation),
        Eigen::Vector3d::Constant(1.0 / scales->second.rotation);
    result_.links[n].link.information =
        factor.asDiagonal() * usable_information(links_[n].link) * factor.asDiagonal();
  }
}

void Optimization::summarize() {
  for (auto& [name, group] : result_.groups) {
    const auto scales = scales_.find(name);
    if (scales != scales_.end()) {
      group.translation_scale = scales->second.translation;
      group.rotation_scale = scales->second.rotation;
    }
    double count = 0.0;
    Vector6d squares_before = Vector6d::Zero();
    Vector6d squares = Vector6d::Zero();
    for (std::size_t n = 0; n < links_.size(); ++n) {
      if (links_[n].group != name || !used_[n]) continue;
      if (result_.links[n].rejected) {
        ++group.rejected;
        continue;
      }
      const PoseLink& link = result_.links[n].link;
      squares_before += residual_of(link, start_).cwiseAbs2();
      squares += residual_of(link, result_.map_from_base).cwiseAbs2();
      count += 1.0;
    }
    if (count == 0.0) continue;
    const auto translation_rms = [&](const Vector6d& sum) {
      return std::sqrt(sum.head<3>().sum() / count);
    };
    const auto rotation_rms = [&](const Vector6d& sum) {
      return std::sqrt(sum.tail<3>().sum() / count) * 180.0 / std::numbers::pi;
    };
    group.translation_rms_before_m = translation_rms(squares_before);
    group.rotation_rms_before_deg = rotation_rms(squares_before);
    group.translation_rms_m = translation_rms(squares);
    group.rotation_rms_deg = rotation_rms(squares);
  }
}

PoseGraphResult Optimization::run() {
  const int rounds = options_.recalibrate ? options_.recalibrations : 0;
  for (int round = 0;; ++round) {
    solve();
    update_residuals();
    // Closures are rejected only after the first recalibration, if there is one.
    for (int n = 0; n < max_rejections && (round > 0 || rounds == 0) && reject(); ++n) {
      solve();
      update_residuals();
    }
    if (round >= rounds || (!recalibrate() && round > 0)) break;
  }
  find_components();
  update_residuals();
  summarize();
  return std::move(result_);
}

}  // namespace

void bind(ParameterTable& table, PoseGraphOptions& options) {
  table.add("recalibrate", options.recalibrate,
            "scale the covariances of each type of link to match the residuals of its links");
  table.add("recalibrations", options.recalibrations, {1},
            "maximum number of rounds in which the covariances of links are scaled");
  table.add("robust_scale", options.robust_scale, not_negative,
            "width of Cauchy's loss for links, in standard deviations; 0: plain least squares");
  table.add("max_chi_square", options.max_chi_square, positive,
            "maximum chi-square of a loop closure after optimization; closures above are rejected");
  table.add("gauge_node", options.gauge_node, not_negative,
            "id of the node with a fixed pose; 0: first node of each pose graph component");
}

PoseGraphResult optimize_pose_graph(const std::map<int, Pose>& map_from_base,
                                    const std::vector<GraphLink>& links,
                                    const PoseGraphOptions& options) {
  check_parameters(options);
  return Optimization(map_from_base, links, options).run();
}

}  // namespace libmap
