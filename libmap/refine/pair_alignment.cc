#include "libmap/refine/pair_alignment.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "libmap/refine/icp_refinement.h"
#include "libmap/refine/surface_samples.h"

namespace libmap {

namespace {

constexpr double guess_m = 0.15;  // standard deviations of a pair's guessed motion
constexpr double guess_rad = 0.1;
constexpr double pair_degenerate = 1e-4;
constexpr std::size_t min_pair_samples = 300;  // that must match
constexpr double min_pair_share = 0.4;         // of a pair's samples
constexpr double max_pair_rms_m = 0.012;
constexpr int pair_agreement_samples = 300;
constexpr double pair_agreement_m = 0.005;
constexpr double min_pair_agreement = 0.95;

// Of what both frames see, the share that lies where both say; what lies behind a surface is
// hidden.
double agreement_of(const FrameFeatures& a, const FrameFeatures& b, const Pose& b_from_a) {
  double seen = 0.0;
  double agreed = 0.0;
  for (const BaseElement& sample :
       surface_samples(a, pair_agreement_samples, SampleUse::estimation)) {
    BaseElement element;
    const Eigen::Vector3d point = b_from_a * sample.point;
    if (!seen_from_base(b, point, element)) continue;
    const double above = element.normal.dot(point - element.point);
    const double allowed = pair_agreement_m + 3.0 * std::hypot(element.noise_m, sample.noise_m);
    if (above < -allowed) continue;
    seen += 1.0;
    if (above <= allowed) agreed += 1.0;
  }
  return seen > 0.0 ? agreed / seen : 0.0;
}

}  // namespace

std::optional<PoseLink> align_pair(const FrameFeatures& a, const FrameFeatures& b,
                                   const Pose& a_from_b) {
  IcpOptions options;
  options.mode = IcpMode::links;
  options.iterations = 40;
  options.graduated = true;
  options.max_distance_m = guess_m;
  options.degenerate = pair_degenerate;
  const std::size_t place_of_b = a.node < b.node ? 1 : 0;
  BlockSystem prior(2);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(guess_m * guess_m),
      Eigen::Vector3d::Constant(guess_rad * guess_rad);
  prior.add(place_of_b, place_of_b, variances.cwiseInverse().asDiagonal());
  PoseLink link{.from = a.node, .to = b.node, .type = LinkType::neighbor};
  const std::map<int, Pose> poses = {{a.node, Pose::Identity()}, {b.node, a_from_b}};
  const IcpResult aligned =
      align_surfaces({a, b}, poses, prior, {{{a.node, b.node}, a.node}}, {link}, options);
  const std::size_t all = surface_samples(a, options.samples, SampleUse::estimation).size() +
                          surface_samples(b, options.samples, SampleUse::estimation).size();
  if (aligned.samples < min_pair_samples ||
      static_cast<double>(aligned.samples) < min_pair_share * static_cast<double>(all) ||
      aligned.final_rms_m > max_pair_rms_m)
    return std::nullopt;
  link.from_from_to = aligned.map_from_base.at(b.node);
  if (std::min(agreement_of(a, b, link.from_from_to.inverse()),
               agreement_of(b, a, link.from_from_to)) < min_pair_agreement)
    return std::nullopt;
  link.information = aligned.information.block(place_of_b, place_of_b);
  return link;
}

}  // namespace libmap
