#include "libmap/cloud/frame_registration.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr int robust_rounds = 3;
constexpr int max_iterations = 200;
constexpr double tolerance = 1e-8;
// Ranges of elements whose sums are made side by side and joined in their order.
constexpr std::size_t sum_ranges = 16;

struct Equation {
  std::uint32_t frame = 0;
  double height = 0.0;
  double information = 0.0;  // inverse variance
  double weight = 0.0;       // the same, made robust
  Vector6d slope;            // of the height: by a turn, by a shift
};

// Sums over the frames' corrections; heights about the mean of each element.
class Adjustment {
 public:
  Adjustment(std::span<const SurfaceElement> elements,
             std::span<const SurfaceObservation> observations,
             std::span<const Eigen::Vector3d> centers, const FrameRegistrationOptions& options)
      : options_(options), corrections_(centers.size(), Vector6d::Zero()) {
    const double turn = options.rotation_error_deg * std::numbers::pi / 180.0;
    prior_.head<3>().setConstant(1.0 / (turn * turn));
    prior_.tail<3>().setConstant(1.0 / (options.place_error_m * options.place_error_m));
    const double scatter = options.scatter_m * options.scatter_m;
    const double share =
        std::min(1.0, options.independent_heights * static_cast<double>(centers.size()) /
                          static_cast<double>(std::max<std::size_t>(1, observations.size())));
    for (const SurfaceObservation& one : observations) {
      const SurfaceElement& element = elements[one.element];
      Equation equation;
      equation.frame = one.frame;
      equation.height = static_cast<double>(one.height_m);
      equation.information = share / (static_cast<double>(one.variance_m2) + scatter);
      const Eigen::Vector3d normal = element.normal.cast<double>();
      const Eigen::Vector3d arm = element.position.cast<double>() - centers[one.frame];
      equation.slope << arm.cross(normal), normal;
      if (starts_.empty() || one.element != last_element_) starts_.push_back(equations_.size());
      last_element_ = one.element;
      equations_.push_back(equation);
    }
    starts_.push_back(equations_.size());
  }

  double disagreement() const {
    double squares = 0.0;
    double weights = 0.0;
    each_element([&](std::size_t begin, std::size_t end) {
      const double mean = mean_of(begin, end, [&](const Equation& e) { return residual(e); });
      for (std::size_t n = begin; n < end; ++n) {
        const double off = residual(equations_[n]) - mean;
        squares += equations_[n].weight * off * off;
        weights += equations_[n].weight;
      }
    });
    return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
  }

  double correction() const {
    double squares = 0.0;
    double weights = 0.0;
    for (const Equation& equation : equations_) {
      const double change = equation.slope.dot(corrections_[equation.frame]);
      squares += equation.weight * change * change;
      weights += equation.weight;
    }
    return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
  }

  void weigh() {
    const double scale = options_.scatter_m * options_.scatter_m;
    for (Equation& equation : equations_)
      if (!(equation.weight > 0.0)) equation.weight = equation.information;
    each_element([&](std::size_t begin, std::size_t end) {
      const double mean = mean_of(begin, end, [&](const Equation& e) { return residual(e); });
      for (std::size_t n = begin; n < end; ++n) {
        const double off = residual(equations_[n]) - mean;
        const double share = scale / (scale + off * off);
        equations_[n].weight = equations_[n].information * share * share;
      }
    });
  }

  void solve() {
    // From here: (J' W J + P) step = -J' W r - P x.
    std::vector<Vector6d> gradient(corrections_.size());
    for (std::size_t f = 0; f < gradient.size(); ++f)
      gradient[f] = -prior_.cwiseProduct(corrections_[f]);
    accumulate([&](const Equation& e) { return -residual(e); }, gradient);
    const std::vector<Matrix6d> inverses = block_inverses();
    std::vector<Vector6d> residuals = gradient;
    std::vector<Vector6d> direction(residuals.size(), Vector6d::Zero());
    std::vector<Vector6d> product(residuals.size());
    double before = 0.0;
    double first = 0.0;
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      double rho = 0.0;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        rho += residuals[f].dot(inverses[f] * residuals[f]);
      if (iteration == 0) first = rho;
      if (!(rho > tolerance * tolerance * first)) break;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        direction[f] =
            inverses[f] * residuals[f] + (iteration == 0 ? 0.0 : rho / before) * direction[f];
      before = rho;
      for (std::size_t f = 0; f < residuals.size(); ++f)
        product[f] = prior_.cwiseProduct(direction[f]);
      accumulate([&](const Equation& e) { return e.slope.dot(direction[e.frame]); }, product);
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
  template <typename Use>
  void each_element(const Use& use) const {
    for (std::size_t n = 0; n < elements(); ++n) use(starts_[n], starts_[n + 1]);
  }
  template <typename Value>
  double mean_of(std::size_t begin, std::size_t end, const Value& value) const {
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t n = begin; n < end; ++n) {
      sum += equations_[n].weight * value(equations_[n]);
      weights += equations_[n].weight;
    }
    return weights > 0.0 ? sum / weights : 0.0;
  }
  double residual(const Equation& equation) const {
    return equation.height + equation.slope.dot(corrections_[equation.frame]);
  }
  // Adds J' W (value - its mean on the element): the elements' heights are eliminated.
  template <typename Value>
  void accumulate(const Value& value, std::vector<Vector6d>& sums) const {
    using Sums = std::vector<Vector6d>;
    const std::size_t grain = (elements() + sum_ranges - 1) / sum_ranges;
    const Sums zero(sums.size(), Vector6d::Zero());
    sums = parallel_reduce(
        elements(), grain, std::move(sums),
        [&](std::size_t first, std::size_t last) {
          Sums part = zero;
          for (std::size_t element = first; element < last; ++element) {
            const std::size_t begin = starts_[element];
            const std::size_t end = starts_[element + 1];
            const double mean = mean_of(begin, end, value);
            for (std::size_t n = begin; n < end; ++n) {
              const Equation& equation = equations_[n];
              part[equation.frame] += equation.weight * (value(equation) - mean) * equation.slope;
            }
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
    for (const Equation& equation : equations_)
      blocks[equation.frame] += equation.weight * equation.slope * equation.slope.transpose();
    for (Matrix6d& block : blocks) block = block.llt().solve(Matrix6d::Identity());
    return blocks;
  }

  const FrameRegistrationOptions& options_;
  Vector6d prior_;
  std::vector<Equation> equations_;
  std::vector<std::size_t> starts_;  // of each element's equations
  std::uint32_t last_element_ = 0;
  std::vector<Vector6d> corrections_;
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
