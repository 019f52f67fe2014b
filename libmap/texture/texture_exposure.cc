#include "libmap/texture/texture_steps.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace libmap {

namespace {

constexpr float darkest = 8.0F;
constexpr float brightest = 250.0F;
constexpr int rounds = 4;
// Huber threshold of residuals of ln(color).
constexpr double huber = 0.08;
// Prior of a gain of 1, as a number of observations. Determines photographs without overlap.
constexpr double prior_weight = 0.5;
// Prior of a lens without vignetting, as a number of observations.
constexpr double lens_prior_weight = 10.0;
// Maximum number of views of one point that are compared.
constexpr std::size_t max_views = 24;

struct Observation {
  std::uint32_t photo = 0;
  Eigen::Vector3d log_color = Eigen::Vector3d::Zero();
  Eigen::Vector3d powers = Eigen::Vector3d::Zero();  // r^2, r^4, r^6
};

Eigen::Vector3d powers_of(double radius2) {
  return {radius2, radius2 * radius2, radius2 * radius2 * radius2};
}

// The observations of one surface point: observations[first] .. [last - 1].
struct SurfacePoint {
  std::size_t first = 0;
  std::size_t last = 0;
};

class ExposureFit {
 public:
  ExposureFit(std::span<const ColorObservation> observations, std::size_t photos,
              const ExposureOptions& options);
  TextureExposure solve();

 private:
  double predicted(const Observation& seen, Eigen::Index channel) const {
    return gains_(seen.photo, channel) + vignetting_.dot(seen.powers);
  }
  double weigh();  // updates the weights; returns the standard deviation of the residuals
  void fit_gains();
  void fit_vignetting();

  const ExposureOptions& options_;
  std::vector<Observation> observations_;
  std::vector<SurfacePoint> points_;
  std::vector<double> weights_;  // one per observation
  Eigen::MatrixX3d gains_;       // logarithms
  Eigen::Vector3d vignetting_ = Eigen::Vector3d::Zero();
};

ExposureFit::ExposureFit(std::span<const ColorObservation> observations, std::size_t photos,
                         const ExposureOptions& options)
    : options_(options), gains_(Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(photos), 3)) {
  std::vector<ColorObservation> sorted;
  for (const ColorObservation& seen : observations)
    if (seen.color.minCoeff() >= darkest && seen.color.maxCoeff() <= brightest)
      sorted.push_back(seen);
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
    return std::tie(a.vertex, a.photo) < std::tie(b.vertex, b.photo);
  });
  for (std::size_t first = 0, last = 0; first < sorted.size(); first = last) {
    while (last < sorted.size() && sorted[last].vertex == sorted[first].vertex) ++last;
    if (last - first < 2) continue;
    SurfacePoint point{observations_.size(), 0};
    const std::size_t step = (last - first - 1) / max_views + 1;
    for (std::size_t i = first; i < last; i += step)
      observations_.push_back({sorted[i].photo, sorted[i].color.cast<double>().array().log(),
                               powers_of(static_cast<double>(sorted[i].radius2))});
    point.last = observations_.size();
    points_.push_back(point);
  }
  weights_.assign(observations_.size(), 1.0);
}

double ExposureFit::weigh() {
  double sum = 0.0;
  double count = 0.0;
  for (const SurfacePoint& point : points_) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    double total = 0.0;
    const auto residual = [&](const Observation& seen) {
      Eigen::Vector3d r = seen.log_color;
      for (Eigen::Index c = 0; c < 3; ++c) r[c] -= predicted(seen, c);
      return r;
    };
    for (std::size_t i = point.first; i < point.last; ++i) {
      mean += weights_[i] * residual(observations_[i]);
      total += weights_[i];
    }
    mean /= total;
    for (std::size_t i = point.first; i < point.last; ++i) {
      const Eigen::Vector3d off = residual(observations_[i]) - mean;
      const double size = off.norm() / std::sqrt(3.0);
      sum += size * size;
      weights_[i] = size <= huber ? 1.0 : huber / size;
    }
    count += static_cast<double>(point.last - point.first - 1);
  }
  return count > 0.0 ? std::sqrt(sum / count) : 0.0;
}

