#include "libgtd/grasp/bearing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "libgtd/gripper/target_clones.h"
#include "libmap/core/angle.h"

namespace libgtd {

namespace {

constexpr std::size_t chunk = 12;  // facets at once

// Friction pyramids and the force direction `local` (normal, drag, lateral) of a product.
struct FacetLoop {
  double x, y, z;
  double friction;
  double cos_friction_angle;
};

// Products with the best of the eight edges of the friction pyramid on each facet of a chunk.
GRASPMAP_CLONED void best_edge_products(const double* cosines, const double* sines,
                                        const FacetLoop& loop, double* products) {
  constexpr double diagonal = std::numbers::sqrt2 / 2.0;
  const auto [x, y, z, friction, cos_friction_angle] = loop;
  const double beside = std::abs(z);
  for (std::size_t n = 0; n < chunk; ++n) {
    const double along = std::abs(sines[n] * x + cosines[n] * y);
    const double both = (along + beside) * diagonal;
    const double straight = along < beside ? beside : along;
    const double slope = both < straight ? straight : both;
    products[n] = cos_friction_angle * (cosines[n] * x - sines[n] * y + friction * slope);
  }
}

// Maximum of these products, each times the number of spines that share the force; 0 if none is
// positive.
GRASPMAP_CLONED double max_shared_product(const double* cosines, const double* sines,
                                          const double* counts, std::size_t padded,
                                          const FacetLoop& loop) {
  constexpr double diagonal = std::numbers::sqrt2 / 2.0;
  const auto [x, y, z, friction, cos_friction_angle] = loop;
  const double beside = std::abs(z);
  double most[chunk] = {};
  for (std::size_t begin = 0; begin < padded; begin += chunk)
    for (std::size_t n = 0; n < chunk; ++n) {
      const double cosine = cosines[begin + n];
      const double sine = sines[begin + n];
      const double along = std::abs(sine * x + cosine * y);
      const double both = (along + beside) * diagonal;
      const double straight = along < beside ? beside : along;
      const double slope = both < straight ? straight : both;
      const double product =
          counts[begin + n] * (cos_friction_angle * (cosine * x - sine * y + friction * slope));
      most[n] = most[n] < product ? product : most[n];
    }
  // Halves, so that the loops are vectorized.
  for (std::size_t n = 0; n < 4; ++n) {
    most[n] = most[n] < most[n + 4] ? most[n + 4] : most[n];
    most[n] = most[n] < most[n + 8] ? most[n + 8] : most[n];
  }
  return std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
}
static_assert(chunk == 12);

// Best product on the ground itself.
double best_level_product(const FacetLoop& loop) {
  const double along = std::abs(loop.y);
  const double beside = std::abs(loop.z);
  const double both = (along + beside) * (std::numbers::sqrt2 / 2.0);
  return loop.cos_friction_angle * (loop.x + loop.friction * std::max({along, beside, both}));
}

}  // namespace

const std::vector<std::pair<std::string, EngagementLaw>>& engagement_law_names() {
  static const std::vector<std::pair<std::string, EngagementLaw>> names = {
      {"asperities", EngagementLaw::asperities}, {"adhesion", EngagementLaw::adhesion}};
  return names;
}

void bind(libmap::ParameterTable& table, EngagementOptions& options) {
  using libmap::positive;
  constexpr libmap::Range cone{0.0, 89.0};
  table.add("law", options.law, engagement_law_names(),
            "force model; asperities: friction on random facets; adhesion: tension limit (LORIS)");
  table.add("adhesion_limit_n", options.adhesion_limit_n, positive,
            "law adhesion: maximum total tension of all fingers, N");
  table.add("adhesion_lateral_deg", options.adhesion_lateral_deg, cone,
            "law adhesion: arctangent of the maximum ratio of lateral force to tension, degrees");
  table.add("adhesion_pull_deg", options.adhesion_pull_deg, cone,
            "law adhesion: arctangent of the maximum ratio of pull-off force to tension, degrees");
}

// Edge of a pyramid: its product with `objective`, and the edge in normal, drag and lateral.
struct BearingContact::Edge {
  double product = 0.0;
  Eigen::Vector3d local = Eigen::Vector3d::Zero();
};

BearingContact::BearingContact(const GripContact& contact, std::vector<double> facet_angles_rad,
                               double friction, double limit_n)
    : point_(contact.point),
      normal_(contact.normal),
      drag_(contact.drag),
      lateral_(contact.normal.cross(contact.drag)),
      outward_(contact.outward),
      finger_(contact.finger),
      is_link_(!contact.by_spines),
      friction_(friction),
      cos_friction_angle_(std::cos(std::atan(friction))),
      limit_n_(limit_n) {
  std::sort(facet_angles_rad.begin(), facet_angles_rad.end(), std::greater<>());
  spines_ = facet_angles_rad.size();
  // Padded to a multiple of the chunk size.
  cosines_.assign((spines_ + chunk - 1) / chunk * chunk, 0.0);
  counts_ = sines_ = cosines_;
  for (std::size_t n = 0; n < spines_; ++n) {
    cosines_[n] = std::cos(facet_angles_rad[n]);
    sines_[n] = std::sin(facet_angles_rad[n]);
    counts_[n] = static_cast<double>(n + 1);
  }
}

BearingContact::BearingContact(const GripContact& contact, const EngagementOptions& options,
                               double friction, double limit_n)
    : BearingContact(contact, std::vector<double>{}, friction, limit_n) {
  const double side = std::tan(options.adhesion_lateral_deg * libmap::radians_per_degree);
  const double pull = std::tan(options.adhesion_pull_deg * libmap::radians_per_degree);
  adhesion_ = {{1.0, 0.0, 0.0}, {-pull, -1.0, side}, {-pull, -1.0, -side}};
}

// Returns the edge of the friction pyramid on a facet with the largest product with `local`.
BearingContact::Edge BearingContact::best_edge(double cosine, double sine,
                                               const Eigen::Vector3d& local) const {
  const double axis = cosine * local.x() - sine * local.y();
  // Components along the facet, out of the corner, and lateral.
  const double out = -sine * local.x() - cosine * local.y();
  const double along = std::abs(out);
  const double beside = std::abs(local.z());
  double to_out = 0.0;
  double to_lateral = 0.0;
  if (const double both = (along + beside) * std::numbers::sqrt2 / 2.0;
      both >= along && both >= beside) {
    to_out = std::copysign(std::numbers::sqrt2 / 2.0, out);
    to_lateral = std::copysign(std::numbers::sqrt2 / 2.0, local.z());
  } else if (along >= beside) {
    to_out = std::copysign(1.0, out);
  } else {
    to_lateral = std::copysign(1.0, local.z());
  }
  Edge edge;
  edge.product = cos_friction_angle_ * (axis + friction_ * (to_out * out + to_lateral * local.z()));
  edge.local = cos_friction_angle_ * Eigen::Vector3d(cosine - friction_ * to_out * sine,
                                                     -sine - friction_ * to_out * cosine,
                                                     friction_ * to_lateral);
  return edge;
}

double BearingContact::max_local_product(const Eigen::Vector3d& local, SpineSharing sharing) const {
  if (!adhesion_.empty()) {
    double most = 0.0;
    for (const Eigen::Vector3d& edge : adhesion_) most = std::max(most, edge.dot(local));
    return limit_n_ * most;
  }
  const FacetLoop loop{local.x(), local.y(), local.z(), friction_, cos_friction_angle_};
  double sum = static_cast<double>(spines_) * std::max(0.0, best_level_product(loop));
  if (sharing == SpineSharing::equally)
    return limit_n_ * std::max(sum, max_shared_product(cosines_.data(), sines_.data(),
                                                       counts_.data(), cosines_.size(), loop));
  std::array<double, chunk> products;
  for (std::size_t begin = 0; begin < spines_; begin += chunk) {
    best_edge_products(&cosines_[begin], &sines_[begin], loop, products.data());
    for (std::size_t n = 0; n < std::min(chunk, spines_ - begin); ++n)
      sum += std::max(0.0, products[n]);
  }
  return limit_n_ * sum;
}

Eigen::Vector3d BearingContact::best_local_force(const Eigen::Vector3d& along,
                                                 SpineSharing sharing) const {
  const auto spines = static_cast<double>(spines_);
  Edge best;
  for (const Eigen::Vector3d& edge : adhesion_)
    if (edge.dot(along) > best.product) best = {edge.dot(along), edge};
  const Edge ground = best_edge(1.0, 0.0, along);
  if (adhesion_.empty() && ground.product > 0.0)
    best = {spines * ground.product, spines * ground.local};
  if (sharing == SpineSharing::best) {
    for (std::size_t n = 0; n < spines_; ++n)
      if (const Edge edge = best_edge(cosines_[n], sines_[n], along); edge.product > 0.0)
        best = {best.product + edge.product, best.local + edge.local};
  } else if (adhesion_.empty()) {
    const FacetLoop loop{along.x(), along.y(), along.z(), friction_, cos_friction_angle_};
    std::array<double, chunk> products;
    std::size_t steepest = spines_;  // no facet
    for (std::size_t begin = 0; begin < spines_; begin += chunk) {
      best_edge_products(&cosines_[begin], &sines_[begin], loop, products.data());
      for (std::size_t n = begin; n < std::min(begin + chunk, spines_); ++n) {
        const double product = static_cast<double>(n + 1) * products[n - begin];
        if (product <= best.product) continue;
        best.product = product;
        steepest = n;
      }
    }
    if (steepest < spines_)
      best.local = static_cast<double>(steepest + 1) *
                   best_edge(cosines_[steepest], sines_[steepest], along).local;
  }
  return limit_n_ * (best.local.x() * normal_ + best.local.y() * drag_ + best.local.z() * lateral_);
}

std::vector<Eigen::Vector3d> BearingContact::cone() const {
  std::vector<Eigen::Vector3d> edges = adhesion_;
  constexpr int edges_of_facet = 8;
  for (int n = 0; edges.size() < edges_of_facet && adhesion_.empty(); ++n) {
    const double turn = n * 2.0 * std::numbers::pi / edges_of_facet;
    const double out = friction_ * std::cos(turn);
    edges.emplace_back(cosines_[0] - out * sines_[0], -sines_[0] - out * cosines_[0],
                       friction_ * std::sin(turn));
  }
  for (Eigen::Vector3d& edge : edges)
    edge = (edge.x() * normal_ + edge.y() * drag_ + edge.z() * lateral_).normalized();
  return edges;
}

std::vector<BearingContact> draw_bearing(const std::vector<GripContact>& contacts,
                                         const Gripper& gripper, const EngagementOptions& options,
                                         libmap::RandomStream& random) {
  const GripperFingers& fingers = *gripper.fingers;
  const Engagement& engagement = gripper.engagement;
  const double fraction = engagement_fraction(engagement, fingers.spine_tip_radius_um);
  std::vector<BearingContact> bearing;
  for (const GripContact& contact : contacts) {
    if (!contact.by_spines) {
      bearing.emplace_back(contact, std::vector<double>{0.0}, engagement.friction,
                           fingers.spines_per_finger * fingers.spine_force_limit_n);
    } else if (options.law == EngagementLaw::adhesion) {
      bearing.emplace_back(contact, options, engagement.friction,
                           options.adhesion_limit_n / fingers.count);
    } else {
      std::vector<double> facet_angles;
      for (int spine = 0; spine < fingers.spines_per_finger; ++spine) {
        const bool engages = random.uniform() < fraction;
        const double facet_angle =
            random.uniform(engagement.asperity_min_deg, engagement.asperity_max_deg);
        if (engages) facet_angles.push_back(facet_angle * libmap::radians_per_degree);
      }
      if (!facet_angles.empty())
        bearing.emplace_back(contact, std::move(facet_angles), engagement.friction,
                             fingers.spine_force_limit_n);
    }
  }
  return bearing;
}

}  // namespace libgtd
