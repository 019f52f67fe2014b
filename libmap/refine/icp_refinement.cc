#include "libmap/refine/icp_refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/point_tree.h"
#include "libmap/core/symmetric_eigen.h"
#include "libmap/refine/rigid_motion.h"
#include "libmap/refine/surface_samples.h"

namespace libmap {

namespace {

constexpr int overlap_samples = 300;
constexpr double reach_m = 2.5;  // frames further apart are not tried
constexpr double view_angle_deg = 100.0;
constexpr std::size_t max_candidates = 24;
constexpr std::size_t nearest_considered = 8 * max_candidates;
constexpr double robust_scale = 2.5;  // of Geman and McClure's loss, standard deviations
constexpr double min_distance_m = 0.004;
constexpr double settled_m = 2e-6;
constexpr double farthest_step = 0.2;  // m and rad

double overlap_of(const std::vector<BaseElement>& samples, const FrameFeatures& other,
                  const Pose& other_from_base) {
  if (samples.empty()) return 0.0;
  double seen = 0.0;
  for (const BaseElement& sample : samples) {
    BaseElement element;
    const Eigen::Vector3d point = other_from_base * sample.point;
    if (seen_from_base(other, point, element) &&
        std::abs(element.normal.dot(point - element.point)) < 0.05)
      seen += 1.0;
  }
  return seen / static_cast<double>(samples.size());
}

using FramePair = std::pair<std::size_t, std::size_t>;

// Normal equations of one pair in steps of a_from_b.
struct PairEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d side = Vector6d::Zero();
  double squares_m2 = 0.0;
  double weight = 0.0;
  std::size_t samples = 0;
  std::size_t degenerate = 0;
};

class Alignment {
 public:
  Alignment(const std::vector<FrameFeatures>& frames, const std::map<int, Pose>& poses,
            const BlockSystem& prior, const std::vector<GraphComponent>& components,
            const IcpOptions& options)
      : frames_(frames), start_(poses), prior_(prior), components_(components), options_(options) {
    result_.map_from_base = poses;
    for (const auto& [node, pose] : poses) place_.emplace(node, place_.size());
    for (std::size_t n = 0; n < components.size(); ++n)
      for (const int node : components[n].nodes) component_[node] = n;
  }

  IcpResult run(const std::vector<PoseLink>& links, Progress& progress);

 private:
  const Pose* pose_of(std::size_t frame) const {
    const auto pose = result_.map_from_base.find(frames_[frame].node);
    return pose == result_.map_from_base.end() ? nullptr : &pose->second;
  }
  void pairs_of_links(const std::vector<PoseLink>& links);
  void pairs_by_overlap();
  std::vector<std::size_t> candidates_of(const PointTree& neighbors,
                                         const std::vector<std::size_t>& posed,
                                         std::size_t n) const;
  void accumulate(std::size_t from, std::size_t onto, const Pose& onto_from_from, bool from_is_a,
                  double max_distance_m, PairEquations& equations) const;
  PairEquations equations_of(FramePair pair, double max_distance_m) const;
  void drop_degenerate(PairEquations& equations) const;
  void add_prior(BlockSystem& system) const;
  double add_pairs(double max_distance_m, BlockSystem& system);
  double step(double max_distance_m, double& rms_m);

