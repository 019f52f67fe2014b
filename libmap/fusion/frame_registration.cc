#include "libmap/fusion/frame_registration.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

namespace {

constexpr int robust_rounds = 3;
constexpr int max_iterations = 200;
constexpr double tolerance = 1e-4;  // relative to the initial gradient
// Slopes of 48 bytes each are recomputed beyond this number, because they would need most of the
// memory for a long scan.
constexpr std::size_t max_kept_slopes = 600'000;
// Number of ranges of elements whose sums are computed in parallel and added in order.
constexpr std::size_t sum_ranges = 16;

// Least squares over the frames' corrections, of heights about the mean of each element.
class Adjustment {
 public:
  Adjustment(std::span<const SurfaceElement> elements,
             std::span<const SurfaceObservation> observations,
             std::span<const Eigen::Vector3d> centers, const FrameRegistrationOptions& options)
      : elements_(elements),
        observations_(observations),
        centers_(centers),
        scatter2_(options.scatter_m * options.scatter_m),
        information_factor_(
            std::min(1.0, options.independent_heights * static_cast<double>(centers.size()) /
                              static_cast<double>(std::max<std::size_t>(1, observations.size())))),
        weights_(observations.size()),
        corrections_(centers.size(), Vector6d::Zero()) {
    const double turn = options.rotation_error_deg * std::numbers::pi / 180.0;
    prior_.head<3>().setConstant(1.0 / (turn * turn));
    prior_.tail<3>().setConstant(1.0 / (options.position_error_m * options.position_error_m));
    for (std::size_t n = 0; n < observations.size(); ++n) {
      weights_[n] = information(observations[n]);
      if (n == 0 || observations[n].element != observations[n - 1].element) starts_.push_back(n);
    }
    starts_.push_back(observations.size());
    if (observations.size() <= max_kept_slopes) find_slopes(0, observations.size(), slopes_);
  }

  double disagreement() const {
    double squares = 0.0;
    double weights = 0.0;
    std::vector<double> off;
    for (std::size_t element = 0; element < elements(); ++element) {
      find_offsets(element, off);
      for (std::size_t n = starts_[element]; n < starts_[element + 1]; ++n) {
        const double here = off[n - starts_[element]];
        squares += weights_[n] * here * here;
        weights += weights_[n];
      }
    }
    return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
  }

  double correction() const {
    double squares = 0.0;
    double weights = 0.0;
    for (std::size_t n = 0; n < observations_.size(); ++n) {
      const double change = slope(n).dot(corrections_[observations_[n].frame]);
      squares += weights_[n] * change * change;
      weights += weights_[n];
    }
    return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
  }

  void weigh() {
    parallel_for(elements(), 1024, [&](std::size_t first, std::size_t last) {
      std::vector<double> off;
      for (std::size_t element = first; element < last; ++element) {
        find_offsets(element, off);
        for (std::size_t n = starts_[element]; n < starts_[element + 1]; ++n) {
          const double here = off[n - starts_[element]];
          const double relative_weight = scatter2_ / (scatter2_ + here * here);
          weights_[n] = information(observations_[n]) * relative_weight * relative_weight;
        }
      }
    });
  }

  void solve() {
    // Conjugate gradients for (J' W J + P) step = -J' W r - P x.
    std::vector<Vector6d> gradient(corrections_.size());
    for (std::size_t f = 0; f < gradient.size(); ++f)
      gradient[f] = -prior_.cwiseProduct(corrections_[f]);
    accumulate([&](const auto& one, const Vector6d& slope) { return -residual(one, slope); },
               gradient);
    const std::vector<Matrix6d> inverses = block_inverses();
    std::vector<Vector6d> residuals = gradient;
    std::vector<Vector6d> direction(residuals.size(), Vector6d::Zero());
    std::vector<Vector6d> product(residuals.size());
    double before = 0.0;
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      double rho = 0.0;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        rho += residuals[f].dot(inverses[f] * residuals[f]);
      if (first_rho_ == 0.0) first_rho_ = rho;
      if (!(rho > tolerance * tolerance * first_rho_)) break;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        direction[f] =
            inverses[f] * residuals[f] + (iteration == 0 ? 0.0 : rho / before) * direction[f];
      before = rho;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        product[f] = prior_.cwiseProduct(direction[f]);
      accumulate(
          [&](const auto& one, const Vector6d& slope) { return slope.dot(direction[one.frame]); },
          product);
      double curvature = 0.0;
      for (std::size_t f = 0; f < residuals.size(); ++f) curvature += direction[f].dot(product[f]);
      const double alpha = rho / curvature;
      for (std::size_t f = 0; f < residuals.size(); ++f) {
        corrections_[f] += alpha * direction[f];
        residuals[f] -= alpha * product[f];
      }
    }
  }

  const std::vector<Vector6d>& corrections() const { return corrections_; }

