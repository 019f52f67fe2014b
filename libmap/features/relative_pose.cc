#include "libmap/features/relative_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/core/random_stream.h"
#include "libmap/features/bundle_residuals.h"
#include "libmap/features/match_loops.h"
#include "libmap/geometry/least_squares.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/robust.h"

namespace libmap {

namespace {

constexpr int max_steps = 20;

Eigen::Index padded(Eigen::Index count, int step) { return (count + step - 1) / step * step; }

// Nearest descriptors of both sets, MatchLoops::Output.
struct NearestDescriptors {
  std::vector<float> first_of_a;
  std::vector<float> second_of_a;
  std::vector<int> of_a;
  std::vector<int> of_b;
};

NearestDescriptors nearest_descriptors(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
  const Eigen::Index a_count = padded(a.cols(), MatchLoops::group);
  const Eigen::Index b_count = padded(b.cols(), MatchLoops::lanes);
  // The last descriptor is repeated, which does not change the first index of equal products.
  Eigen::MatrixXf of_a(a.rows(), a_count);
  of_a << a, a.rightCols<1>().replicate(1, a_count - a.cols());
  Eigen::MatrixXf of_b = Eigen::MatrixXf::Zero(b_count, b.rows());
  of_b.topRows(b.cols()) = b.transpose();
  std::vector<float> bias(static_cast<std::size_t>(b_count), 0.0F);
  std::fill(bias.begin() + b.cols(), bias.end(), -4.0F);
  std::vector<float> first_of_b(bias.size(), -2.0F);
  NearestDescriptors nearest;
  nearest.first_of_a.resize(static_cast<std::size_t>(a_count));
  nearest.second_of_a.resize(static_cast<std::size_t>(a_count));
  nearest.of_a.resize(static_cast<std::size_t>(a_count));
  nearest.of_b.resize(bias.size(), -1);
  static const MatchLoops& loops = match_loops_of(best_instruction_set());
  loops.find_nearest({of_a.data(), of_b.data(), bias.data(), static_cast<int>(a.rows()),
                      static_cast<int>(a_count), static_cast<int>(b_count)},
                     {nearest.first_of_a.data(), nearest.second_of_a.data(), nearest.of_a.data(),
                      first_of_b.data(), nearest.of_b.data()});
  return nearest;
}

struct PointPair {
  Eigen::Vector3d a;
  Eigen::Vector3d b;
};

Pose motion_of(const std::array<const PointPair*, 3>& pairs) {
  Eigen::Matrix3Xd a(3, 3);
  Eigen::Matrix3Xd b(3, 3);
  for (int n = 0; n < 3; ++n) {
    a.col(n) = pairs[static_cast<std::size_t>(n)]->a;
    b.col(n) = pairs[static_cast<std::size_t>(n)]->b;
  }
  return Pose(align_points(b, a, false));
}

// Returns true if the triangles in a and b have equal side lengths within `slack_m`.
bool is_congruent(const std::array<const PointPair*, 3>& pairs, double slack_m) {
  for (int n = 0; n < 3; ++n) {
    const PointPair& p = *pairs[static_cast<std::size_t>(n)];
    const PointPair& q = *pairs[static_cast<std::size_t>((n + 1) % 3)];
    const double in_a = (p.a - q.a).norm();
    const double in_b = (p.b - q.b).norm();
    if (in_a < slack_m || std::abs(in_a - in_b) > slack_m) return false;
  }
  return true;
}

class RelativePoseEstimate {
 public:
  RelativePoseEstimate(const FrameFeatures& a, const FrameFeatures& b,
                       const std::vector<FeatureMatch>& matches, const RelativePoseOptions& options)
      : a_(a), b_(b), matches_(matches), options_(options) {}

  RelativePose run(std::uint64_t seed) {
    RelativePose result;
    if (matches_.size() < enough_) return result;
    result.outcome = RelativePoseOutcome::too_few_inliers;
    if (!sample(seed)) return result;
    const bool converged = refine(result);
    for (const std::size_t n : inliers_) result.inliers.push_back(matches_[n]);
    result.a_from_b = pose_;
    if (inliers_.size() < least()) return result;
    result.spread = spread();
    result.outcome = !converged                            ? RelativePoseOutcome::not_converged
                     : result.spread < options_.min_spread ? RelativePoseOutcome::degenerate
                                                           : RelativePoseOutcome::found;
    return result;
  }

 private:
  std::size_t least() const {
    return std::max(enough_,
                    static_cast<std::size_t>(std::ceil(options_.min_inlier_fraction *
                                                       static_cast<double>(matches_.size()))));
  }