  const std::vector<FrameFeatures>& frames_;
  std::map<int, Pose> start_;
  const BlockSystem& prior_;
  const std::vector<GraphComponent>& components_;
  const IcpOptions& options_;
  std::map<int, std::size_t> place_;
  std::map<int, std::size_t> component_;
  std::vector<std::vector<BaseElement>> samples_;
  std::vector<FramePair> pairs_;
  IcpResult result_;
};

void Alignment::pairs_of_links(const std::vector<PoseLink>& links) {
  std::map<int, std::size_t> frame_of;
  for (std::size_t f = 0; f < frames_.size(); ++f) frame_of[frames_[f].node] = f;
  std::set<FramePair> pairs;
  for (const PoseLink& link : links) {
    const auto a = frame_of.find(link.from);
    const auto b = frame_of.find(link.to);
    if (a == frame_of.end() || b == frame_of.end() || a == b) continue;
    if (pose_of(a->second) == nullptr || pose_of(b->second) == nullptr) continue;
    pairs.insert(std::minmax(a->second, b->second));
  }
  pairs_.assign(pairs.begin(), pairs.end());
}

// Frames that may see what the n-th of those with a pose sees.
std::vector<std::size_t> Alignment::candidates_of(const PointTree& neighbors,
                                                  const std::vector<std::size_t>& posed,
                                                  std::size_t n) const {
  const std::size_t frame = posed[n];
  const Pose& pose = *pose_of(frame);
  std::vector<std::pair<double, std::size_t>> ranked;
  for (const auto& [near, square_m2] : neighbors.around(n, nearest_considered, reach_m)) {
    const std::size_t other = posed[near];
    if (component_.at(frames_[frame].node) != component_.at(frames_[other].node)) continue;
    const double angle =
        rotation_vector_of(pose.linear().transpose() * pose_of(other)->linear()).norm() * 180.0 /
        std::numbers::pi;
    if (angle > view_angle_deg) continue;
    ranked.emplace_back(std::sqrt(square_m2) / reach_m + angle / view_angle_deg, other);
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), max_candidates));
  std::vector<std::size_t> candidates;
  candidates.reserve(ranked.size());
  for (const auto& [measure, other] : ranked) candidates.push_back(other);
  return candidates;
}

void Alignment::pairs_by_overlap() {
  std::vector<std::size_t> posed;
  std::vector<Eigen::Vector3d> places;
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    if (pose_of(f) == nullptr) continue;
    posed.push_back(f);
    places.emplace_back(pose_of(f)->translation());
  }
  if (posed.empty()) return;
  const PointTree neighbors(places);
  std::vector<std::vector<FramePair>> of_frame(posed.size());
  parallel_for(posed.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const std::size_t f = posed[n];
      const std::vector<BaseElement> few =
          surface_samples(frames_[f], overlap_samples, SampleUse::estimation);
      std::vector<std::pair<double, std::size_t>> ranked;
      for (const std::size_t other : candidates_of(neighbors, posed, n)) {
        const double share =
            overlap_of(few, frames_[other], pose_of(other)->inverse() * *pose_of(f));
        if (share >= options_.min_overlap) ranked.emplace_back(-share, other);
      }
      std::sort(ranked.begin(), ranked.end());
      ranked.resize(std::min(ranked.size(), static_cast<std::size_t>(options_.pairs_per_frame)));
      for (const auto& [share, other] : ranked) of_frame[n].push_back(std::minmax(f, other));
    }
  });
  std::set<FramePair> pairs;
  for (const auto& some : of_frame) pairs.insert(some.begin(), some.end());
  pairs_.assign(pairs.begin(), pairs.end());
}

// Samples of `from` against the planes of `onto`. Residuals are linear in the step of a_from_b,
// where `from` is b: p -> p + t + r x p before a_from_b; and where it is a, the inverse.
void Alignment::accumulate(std::size_t from, std::size_t onto, const Pose& onto_from_from,
                           bool from_is_a, double max_distance_m, PairEquations& equations) const {
  const double min_cosine = std::cos(options_.max_normal_angle_deg * std::numbers::pi / 180.0);
  for (const BaseElement& sample : samples_[from]) {
    const Eigen::Vector3d point = onto_from_from * sample.point;
    BaseElement plane;
    if (!seen_from_base(frames_[onto], point, plane)) continue;
    const Eigen::Vector3d normal = onto_from_from.linear() * sample.normal;
    if (plane.normal.dot(normal) < min_cosine) continue;
    const double distance = plane.normal.dot(point - plane.point);
    if (std::abs(distance) > max_distance_m) continue;
    const double variance = sample.noise_m * sample.noise_m + plane.noise_m * plane.noise_m;
    const double square = distance * distance / variance;
    const double root = 1.0 + square / (robust_scale * robust_scale);
    const double weight = 1.0 / (root * root * variance * options_.correlation);
    const auto jacobian_by = [&](const Eigen::Vector3d& along) {
      Vector6d jacobian;
      if (from_is_a) {
        // `onto` is b: b_from_a p moves by -t - r x (b_from_a p).
        jacobian.head<3>() = -along;
        jacobian.tail<3>() = -point.cross(along);
      } else {
        const Eigen::Vector3d turned = onto_from_from.linear().transpose() * along;
        jacobian.head<3>() = turned;
        jacobian.tail<3>() = sample.point.cross(turned);
      }
      return jacobian;
    };
    // The two frames' normals have noise of their own: products of the one with the other are free
    // of its square, which would bind frames along a plane to where they are (instrumental
    // variables, Durbin 1954).
    const Vector6d by_plane = jacobian_by(plane.normal);
    const Vector6d by_sample = jacobian_by(normal);
    equations.information +=
        (0.5 * weight) * (by_sample * by_plane.transpose() + by_plane * by_sample.transpose());
    equations.side -= weight * distance * by_sample;
    equations.squares_m2 += distance * distance / (root * root);
    equations.weight += 1.0 / (root * root);
    ++equations.samples;
  }
}

