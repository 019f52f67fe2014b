#include "libmap/mesh/poisson_disk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/mesh/disk_sampler.h"

namespace libmap {

namespace {

constexpr double max_samples = 1e8;
constexpr double count_tolerance = 0.01;
// Within this distance of the origin along each axis, rounding to single precision, as in files,
// changes coordinates by at most 1e-5 m.
constexpr double single_precision_m = 256.0;

SampledSurface surface_of(const TriangleMesh& mesh) {
  mesh.check();
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (!vertex.allFinite()) throw Error("one is not finite", {.field = "vertices of the mesh"});
  const Bounds3d bounds = bounds_of(mesh.vertices);
  const double farthest =
      std::max(bounds.min.cwiseAbs().maxCoeff(), bounds.max.cwiseAbs().maxCoeff());
  SampledSurface surface{mesh, bounds.min, SurfaceFragments(mesh), 0.0, 0.0, {}};
  if (farthest <= single_precision_m) {
    const auto single = static_cast<float>(farthest);
    const float step = std::nextafter(single, std::numeric_limits<float>::infinity()) - single;
    surface.rounding_m = 0.5 * std::numbers::sqrt3 * static_cast<double>(step);
  }
  surface.area_m2 = surface.triangles.area_m2();
  if (!(surface.area_m2 > 0.0) || !std::isfinite(surface.area_m2))
    throw Error("has no area", {.field = "mesh"});
  return surface;
}

void require_sense(const SampledSurface& surface, const PoissonDiskOptions& options) {
  check_parameters(options);
  if (options.count > 0) return;
  // The number of samples per triangle is limited, so that a small file cannot exhaust the memory.
  const double most =
      std::clamp(100.0 * static_cast<double>(surface.mesh.triangles.size()), 2.5e6, max_samples);
  const double least = std::sqrt(saturation_density * surface.area_m2 / most);
  if (!(options.radius_m >= least))
    throw Error("yields too many samples", {.field = "radius_m",
                                            .value = to_text(options.radius_m),
                                            .bound = ">= " + to_text(static_cast<float>(least))});
}

// Searches for the radius that yields a number of samples. The number decreases with the square of
// the radius, with random scatter between radii.
class CountSearch {
 public:
  CountSearch(const SampledSurface& surface, const PoissonDiskOptions& options)
      : surface_(surface),
        seed_(options.seed),
        wanted_(static_cast<double>(options.count)),
        random_(options.seed, options.count) {}

  // Returns the samples of the tried radius whose number is closest to the wanted one.
  DiskSamples run(double& radius_m, std::size_t& tried_radii, Progress& progress) {
    radius_ = std::sqrt(saturation_density * surface_.area_m2 / wanted_);
    DiskSamples best;
    double best_miss = 0.0;
    for (tried_radii = 1;; ++tried_radii) {
      DiskSamples samples = sample_disks(
          surface_, radius_, seed_,
          [&](std::size_t thrown) { return is_near(thrown, tried_radii); }, progress);
      const double found = static_cast<double>(samples.positions.size());
      const double miss = is_full_ ? std::abs(found - wanted_) : 2.0 * max_samples;
      if (best.positions.empty() || miss < best_miss) {
        best = std::move(samples);
        best_miss = miss;
        radius_m = radius_;
      }
      const bool hit = is_full_ && miss <= count_tolerance * wanted_;
      if (hit || tried_radii == max_tries) return best;
      if (is_full_) fraction_of_darts_ = thrown_ / found;
      aim(is_full_ ? found : thrown_ / fraction_of_darts_, tried_radii);
    }
  }

 private:
  static constexpr std::size_t max_tries = 100;
  static constexpr std::size_t direct_tries = 8;  // before random radii within a bracket

  // True if the number of darts predicts about the wanted number of samples.
  bool is_near(std::size_t thrown, std::size_t tried_radii) {
    thrown_ = static_cast<double>(thrown);
    const double miss = std::abs(thrown_ / fraction_of_darts_ / wanted_ - 1.0);
    is_full_ =
        tried_radii > direct_tries || miss <= 0.5 * count_tolerance + 1.0 / std::sqrt(wanted_);
    return is_full_;
  }

  // Sets the next radius after the current one yielded `found` samples.
  void aim(double found, std::size_t tried_radii) {
    if (is_full_ && found > wanted_) too_small_ = std::max(too_small_, radius_);
    if (is_full_ && found < wanted_) too_large_ = std::min(too_large_, radius_);
    const bool is_bracketed = too_small_ > 0.0 && std::isfinite(too_large_);
    if (tried_radii < direct_tries || !is_bracketed) {
      // Islands much smaller than the radius keep one sample each until it exceeds their distances.
      const double step = std::sqrt(found / wanted_);
      radius_ *= tried_radii < direct_tries ? step : (step > 1.0 ? std::max(step, 1.5) : step);
      return;
    }
    const double low = 0.95 * std::min(too_small_, too_large_);
    const double high = 1.05 * std::max(too_small_, too_large_);
    radius_ = low * std::pow(high / low, random_.uniform());
  }

