#include "libmap/optimize/icp_refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/features/surface_samples.h"
#include "libmap/geometry/least_squares.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/symmetric_eigen.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/optimize/icp_pairs.h"

namespace libmap {

namespace {

constexpr double robust_scale = 2.5;  // of Geman and McClure's loss, standard deviations
// Graduated alignment.
constexpr double graduation = 0.5;      // width of the loss per maximum distance
constexpr double graduated_fall = 0.8;  // factor of the maximum distance per step
constexpr double noise_reach = 4.0;     // minimum of the maximum distance, standard deviations
constexpr double min_distance_m = 0.004;
constexpr double settled_step = 2e-6;
constexpr double max_step = 0.2;  // m and rad
constexpr double cell_m = 0.25;   // residuals within one cell of the map are correlated
constexpr std::size_t max_cells = 400;
constexpr std::size_t frames_per_cell_interval = 100;

// align_pair
constexpr double guess_m = 0.15;  // standard deviations of the initial guess
constexpr double guess_rad = 0.1;
constexpr double pair_degenerate = 1e-4;
constexpr std::size_t min_pair_samples = 300;  // matched samples
constexpr double min_pair_fraction = 0.4;      // matched share of a pair's samples
constexpr double max_pair_rms_m = 0.012;
constexpr int pair_agreement_samples = 300;
constexpr double pair_agreement_m = 0.005;
constexpr double min_pair_agreement = 0.95;

using Cell = std::array<int, 3>;

// Selects one cell in `interval` by a hash of the cell.
bool is_drawn(const Cell& cell, std::uint64_t interval) {
  std::uint64_t bits = 0;
  for (const int number : cell) bits = mix_bits(bits, static_cast<std::uint64_t>(number));
  return bits % interval == 0;
}

// Normal equations of one pair in steps of a_from_b.
struct PairEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d rhs = Vector6d::Zero();
  std::map<Cell, Vector6d> rhs_of_cell;  // for the selected cells
  double squares_m2 = 0.0;
  double weight = 0.0;
  std::size_t samples = 0;
  std::size_t degenerate = 0;

  void add(const PairEquations& other) {
    information += other.information;
    rhs += other.rhs;
    for (const auto& [cell, cell_rhs] : other.rhs_of_cell)
      rhs_of_cell.try_emplace(cell, Vector6d::Zero()).first->second += cell_rhs;
    squares_m2 += other.squares_m2;
    weight += other.weight;
    samples += other.samples;
  }
};

class Alignment {
 public:
  Alignment(const std::vector<FrameFeatures>& frames, const std::map<int, Pose>& poses,
            const BlockSystem& prior, const std::vector<GraphComponent>& components,
            const IcpOptions& options)
      : frames_(frames), start_(poses), prior_(prior), components_(components), options_(options) {
    result_.map_from_base = poses;
    for (const auto& [node, pose] : poses) row_.emplace(node, row_.size());
  }

  IcpResult run(const std::vector<PoseLink>& links, Progress& progress);
  BlockSystem system_of(const std::vector<FramePair>& pairs, double max_distance_m) {
    pairs_ = pairs;
    BlockSystem system(row_.size());
    add_pairs(max_distance_m, system);
    return system;
  }

 private:
  const Pose* pose_of(std::size_t frame) const {
    const auto pose = result_.map_from_base.find(frames_[frame].node);
    return pose == result_.map_from_base.end() ? nullptr : &pose->second;
  }
  PairEquations half_of(const std::vector<PlacedElement>& samples, std::size_t onto,
                        const Pose& onto_from_from, bool from_is_a, double max_distance_m,
                        std::uint64_t cell_interval) const;
  std::vector<PairEquations> all_equations(double max_distance_m,
                                           std::uint64_t cell_interval) const;
  void drop_degenerate(PairEquations& equations) const;
  void add_prior(BlockSystem& system) const;
  double add_pairs(double max_distance_m, BlockSystem& system);
  double step(double max_distance_m, double& rms_m);
  double deviation_scale(double max_distance_m) const;

