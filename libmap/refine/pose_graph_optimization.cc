#include "libmap/refine/pose_graph_optimization.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/median.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/pose_residuals.h"

namespace libmap {

namespace {

constexpr double min_scale = 0.01;  // of a group's stated deviations
constexpr double max_scale = 20.0;
constexpr double settled = 0.02;        // relative change of the scales
constexpr double min_redundancy = 0.1;  // of a link's residuals: with less the others do not
                                        // tell it
constexpr std::size_t min_links = 3;    // fewer do not tell a group's scale
constexpr double worst_share = 0.25;    // closures near the worst are rejected with it
constexpr int max_rejections = 20;
constexpr std::size_t simplicial_below = 120;              // poses
constexpr double unknown_landmark_information = 1.001e-4;  // RTAB-Map: variance >= 9999

// Rotation of a landmark that is only a point.
Matrix6d usable_information(const PoseLink& link) {
  Matrix6d information = link.information;
  if (link.type == LinkType::landmark && information(5, 5) <= unknown_landmark_information) {
    information.rightCols<3>().setZero();
    information.bottomRows<3>().setZero();
  }
  return information;
}

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
  void hold_gauges(ceres::Problem& problem, const PoseBlocks& blocks);
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

// At their first sight.
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
  std::map<int, int> parent;
  for (const auto& [node, pose] : result_.map_from_base) parent[node] = node;
  const auto root = [&](int node) {
    while (parent[node] != node) node = parent[node] = parent[parent[node]];
    return node;
  };
  std::set<int> linked;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n] || result_.links[n].rejected) continue;
    const PoseLink& link = links_[n].link;
    if (is_absolute(link)) continue;
    linked.insert({link.from, link.to});
    const int a = root(link.from);
    const int b = root(link.to);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::map<int, std::vector<int>> members;
  for (const auto& [node, pose] : result_.map_from_base) members[root(node)].push_back(node);
  result_.components.clear();
  result_.without_links.clear();
  for (auto& [first, nodes] : members) {
    GraphComponent component{std::move(nodes), 0};
    // Landmarks stand below 0.
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

// Relative links leave the whole component free to move: one node stands still. Priors hold it
// already; gravity holds all but the place and the turn about the vertical.
void Optimization::hold_gauges(ceres::Problem& problem, const PoseBlocks& blocks) {
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
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<YawGaugeResidual, 4, 7>(
                                   new YawGaugeResidual(start_.at(component.gauge_node))),
                               nullptr, block);
    else
      problem.SetParameterBlockConstant(block);
  }
}

void Optimization::solve() {
  find_components();
  const PoseBlocks blocks(result_.map_from_base);
  ceres::Problem problem;
  bool any = false;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (!used_[n] || result_.links[n].rejected) continue;
    const PoseLink& link = result_.links[n].link;
    any = true;
    add_link(problem, blocks, link, link.information, new_loss());
  }
  if (!any) return;
  set_pose_manifolds(problem, blocks);
  hold_gauges(problem, blocks);
  ceres::Solver::Options settings;
  settings.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // CHOLMOD's supernodes pay where much fills in.
  settings.sparse_linear_algebra_library_type =
      blocks.all().size() < simplicial_below ? ceres::EIGEN_SPARSE : ceres::SUITE_SPARSE;
  settings.num_threads = 1;
  settings.max_num_iterations = 100;
  settings.function_tolerance = 1e-12;
  settings.gradient_tolerance = 1e-12;
  settings.parameter_tolerance = 1e-12;
  settings.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(settings, &problem, &summary);
  take_poses(problem, blocks, result_.map_from_base);
  result_.initial_cost = summary.initial_cost;
  result_.final_cost = summary.final_cost;
  result_.iterations += static_cast<int>(summary.iterations.size());
  result_.converged = summary.IsSolutionUsable();
}

Vector6d residual_of(const PoseLink& link, const std::map<int, Pose>& poses) {
  if (link.type == LinkType::pose_prior)
    return step_between(link.from_from_to, poses.at(link.from));
  if (link.type == LinkType::gravity) {
    Vector6d step = Vector6d::Zero();
    const Eigen::Vector3d up = poses.at(link.from).linear().transpose() * Eigen::Vector3d::UnitZ();
    step.tail<3>() = (link.from_from_to.linear().transpose() * Eigen::Vector3d::UnitZ()).cross(up);
    return step;
  }
  return step_between(link.from_from_to, poses.at(link.from).inverse() * poses.at(link.to));
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

// The closures that contradict the rest most.
bool Optimization::reject() {
  double worst = options_.max_chi_square;
  for (std::size_t n = 0; n < links_.size(); ++n)
    if (used_[n] && links_[n].may_be_rejected && !result_.links[n].rejected)
      worst = std::max(worst, result_.links[n].chi_square);
  if (worst <= options_.max_chi_square) return false;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    GraphLinkResult& link = result_.links[n];
    if (used_[n] && links_[n].may_be_rejected && !link.rejected &&
        link.chi_square > std::max(options_.max_chi_square, worst_share * worst))
      link.rejected = true;
  }
  return true;
}

// The variance of a group by its links' squares over their redundancies (Foerstner 1979), each link
// apart, and of these the median: up to half of a group may be wrong. 0 where too few links can be
// told by the others.
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
    // Translation and rotation apart where the link tells them apart.
    const bool apart = link.information.topRightCorner<3, 3>().isZero(0.0);
    const Matrix6d share = link.information * covariance.of_relative(link.from, link.to);
    for (std::size_t part = 0; part < 2; ++part) {
      const auto first = static_cast<Eigen::Index>(apart ? 3 * part : 0);
      const Eigen::Index size = apart ? 3 : 6;
      const double all = static_cast<double>(size);
      const double redundancy = all - share.diagonal().segment(first, size).sum();
      if (redundancy < min_redundancy * all) continue;
      const double square = residual.segment(first, size)
                                .dot(link.information.block(first, first, size, size) *
                                     residual.segment(first, size));
      result_.groups[group].redundancy += apart ? redundancy : 0.5 * redundancy;
      // The median of chi-square lies below its mean (Wilson and Hilferty 1931).
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
    // Not by covariances as stated, if they are to be recalibrated.
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
            "scale the stated covariances of each type of links to their residuals");
  table.add("recalibrations", options.recalibrations, {1}, "rounds of that, at most");
  table.add("robust_scale", options.robust_scale, not_negative,
            "of Cauchy's loss, standard deviations of a link; 0: plain least squares");
  table.add("max_chi_square", options.max_chi_square, positive,
            "of a closure's residuals; closures with more are rejected");
  table.add("gauge_node", options.gauge_node, not_negative,
            "node that stays where it is; 0: the first");
}

PoseGraphResult optimize_pose_graph(const std::map<int, Pose>& map_from_base,
                                    const std::vector<GraphLink>& links,
                                    const PoseGraphOptions& options) {
  check_parameters(options);
  return Optimization(map_from_base, links, options).run();
}

}  // namespace libmap