  std::vector<std::size_t> inliers_of(const Pose& pose, double max_chi_square) const {
    std::vector<std::size_t> inliers;
    for (std::size_t n = 0; n < matches_.size(); ++n) {
      const MatchResidual residual = match_residual(a_, b_, matches_[n], pose);
      if (residual.in_front && residual.chi_square() <= max_chi_square) inliers.push_back(n);
    }
    return inliers;
  }

  bool sample(std::uint64_t seed);
  bool refine(RelativePose& result);
  double spread() const;

  const FrameFeatures& a_;
  const FrameFeatures& b_;
  const std::vector<FeatureMatch>& matches_;
  const RelativePoseOptions& options_;
  const std::size_t enough_ = static_cast<std::size_t>(std::max(6, options_.min_inliers));
  Pose pose_ = Pose::Identity();
  std::vector<std::size_t> inliers_;
};

bool RelativePoseEstimate::sample(std::uint64_t seed) {
  // A motion from three points is less accurate than from all: three times the deviations.
  const double wide = 9.0 * options_.max_chi_square / 3.0;
  constexpr double slack_m = 0.03;
  std::vector<PointPair> pairs;
  for (const FeatureMatch& match : matches_)
    pairs.push_back({a_.point_in_base(static_cast<std::size_t>(match.a)),
                     b_.point_in_base(static_cast<std::size_t>(match.b))});
  RandomStream random(seed, 0);
  double needed = options_.ransac_iterations;
  for (int iteration = 0; iteration < options_.ransac_iterations && iteration < needed;
       ++iteration) {
    std::array<const PointPair*, 3> three{};
    for (int attempt = 0; attempt < 50; ++attempt) {
      for (auto& pair : three) pair = &pairs[random.below(pairs.size())];
      if (is_congruent(three, slack_m)) break;
      three[0] = nullptr;
    }
    if (three[0] == nullptr) continue;
    const Pose motion = motion_of(three);
    if (!motion.matrix().allFinite()) continue;
    std::vector<std::size_t> inliers = inliers_of(motion, wide);
    if (inliers.size() <= inliers_.size()) continue;
    inliers_ = std::move(inliers);
    pose_ = motion;
    // Congruent triples are correct more often than single matches, so this stops late.
    const double fraction =
        static_cast<double>(inliers_.size()) / static_cast<double>(pairs.size());
    needed = std::max(20.0, std::log(1e-4) / std::log(1.0 - std::pow(fraction, 3) + 1e-12));
  }
  return inliers_.size() >= enough_ / 2;
}

bool RelativePoseEstimate::refine(RelativePose& result) {
  double limit = 3.0 * options_.max_chi_square;
  const auto step = [&] {
    NormalEquations<6> equations;
    double chi_square = 0.0;
    inliers_.clear();
    for (std::size_t n = 0; n < matches_.size(); ++n) {
      const MatchResidual r = match_residual(a_, b_, matches_[n], pose_, true);
      if (!r.in_front) continue;
      const Eigen::LLT<Eigen::Matrix3d> root(r.covariance);
      const Eigen::Vector3d white = root.matrixL().solve(r.residual);
      const double square = white.squaredNorm();
      if (square > limit) continue;
      inliers_.push_back(n);
      const Eigen::Matrix<double, 3, 6> jacobian = root.matrixL().solve(r.jacobian);
      const double weight = cauchy_weight(square / options_.max_chi_square);
      equations.add(jacobian, white, weight);
      chi_square += weight * square;
    }
    if (inliers_.size() < 6) return StepState::failed;
    const Eigen::LDLT<Matrix6d> solver(equations.matrix);
    if (solver.info() != Eigen::Success || solver.rcond() < 1e-14) return StepState::failed;
    const Vector6d move = solver.solve(equations.rhs);
    pose_ = moved(pose_, move);
    const bool last = limit <= options_.max_chi_square;
    limit = std::max(options_.max_chi_square, limit / 1.7);
    if (!last || !(move.head<3>().norm() < 1e-7) || !(move.tail<3>().norm() < 1e-7))
      return StepState::moving;
    const double freedom = 3.0 * static_cast<double>(inliers_.size()) - 6.0;
    result.chi_square_per_freedom = chi_square / freedom;
    result.information = equations.matrix / std::max(1.0, result.chi_square_per_freedom);
    return StepState::converged;
  };
  return gauss_newton(max_steps, step).state == StepState::converged;
}

double RelativePoseEstimate::spread() const {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  const double count = static_cast<double>(inliers_.size());
  const auto ray = [&](std::size_t n) -> Eigen::Vector2d {
    // From the position in the base frame, so that several cameras are evaluated together.
    const Eigen::Vector3d point = a_.point_in_base(static_cast<std::size_t>(matches_[n].a));
    const Camera& camera = a_.cameras.front();
    const Eigen::Vector3d seen = camera.base_from_camera.inverse() * point;
    return seen.head<2>() / std::max(seen.norm(), 1e-9);
  };
  for (const std::size_t n : inliers_) mean += ray(n) / count;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const std::size_t n : inliers_) {
    const Eigen::Vector2d offset = ray(n) - mean;
    scatter += offset * offset.transpose() / count;
  }
  const double min_variance =
      scatter.trace() / 2.0 - std::hypot((scatter(0, 0) - scatter(1, 1)) / 2.0, scatter(0, 1));
  return 2.0 * std::sqrt(std::max(0.0, min_variance));
}

}  // namespace