// Directions that a pair hardly binds, such as along a plane, are given no information at all: what
// the noise of normals says about them is not to be believed (Zhang, Kaess and Singh 2016).
// Rotations count by the way that the surface moves at a meter.
void Alignment::drop_degenerate(PairEquations& equations) const {
  const SymmetricEigen<6> eigen = symmetric_eigen(equations.information);
  const double least = options_.degenerate * eigen.values[5];
  Matrix6d kept = Matrix6d::Zero();
  for (int n = 0; n < 6; ++n) {
    if (eigen.values[n] < least || !(eigen.values[n] > 0.0)) {
      ++equations.degenerate;
      continue;
    }
    kept += eigen.vectors.col(n) * eigen.vectors.col(n).transpose();
  }
  equations.information = kept * equations.information * kept;
  equations.side = kept * equations.side;
}

PairEquations Alignment::equations_of(FramePair pair, double max_distance_m) const {
  PairEquations equations;
  const Pose a_from_b = pose_of(pair.first)->inverse() * *pose_of(pair.second);
  accumulate(pair.second, pair.first, a_from_b, false, max_distance_m, equations);
  accumulate(pair.first, pair.second, a_from_b.inverse(), true, max_distance_m, equations);
  drop_degenerate(equations);
  return equations;
}

// What the prior asks of the poses as they are.
void Alignment::add_prior(BlockSystem& system) const {
  system.add(prior_);
  system.clear_side();
  std::vector<Vector6d> steps;
  for (const auto& [node, pose] : result_.map_from_base)
    steps.push_back(step_between(start_.at(node), pose));
  for (const auto& [key, block] : prior_.blocks()) {
    system.add_side(key.first, -block * steps[key.second]);
    if (key.first != key.second) system.add_side(key.second, -block.transpose() * steps[key.first]);
  }
}

// What the surfaces of the pairs ask; their root mean square distance.
double Alignment::add_pairs(double max_distance_m, BlockSystem& system) {
  std::vector<PairEquations> equations(pairs_.size());
  parallel_for(pairs_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      equations[n] = equations_of(pairs_[n], max_distance_m);
  });
  double squares = 0.0;
  double weight = 0.0;
  result_.samples = 0;
  result_.degenerate_directions = 0;
  for (std::size_t n = 0; n < pairs_.size(); ++n) {
    const std::size_t a = place_.at(frames_[pairs_[n].first].node);
    const std::size_t b = place_.at(frames_[pairs_[n].second].node);
    const RelativeJacobian jacobian =
        relative_jacobian(pose_of(pairs_[n].first)->inverse() * *pose_of(pairs_[n].second));
    const Matrix6d& information = equations[n].information;
    system.add(a, a, jacobian.by_a.transpose() * information * jacobian.by_a);
    system.add(a, b, jacobian.by_a.transpose() * information * jacobian.by_b);
    system.add(b, b, jacobian.by_b.transpose() * information * jacobian.by_b);
    system.add_side(a, jacobian.by_a.transpose() * equations[n].side);
    system.add_side(b, jacobian.by_b.transpose() * equations[n].side);
    squares += equations[n].squares_m2;
    weight += equations[n].weight;
    result_.samples += equations[n].samples;
    result_.degenerate_directions += equations[n].degenerate;
  }
  return weight > 0.0 ? std::sqrt(squares / weight) : 0.0;
}