// Solves the normal equations of the gains; the color of each point is eliminated.
void ExposureFit::fit_gains() {
  const Eigen::Index photos = gains_.rows();
  std::vector<Eigen::Triplet<double>> terms;
  Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(photos, 3);
  for (const SurfacePoint& point : points_) {
    double total = 0.0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t i = point.first; i < point.last; ++i) {
      const Observation& seen = observations_[i];
      const double shade = vignetting_.dot(seen.powers);
      mean += weights_[i] * (seen.log_color.array() - shade).matrix();
      total += weights_[i];
    }
    mean /= total;
    for (std::size_t i = point.first; i < point.last; ++i) {
      const Observation& a = observations_[i];
      const auto row = static_cast<Eigen::Index>(a.photo);
      const double shade = vignetting_.dot(a.powers);
      right.row(row) +=
          weights_[i] * (a.log_color.array() - shade - mean.array()).matrix().transpose();
      terms.emplace_back(row, row, weights_[i]);
      for (std::size_t k = point.first; k < point.last; ++k)
        terms.emplace_back(row, static_cast<Eigen::Index>(observations_[k].photo),
                           -weights_[i] * weights_[k] / total);
    }
  }
  for (Eigen::Index photo = 0; photo < photos; ++photo)
    terms.emplace_back(photo, photo, prior_weight);
  Eigen::SparseMatrix<double> normal(photos, photos);
  normal.setFromTriplets(terms.begin(), terms.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(normal);
  if (solver.info() != Eigen::Success) return;
  gains_ = solver.solve(right);
  gains_.rowwise() -= gains_.colwise().mean();
}

void ExposureFit::fit_vignetting() {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Identity() * lens_prior_weight;
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const SurfacePoint& point : points_) {
    double total = 0.0;
    Eigen::Vector3d mean_powers = Eigen::Vector3d::Zero();
    Eigen::Vector3d mean_color = Eigen::Vector3d::Zero();
    const auto color_of = [&](const Observation& seen) -> Eigen::Vector3d {
      return seen.log_color - gains_.row(static_cast<Eigen::Index>(seen.photo)).transpose();
    };
    for (std::size_t i = point.first; i < point.last; ++i) {
      mean_powers += weights_[i] * observations_[i].powers;
      mean_color += weights_[i] * color_of(observations_[i]);
      total += weights_[i];
    }
    mean_powers /= total;
    mean_color /= total;
    for (std::size_t i = point.first; i < point.last; ++i) {
      const Eigen::Vector3d powers = observations_[i].powers - mean_powers;
      const Eigen::Vector3d color = color_of(observations_[i]) - mean_color;
      normal += 3.0 * weights_[i] * powers * powers.transpose();
      right += weights_[i] * color.sum() * powers;
    }
  }
  vignetting_ = normal.ldlt().solve(right);
}

TextureExposure ExposureFit::solve() {
  TextureExposure result;
  result.observations = observations_.size();
  result.log_color_deviation_before = weigh();
  result.log_color_deviation = result.log_color_deviation_before;
  // Gains and vignetting are nearly independent, so they are estimated alternately.
  for (int round = 0; round < rounds && !observations_.empty(); ++round) {
    if (options_.vignetting) fit_vignetting();
    if (options_.gains) fit_gains();
    result.log_color_deviation = weigh();
  }
  for (Eigen::Index photo = 0; photo < gains_.rows(); ++photo)
    result.gains.emplace_back(gains_.row(photo).transpose().array().exp().cast<float>());
  for (std::size_t k = 0; k < 3; ++k)
    result.vignetting[k] = vignetting_[static_cast<Eigen::Index>(k)];
  return result;
}

}  // namespace

Eigen::Vector3f TextureExposure::factor(std::size_t photo, double radius2) const {
  const double shade =
      radius2 * (vignetting[0] + radius2 * (vignetting[1] + radius2 * vignetting[2]));
  return static_cast<float>(std::exp(shade)) * gains[photo];
}

TextureExposure estimate_exposure(std::span<const ColorObservation> observations,
                                  std::size_t photos, const ExposureOptions& options) {
  return ExposureFit(observations, photos, options).solve();
}

}  // namespace libmap