  const std::vector<FrameFeatures>& frames_;
  std::map<int, Pose> start_;
  const BlockSystem& prior_;
  const std::vector<GraphComponent>& components_;
  const IcpOptions& options_;
  std::map<int, std::size_t> row_;
  std::vector<FramePair> pairs_;
  IcpResult result_;
};

// Equations of a frame's samples against the planes of `onto`, in steps (t, r) of a_from_b. If the
// frame is b, a sample p moves to p + t + r x p before a_from_b; if it is a, by the inverse.
PairEquations Alignment::half_of(const std::vector<PlacedElement>& samples, std::size_t onto,
                                 const Pose& onto_from_from, bool from_is_a, double max_distance_m,
                                 std::uint64_t cell_interval) const {
  PairEquations equations;
  const double min_cosine = std::cos(options_.max_normal_angle_deg * std::numbers::pi / 180.0);
  for (const PlacedElement& sample : samples) {
    const Eigen::Vector3d point = onto_from_from * sample.point;
    PlacedElement plane;
    if (!element_at(frames_[onto], point, plane)) continue;
    const Eigen::Vector3d normal = onto_from_from.linear() * sample.normal;
    if (plane.normal.dot(normal) < min_cosine) continue;
    const double distance = plane.normal.dot(point - plane.point);
    const double variance = sample.noise_m * sample.noise_m + plane.noise_m * plane.noise_m;
    const double deviation = std::sqrt(variance);
    const double reach_m =
        options_.graduated ? std::max(max_distance_m, noise_reach * deviation) : max_distance_m;
    if (std::abs(distance) > reach_m) continue;
    const double square = distance * distance / variance;
    const double width = options_.graduated
                             ? std::max(robust_scale, graduation * max_distance_m / deviation)
                             : robust_scale;
    const double root = 1.0 + square / (width * width);
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
    // The noise of both normals is independent. Products of one normal with the other are free of
    // squared noise, which would constrain motions along a plane (instrumental variables, Durbin
    // 1954).
    const Vector6d by_plane = jacobian_by(plane.normal);
    const Vector6d by_sample = jacobian_by(normal);
    equations.information +=
        (0.5 * weight) * (by_sample * by_plane.transpose() + by_plane * by_sample.transpose());
    equations.rhs -= weight * distance * by_sample;
    if (cell_interval > 0) {
      const Eigen::Vector3d in_cells = *pose_of(onto) * point / cell_m;
      const Cell cell = {static_cast<int>(std::floor(in_cells.x())),
                         static_cast<int>(std::floor(in_cells.y())),
                         static_cast<int>(std::floor(in_cells.z()))};
      if (is_drawn(cell, cell_interval))
        equations.rhs_of_cell.try_emplace(cell, Vector6d::Zero()).first->second -=
            weight * distance * by_sample;
    }
    equations.squares_m2 += distance * distance / (root * root);
    equations.weight += 1.0 / (root * root);
    ++equations.samples;
  }
  return equations;
}

// Removes the information about directions that a pair hardly constrains, such as along a plane,
// because it comes from the noise of the normals (Zhang, Kaess and Singh 2016). Rotations in
// radians are compared with translations in meters.
void Alignment::drop_degenerate(PairEquations& equations) const {
  const SymmetricEigen<6> eigen = symmetric_eigen(equations.information);
  const double least = options_.max_degenerate_ratio * eigen.values[5];
  Matrix6d kept = Matrix6d::Zero();
  for (int n = 0; n < 6; ++n) {
    if (eigen.values[n] < least || !(eigen.values[n] > 0.0)) {
      ++equations.degenerate;
      continue;
    }
    kept += eigen.vectors.col(n) * eigen.vectors.col(n).transpose();
  }
  equations.information = kept * equations.information * kept;
  equations.rhs = kept * equations.rhs;
  for (auto& [cell, rhs] : equations.rhs_of_cell) rhs = kept * rhs;
}

// Adds the prior's normal equations at the current poses.
void Alignment::add_prior(BlockSystem& system) const {
  system.add(prior_);
  system.clear_rhs();
  std::vector<Vector6d> steps;
  for (const auto& [node, pose] : result_.map_from_base)
    steps.push_back(step_between(start_.at(node), pose));
  for (const auto& [key, block] : prior_.blocks()) {
    system.add_rhs(key.first, -block * steps[key.second]);
    if (key.first != key.second) system.add_rhs(key.second, -block.transpose() * steps[key.first]);
  }
}

// Returns the equations of all pairs, computed by frame to limit the samples in memory. Right-hand
// sides by cell are set for one cell in cell_interval; 0: none.
std::vector<PairEquations> Alignment::all_equations(double max_distance_m,
                                                    std::uint64_t cell_interval) const {
  std::vector<std::vector<std::size_t>> pairs_of_frame(frames_.size());
  for (std::size_t n = 0; n < pairs_.size(); ++n) {
    pairs_of_frame[pairs_[n].first].push_back(n);
    pairs_of_frame[pairs_[n].second].push_back(n);
  }
  std::vector<PairEquations> of_first(pairs_.size());
  std::vector<PairEquations> of_second(pairs_.size());
  parallel_each(frames_.size(), [&](std::size_t frame) {
    if (pairs_of_frame[frame].empty()) return;
    const std::vector<PlacedElement> samples =
        surface_samples(frames_[frame], options_.samples, SampleUse::estimation);
    for (const std::size_t n : pairs_of_frame[frame]) {
      const bool is_a = pairs_[n].first == frame;
      const std::size_t other = is_a ? pairs_[n].second : pairs_[n].first;
      (is_a ? of_first : of_second)[n] =
          half_of(samples, other, pose_of(other)->inverse() * *pose_of(frame), is_a, max_distance_m,
                  cell_interval);
    }
  });
  parallel_each(pairs_.size(), [&](std::size_t n) {
    of_second[n].add(of_first[n]);
    drop_degenerate(of_second[n]);
  });
  return of_second;
}

// Adds the equations of the pairs to `system`. Returns the root mean square distance.
double Alignment::add_pairs(double max_distance_m, BlockSystem& system) {
  const std::vector<PairEquations> equations = all_equations(max_distance_m, 0);
  double squares = 0.0;
  double weight = 0.0;
  result_.samples = 0;
  result_.degenerate_directions = 0;
  for (std::size_t n = 0; n < pairs_.size(); ++n) {
    const std::size_t a = row_.at(frames_[pairs_[n].first].node);
    const std::size_t b = row_.at(frames_[pairs_[n].second].node);
    const RelativeJacobian jacobian =
        relative_jacobian(pose_of(pairs_[n].first)->inverse() * *pose_of(pairs_[n].second));
    system.add_pair(a, b, jacobian.by_a, jacobian.by_b, equations[n].information, equations[n].rhs);
    squares += equations[n].squares_m2;
    weight += equations[n].weight;
    result_.samples += equations[n].samples;
    result_.degenerate_directions += equations[n].degenerate;
  }
  return weight > 0.0 ? std::sqrt(squares / weight) : 0.0;
}

// Gauss-Newton step. Returns the largest motion of a pose (m or rad), infinity if it failed.
double Alignment::step(double max_distance_m, double& rms_m) {
  BlockSystem system(row_.size());
  add_prior(system);
  rms_m = add_pairs(max_distance_m, system);
  result_.information = system;
  result_.information.clear_rhs();
  const BlockSystem bound = fix_gauges(system, result_.map_from_base, components_);
  const BlockSolver solver(bound, 1e-6);
  if (!solver.valid()) return std::numeric_limits<double>::infinity();
  const std::vector<Vector6d> moves = solver.solve(bound.rhs());
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

// Ratio of the poses' errors to those from independent residuals: the larger of two estimates.
// First, the cluster-robust covariance (Liang and Zeger 1986) relative to the inverse information,
// averaged over all unknowns: residuals in one cell of the map share noise and depth errors.
// Second, the chi-square of the motion of the poses from the prior, whose noise is independent of
// the surfaces (Birge 1932).
double Alignment::deviation_scale(double max_distance_m) const {
  BlockSystem system(row_.size());
  add_prior(system);
  std::map<Cell, std::map<std::size_t, Vector6d>> sides;
  // For a long scan, only a sample of the cells is in memory; about max_cells suffice.
  const std::uint64_t interval = 1 + frames_.size() / frames_per_cell_interval;
  const std::vector<PairEquations> equations = all_equations(max_distance_m, interval);
  for (std::size_t n = 0; n < pairs_.size(); ++n) {
    const std::size_t a = row_.at(frames_[pairs_[n].first].node);
    const std::size_t b = row_.at(frames_[pairs_[n].second].node);
    const RelativeJacobian jacobian =
        relative_jacobian(pose_of(pairs_[n].first)->inverse() * *pose_of(pairs_[n].second));
    for (const auto& [cell, rhs] : equations[n].rhs_of_cell) {
      auto& of_cell = sides[cell];
      of_cell.try_emplace(a, Vector6d::Zero()).first->second += jacobian.by_a.transpose() * rhs;
      of_cell.try_emplace(b, Vector6d::Zero()).first->second += jacobian.by_b.transpose() * rhs;
    }
  }
  const BlockSolver solver(fix_gauges(result_.information, result_.map_from_base, components_),
                           1e-6);
  if (!solver.valid() || sides.empty()) return 1.0;
  const auto square = [&](const std::vector<Vector6d>& side) {
    const std::vector<Vector6d> solved = solver.solve(side);
    double sum = 0.0;
    for (std::size_t n = 0; n < side.size(); ++n) sum += side[n].dot(solved[n]);
    return sum;
  };
  const std::size_t stride = (sides.size() + max_cells - 1) / max_cells;
  double squares = 0.0;
  std::size_t number = 0;
  std::size_t used = 0;
  for (const auto& [cell, of_cell] : sides) {
    if (number++ % stride != 0) continue;
    ++used;
    std::vector<Vector6d> side(row_.size(), Vector6d::Zero());
    for (const auto& [row, part] : of_cell) side[row] = part;
    squares += square(side);
  }
  squares *= static_cast<double>(interval * sides.size()) / static_cast<double>(used);
  const double unknowns = 6.0 * static_cast<double>(row_.size() - components_.size());
  if (!(unknowns > 0.0)) return 1.0;
  double way = 0.0;
  std::size_t row = 0;
  for (const auto& [node, pose] : result_.map_from_base)
    way -= step_between(start_.at(node), pose).dot(system.rhs()[row++]);
  const BlockSystem inverse = solver.selected_inverse(prior_);
  double bound = unknowns;  // degrees of freedom that the prior does not determine
  for (const auto& [key, block] : prior_.blocks())
    bound -= (key.first == key.second ? 1.0 : 2.0) *
             block.cwiseProduct(inverse.block(key.first, key.second)).sum();
  const double by_way = bound > 1.0 ? way / bound : 0.0;
  return std::sqrt(std::max({1.0, (squares + square(system.rhs())) / unknowns, by_way}));
}

IcpResult Alignment::run(const std::vector<PoseLink>& links, Progress& progress) {
  pairs_ = options_.mode == IcpMode::links
               ? linked_pairs(frames_, start_, links)
               : overlapping_pairs(frames_, start_, components_, options_);
  result_.pairs = pairs_.size();
  result_.information = prior_;
  if (pairs_.empty()) return std::move(result_);
  progress.begin("surfaces", static_cast<std::size_t>(options_.iterations));
  double max_distance_m = options_.max_distance_m;
  const GaussNewtonSummary summary = gauss_newton(options_.iterations, [&] {
    double rms_m = 0.0;
    const double farthest = step(max_distance_m, rms_m);
    if (result_.iterations++ == 0) result_.initial_rms_m = rms_m;
    result_.final_rms_m = rms_m;
    progress.advance(1);
    const bool tight = max_distance_m <= min_distance_m + 4.0 * rms_m;
    max_distance_m = std::max({(options_.graduated ? graduated_fall : 0.6) * max_distance_m,
                               min_distance_m, options_.graduated ? 0.0 : 4.0 * rms_m});
    if (!(farthest < max_step)) return StepState::failed;
    return tight && farthest < settled_step ? StepState::converged : StepState::moving;
  });
  progress.end();
  if (summary.state == StepState::failed) {
    // Divergence of unconstrained poses: the input is returned.
    result_.map_from_base = start_;
    result_.information = prior_;
    return std::move(result_);
  }
  result_.converged = summary.state == StepState::converged;
  result_.deviation_scale = deviation_scale(max_distance_m);
  BlockSystem honest(row_.size());
  const double factor = 1.0 / (result_.deviation_scale * result_.deviation_scale);
  for (const auto& [key, block] : result_.information.blocks())
    honest.add(key.first, key.second, factor * block);
  result_.information = std::move(honest);
  result_.frame_pairs = std::move(pairs_);
  result_.max_distance_m = max_distance_m;
  return std::move(result_);
}

// Share of the samples of `a` observed by `b` that agree with b's surface. Samples behind b's
// surface are occluded and not counted.
double agreement_of(const FrameFeatures& a, const FrameFeatures& b, const Pose& b_from_a) {
  double seen = 0.0;
  double agreed = 0.0;
  for (const PlacedElement& sample :
       surface_samples(a, pair_agreement_samples, SampleUse::estimation)) {
    PlacedElement element;
    const Eigen::Vector3d point = b_from_a * sample.point;
    if (!element_at(b, point, element)) continue;
    const double above = element.normal.dot(point - element.point);
    const double allowed = pair_agreement_m + 3.0 * std::hypot(element.noise_m, sample.noise_m);
    if (above < -allowed) continue;
    seen += 1.0;
    if (above <= allowed) agreed += 1.0;
  }
  return seen > 0.0 ? agreed / seen : 0.0;
}

}  // namespace

void bind(ParameterTable& table, IcpOptions& options) {
  table.add("icp", options.mode,
            {{"off", IcpMode::off}, {"links", IcpMode::links}, {"global", IcpMode::global}},
            "frame pairs that ICP aligns; off: none; links: pairs with a link; global: overlapping "
            "pairs");
  table.add("icp_iterations", options.iterations, {1, 1000}, "maximum number of ICP iterations");
  table.add("icp_pairs", options.pairs_per_frame, {1, 1000},
            "with --icp global: number of most overlapping frames to which each frame is aligned");
  table.add("icp_samples", options.samples, {1, 1000000},
            "approximate number of surface samples per frame for ICP");
  table.add(
      "icp_distance_m", options.max_distance_m, positive,
      "first ICP iteration: maximum distance between a sample and another frame's surface, m");
  table.add("icp_degenerate", options.max_degenerate_ratio, zero_to_one,
            "eigenvalue of ICP's information matrix, relative to the largest, below which motion "
            "along the eigenvector is ignored");
  table.add("icp_correlation", options.correlation, {1.0},
            "number of ICP samples that count as one, because neighboring samples are correlated");
}

IcpResult align_surfaces(const std::vector<FrameFeatures>& frames,
                         const std::map<int, Pose>& map_from_base, const BlockSystem& prior,
                         const std::vector<GraphComponent>& components,
                         const std::vector<PoseLink>& links, const IcpOptions& options,
                         Progress& progress) {
  if (prior.size() != map_from_base.size())
    throw Error("differs from the number of poses",
                {.field = "blocks of the prior",
                 .value = std::to_string(prior.size()),
                 .bound = std::to_string(map_from_base.size())});
  return Alignment(frames, map_from_base, prior, components, options).run(links, progress);
}

BlockSystem surface_system(const std::vector<FrameFeatures>& frames,
                           const std::map<int, Pose>& map_from_base,
                           const std::vector<FramePair>& pairs, double max_distance_m,
                           const IcpOptions& options) {
  const BlockSystem nothing(map_from_base.size());
  return Alignment(frames, map_from_base, nothing, {}, options).system_of(pairs, max_distance_m);
}

std::optional<PoseLink> align_pair(const FrameFeatures& a, const FrameFeatures& b,
                                   const Pose& a_from_b) {
  IcpOptions options;
  options.mode = IcpMode::links;
  options.iterations = 40;
  options.graduated = true;
  options.max_distance_m = guess_m;
  options.max_degenerate_ratio = pair_degenerate;
  const std::size_t side_of_b = a.node < b.node ? 1 : 0;
  BlockSystem prior(2);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(guess_m * guess_m),
      Eigen::Vector3d::Constant(guess_rad * guess_rad);
  prior.add(side_of_b, side_of_b, variances.cwiseInverse().asDiagonal());
  PoseLink link{.from = a.node, .to = b.node, .type = LinkType::neighbor};
  const std::map<int, Pose> poses = {{a.node, Pose::Identity()}, {b.node, a_from_b}};
  const IcpResult aligned =
      align_surfaces({a, b}, poses, prior, {{{a.node, b.node}, a.node}}, {link}, options);
  const std::size_t all = surface_samples(a, options.samples, SampleUse::estimation).size() +
                          surface_samples(b, options.samples, SampleUse::estimation).size();
  if (aligned.samples < min_pair_samples ||
      static_cast<double>(aligned.samples) < min_pair_fraction * static_cast<double>(all) ||
      aligned.final_rms_m > max_pair_rms_m)
    return std::nullopt;
  link.from_from_to = aligned.map_from_base.at(b.node);
  if (std::min(agreement_of(a, b, link.from_from_to.inverse()),
               agreement_of(b, a, link.from_from_to)) < min_pair_agreement)
    return std::nullopt;
  link.information = aligned.information.block(side_of_b, side_of_b);
  return link;
}

}  // namespace libmap