 private:
  std::size_t elements() const { return starts_.size() - 1; }
  // Computes the residual of each of an element's observations about their mean.
  void find_offsets(std::size_t element, std::vector<double>& offsets) const {
    offsets.clear();
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t n = starts_[element]; n < starts_[element + 1]; ++n) {
      offsets.push_back(residual(observations_[n], slope(n)));
      sum += weights_[n] * offsets.back();
      weights += weights_[n];
    }
    const double mean = weights > 0.0 ? sum / weights : 0.0;
    for (double& offset : offsets) offset -= mean;
  }
  double information(const SurfaceObservation& one) const {  // inverse variance
    return information_factor_ / (static_cast<double>(one.variance_m2) + scatter2_);
  }
  // Derivative of the height by a rotation and a shift of its frame.
  Vector6d slope(std::size_t number) const {
    if (!slopes_.empty()) return slopes_[number];
    return slope_of(observations_[number]);
  }
  Vector6d slope_of(const SurfaceObservation& one) const {
    const Eigen::Vector3d n = elements_[one.element].normal.cast<double>();
    const Eigen::Vector3d arm =
        elements_[one.element].position.cast<double>() - centers_[one.frame];
    return {arm.y() * n.z() - arm.z() * n.y(),
            arm.z() * n.x() - arm.x() * n.z(),
            arm.x() * n.y() - arm.y() * n.x(),
            n.x(),
            n.y(),
            n.z()};
  }
  void find_slopes(std::size_t begin, std::size_t end, std::vector<Vector6d>& slopes) const {
    slopes.clear();
    slopes.reserve(end - begin);
    for (std::size_t n = begin; n < end; ++n) slopes.push_back(slope_of(observations_[n]));
  }
  double residual(const SurfaceObservation& one, const Vector6d& slope) const {
    return static_cast<double>(one.height_m) + slope.dot(corrections_[one.frame]);
  }
  // Adds J' W (value - its mean on the element), which eliminates the elements' heights. `value` is
  // a function of an observation and its slope.
  template <typename Value>
  void accumulate(const Value& value, std::vector<Vector6d>& sums) const {
    using Sums = std::vector<Vector6d>;
    const std::size_t grain = (elements() + sum_ranges - 1) / sum_ranges;
    const Sums zero(sums.size(), Vector6d::Zero());
    sums = parallel_reduce(
        elements(), grain, std::move(sums),
        [&](std::size_t first, std::size_t last) {
          Sums part = zero;
          std::vector<Vector6d> computed;
          std::vector<double> values;
          for (std::size_t element = first; element < last; ++element) {
            const std::size_t begin = starts_[element];
            const std::size_t end = starts_[element + 1];
            if (slopes_.empty()) find_slopes(begin, end, computed);
            const Vector6d* slopes = slopes_.empty() ? computed.data() : &slopes_[begin];
            values.resize(std::max(values.size(), end - begin));
            double sum = 0.0;
            double weights = 0.0;
            for (std::size_t n = begin; n < end; ++n) {
              values[n - begin] = value(observations_[n], slopes[n - begin]);
              sum += weights_[n] * values[n - begin];
              weights += weights_[n];
            }
            const double mean = weights > 0.0 ? sum / weights : 0.0;
            for (std::size_t n = begin; n < end; ++n)
              part[observations_[n].frame] +=
                  weights_[n] * (values[n - begin] - mean) * slopes[n - begin];
          }
          return part;
        },
        [](Sums all, const Sums& part) {
          for (std::size_t f = 0; f < all.size(); ++f) all[f] += part[f];
          return all;
        });
  }
  std::vector<Matrix6d> block_inverses() const {
    std::vector<Matrix6d> blocks(corrections_.size(), prior_.asDiagonal());
    for (std::size_t n = 0; n < observations_.size(); ++n) {
      const Vector6d by_step = slope(n);
      blocks[observations_[n].frame] += weights_[n] * by_step * by_step.transpose();
    }
    for (Matrix6d& block : blocks) block = block.llt().solve(Matrix6d::Identity());
    return blocks;
  }

  std::span<const SurfaceElement> elements_;
  std::span<const SurfaceObservation> observations_;
  std::span<const Eigen::Vector3d> centers_;
  double scatter2_;            // m2
  double information_factor_;  // factor of the information of each observation
  Vector6d prior_;
  std::vector<Vector6d> slopes_;     // of the observations; empty: recomputed each time
  std::vector<double> weights_;      // robust information of the observations
  std::vector<std::size_t> starts_;  // index of each element's first observation
  std::vector<Vector6d> corrections_;
  double first_rho_ = 0.0;  // preconditioned square of the gradient at the start
};

}  // namespace

FrameRegistration register_frames(std::span<const SurfaceElement> elements,
                                  std::span<const SurfaceObservation> observations,
                                  std::span<const Eigen::Vector3d> centers,
                                  const FrameRegistrationOptions& options) {
  FrameRegistration result;
  Adjustment adjustment(elements, observations, centers, options);
  for (int round = 0; round < robust_rounds; ++round) {
    adjustment.weigh();
    if (round == 0) result.disagreement_before_m = adjustment.disagreement();
    adjustment.solve();
  }
  result.disagreement_after_m = adjustment.disagreement();
  result.correction_m = adjustment.correction();
  for (std::size_t f = 0; f < centers.size(); ++f) {
    const Vector6d& correction = adjustment.corrections()[f];
    const Eigen::Vector3d turn = correction.head<3>();
    const double angle = turn.norm();
    Pose pose = Pose::Identity();
    if (angle > 0.0) pose.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    pose.translation() = centers[f] + correction.tail<3>() - pose.linear() * centers[f];
    result.corrected_from_given.push_back(pose);
  }
  return result;
}

}  // namespace libmap