  const SampledSurface& surface_;
  std::uint64_t seed_;
  double wanted_;
  RandomStream random_;
  double radius_ = 0.0;
  double thrown_ = 0.0;
  double fraction_of_darts_ = dart_fraction;
  bool is_full_ = false;  // the last try filled the gaps
  double too_small_ = 0.0;
  double too_large_ = std::numeric_limits<double>::infinity();
};

PoissonDiskResult sample(const SampledSurface& surface, const PoissonDiskOptions& options,
                         Progress& progress) {
  require_sense(surface, options);
  PoissonDiskResult result;
  result.area_m2 = surface.area_m2;
  DiskSamples samples = timed(result.timings_s, "samples", [&] {
    if (options.count > 0)
      return CountSearch(surface, options).run(result.radius_m, result.tried_radii, progress);
    result.radius_m = options.radius_m;
    result.tried_radii = 1;
    return sample_disks(
        surface, options.radius_m, options.seed, [](std::size_t) { return true; }, progress);
  });
  const auto wanted = static_cast<double>(options.count);
  result.count_reached =
      options.count == 0 ||
      std::abs(static_cast<double>(samples.positions.size()) - wanted) <= count_tolerance * wanted;
  result.smallest_distance_m = timed(result.timings_s, "smallest distance", [&] {
    std::vector<Eigen::Vector3d> all = surface.neighbor_samples;
    all.insert(all.end(), samples.positions.begin(), samples.positions.end());
    return smallest_distance(all, result.radius_m);
  });
  const double per_sample_m2 = surface.area_m2 / static_cast<double>(samples.positions.size());
  result.relative_radius =
      result.smallest_distance_m / (2.0 * std::sqrt(per_sample_m2 / (2.0 * std::numbers::sqrt3)));
  result.cloud = timed(result.timings_s, "attributes",
                       [&] { return points_on_surface(surface.mesh, samples.triangle_points); });
  result.cloud.positions = std::move(samples.positions);
  return result;
}

}  // namespace

void bind(ParameterTable& table, PoissonDiskOptions& options) {
  table.add(
      "radius_m", options.radius_m, positive,
      "minimum distance between samples and maximum distance from the surface to a sample, m");
  table.add("count", options.count, {0.0, max_samples},
            "number of samples, usually within 1 %, instead of --radius; 0: not used");
  table.add("seed", options.seed, {}, "random seed of the samples");
}

PoissonDiskResult sample_poisson_disk(const TriangleMesh& mesh, const PoissonDiskOptions& options,
                                      Progress& progress) {
  return sample(surface_of(mesh), options, progress);
}

TileSampler::TileSampler(std::vector<Bounds3d> boxes, const PoissonDiskOptions& options)
    : boxes_(std::move(boxes)), options_(options), near_(boxes_.size()) {
  check_parameters(options);
  if (options.count > 0)
    throw Error("cannot be used for a surface that is divided into tiles; set radius_m instead",
                {.field = "count", .value = std::to_string(options.count), .bound = "0"});
}

PoissonDiskResult TileSampler::sample(const TriangleMesh& mesh, std::size_t number,
                                      Progress& progress) {
  if (!(surface_area(mesh) > 0.0)) return {};
  SampledSurface surface = surface_of(mesh);
  surface.neighbor_samples = std::move(near_[number]);
  PoissonDiskOptions options = options_;
  options.seed = mix_bits(options_.seed, number);
  PoissonDiskResult result = libmap::sample(surface, options, progress);
  for (std::size_t n = 0; n < boxes_.size(); ++n) {
    if (n == number) continue;
    const Eigen::Vector3d low = boxes_[n].min.array() - options.radius_m;
    const Eigen::Vector3d high = boxes_[n].max.array() + options.radius_m;
    const Bounds3d& own = boxes_[number];
    if ((own.max.array() < low.array()).any() || (own.min.array() > high.array()).any()) continue;
    for (const Eigen::Vector3d& position : result.cloud.positions)
      if ((position.array() >= low.array()).all() && (position.array() <= high.array()).all())
        near_[n].push_back(position);
  }
  return result;
}

void describe(ResultTable& table, const PoissonDiskResult& result) {
  table.add("points", result.cloud.size(), "number of samples");
  table.add("area_m2", result.area_m2, "area of the surface, m2");
  table.add("radius_m", result.radius_m, "required minimum distance between samples, m");
  table.add("smallest_distance_m", result.smallest_distance_m,
            "actual minimum distance between samples, m");
  table.add("relative_radius", result.relative_radius,
            "actual minimum distance relative to that in the densest packing of as many discs");
  table.add("radii_tried", result.tried_radii, "number of radii that were tried");
}

}  // namespace libmap