// One step of Gauss and Newton; how far the poses moved.
double Alignment::step(double max_distance_m, double& rms_m) {
  BlockSystem system(place_.size());
  add_prior(system);
  rms_m = add_pairs(max_distance_m, system);
  result_.information = system;
  result_.information.clear_side();
  // Gauge nodes stand still: what they are bound by is not asked.
  BlockSystem bound(place_.size());
  bound.add(system);
  for (const GraphComponent& component : components_)
    bound.add(place_.at(component.gauge_node), place_.at(component.gauge_node),
              1e12 * Matrix6d::Identity());
  const BlockSolver solver(bound, 1e-6);
  if (!solver.valid()) return std::numeric_limits<double>::infinity();
  const std::vector<Vector6d> moves = solver.solve(bound.side());
  double farthest = 0.0;
  std::size_t n = 0;
  std::set<int> held;
  for (const GraphComponent& component : components_) held.insert(component.gauge_node);
  for (auto& [node, pose] : result_.map_from_base) {
    if (!held.contains(node)) {
      pose = moved(pose, moves[n]);
      farthest = std::max({farthest, moves[n].head<3>().norm(), moves[n].tail<3>().norm()});
    }
    ++n;
  }
  return farthest;
}

IcpResult Alignment::run(const std::vector<PoseLink>& links, Progress& progress) {
  samples_.resize(frames_.size());
  parallel_for(frames_.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      samples_[f] = surface_samples(frames_[f], options_.samples, SampleUse::estimation);
  });
  if (options_.mode == IcpMode::links)
    pairs_of_links(links);
  else
    pairs_by_overlap();
  result_.pairs = pairs_.size();
  result_.information = prior_;
  if (pairs_.empty()) return std::move(result_);
  progress.begin("surfaces", static_cast<std::size_t>(options_.iterations));
  double max_distance_m = options_.max_distance_m;
  for (int n = 0; n < options_.iterations; ++n) {
    double rms_m = 0.0;
    const double farthest = step(max_distance_m, rms_m);
    if (n == 0) result_.initial_rms_m = rms_m;
    result_.final_rms_m = rms_m;
    ++result_.iterations;
    progress.advance(1);
    const bool tight = max_distance_m <= min_distance_m + 4.0 * rms_m;
    max_distance_m = std::max({0.6 * max_distance_m, min_distance_m, 4.0 * rms_m});
    if (!(farthest < farthest_step)) {
      // What nothing binds runs away: not a refinement.
      result_.map_from_base = start_;
      result_.information = prior_;
      break;
    }
    if (tight && farthest < settled_m) {
      result_.converged = true;
      break;
    }
  }
  progress.end();
  return std::move(result_);
}

}  // namespace

void bind(ParameterTable& table, IcpOptions& options) {
  table.add("icp", options.mode,
            {{"off", IcpMode::off}, {"links", IcpMode::links}, {"global", IcpMode::global}},
            "depth against depth: the frames that links join, or all that overlap");
  table.add("icp_iterations", options.iterations, {1, 1000}, "of it, at most");
  table.add("icp_pairs", options.pairs_per_frame, {1, 1000}, "frames that a frame is laid against");
  table.add("icp_samples", options.samples, {1, 1000000}, "of a frame");
  table.add("icp_distance_m", options.max_distance_m, positive,
            "between a sample and a surface, at first");
  table.add("icp_degenerate", options.degenerate, zero_to_one,
            "share of the best-bound direction's information below which a pair says nothing");
  table.add("icp_correlation", options.correlation, {1.0},
            "samples that tell as much as one independent one");
}

IcpResult align_surfaces(const std::vector<FrameFeatures>& frames,
                         const std::map<int, Pose>& map_from_base, const BlockSystem& prior,
                         const std::vector<GraphComponent>& components,
                         const std::vector<PoseLink>& links, const IcpOptions& options,
                         Progress& progress) {
  if (prior.size() != map_from_base.size())
    throw Error("does not match the number of frames with a pose",
                {.field = "blocks of the prior",
                 .value = std::to_string(prior.size()),
                 .bound = std::to_string(map_from_base.size())});
  return Alignment(frames, map_from_base, prior, components, options).run(links, progress);
}

}  // namespace libmap