std::vector<FeatureMatch> match_features(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                                         double max_ratio) {
  std::vector<FeatureMatch> matches;
  if (a.cols() == 0 || b.cols() == 0 || a.rows() != b.rows()) return matches;
  const NearestDescriptors nearest = nearest_descriptors(a, b);
  const auto limit = static_cast<float>(max_ratio * max_ratio);
  for (std::size_t n = 0; n < static_cast<std::size_t>(a.cols()); ++n) {
    const int of_a = nearest.of_a[n];
    // |x - y|^2 = 2 - 2 x.y for unit vectors; max() covers rounding.
    const float best_square = std::max(0.0F, 1.0F - nearest.first_of_a[n]);
    const float next_square = std::max(0.0F, 1.0F - nearest.second_of_a[n]);
    if (of_a >= 0 && nearest.of_b[static_cast<std::size_t>(of_a)] == static_cast<int>(n) &&
        (max_ratio >= 1.0 || best_square < limit * next_square))
      matches.push_back({static_cast<int>(n), of_a});
  }
  return matches;
}

double MatchResidual::chi_square() const { return residual.dot(covariance.llt().solve(residual)); }

MatchResidual match_residual(const FrameFeatures& a, const FrameFeatures& b,
                             const FeatureMatch& match, const Pose& a_from_b, bool with_jacobian) {
  const Feature& in_a = a.features[static_cast<std::size_t>(match.a)];
  const Feature& in_b = b.features[static_cast<std::size_t>(match.b)];
  const Camera& camera_a = a.cameras[in_a.camera];
  const Camera& camera_b = b.cameras[in_b.camera];
  const Pose camera_from_base = camera_a.base_from_camera.inverse();
  const Eigen::Vector3d point_in_b = b.point_in_base(static_cast<std::size_t>(match.b));
  const Eigen::Vector3d point = camera_from_base * (a_from_b * point_in_b);
  MatchResidual result;
  if (!(point.z() > 1e-6)) return result;
  result.in_front = true;
  const Projection projection = project(point, Eigen::Vector2d::Constant(camera_a.fx),
                                        in_a.ray.cast<double>(), static_cast<double>(in_a.depth_m));
  result.residual = projection.residual;
  const Eigen::Matrix3d rotation = camera_from_base.linear() * a_from_b.linear();
  // Noise of b's point: pixel noise perpendicular to its ray, depth noise along it.
  const double lateral =
      static_cast<double>(in_b.depth_m) * static_cast<double>(in_b.pixel_noise_px) / camera_b.fx;
  const Eigen::Vector3d ray_in_b = in_b.ray.cast<double>().homogeneous();
  const double depth_noise = static_cast<double>(in_b.depth_noise_m);
  Eigen::Matrix3d noise = depth_noise * depth_noise * ray_in_b * ray_in_b.transpose();
  noise(0, 0) += lateral * lateral;
  noise(1, 1) += lateral * lateral;
  const Eigen::Matrix3d carried =
      projection.by_point * rotation * camera_b.base_from_camera.linear();
  result.covariance = carried * noise * carried.transpose();
  const double pixel_noise = static_cast<double>(in_a.pixel_noise_px);
  const double depth_noise_a = static_cast<double>(in_a.depth_noise_m);
  result.covariance(0, 0) += pixel_noise * pixel_noise;
  result.covariance(1, 1) += pixel_noise * pixel_noise;
  result.covariance(2, 2) += depth_noise_a * depth_noise_a;
  if (with_jacobian) {
    result.jacobian.leftCols<3>() = projection.by_point * rotation;
    result.jacobian.rightCols<3>() = -projection.by_point * rotation * cross_matrix(point_in_b);
  }
  return result;
}

RelativePose estimate_relative_pose(const FrameFeatures& a, const FrameFeatures& b,
                                    const std::vector<FeatureMatch>& matches,
                                    const RelativePoseOptions& options, std::uint64_t seed) {
  return RelativePoseEstimate(a, b, matches, options).run(seed);
}

}  // namespace libmap
