#include "libmap/scenes/scene_sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/scenes/scene_geometry.h"

namespace libmap {

namespace {

using std::numbers::pi;

double steps_of(double length, double spacing) {
  return std::max(1.0, std::round(length / spacing));
}

// A face of a solid: a segment of a profile, or a rectangle (flat, or ground with bumps).
struct Patch {
  const SceneSolid* solid = nullptr;
  std::size_t segment = 0;
  const FlatFace* face = nullptr;
};

std::vector<Patch> patches_of(const SceneGeometry& geometry) {
  std::vector<Patch> patches;
  for (const SceneSolid& solid : geometry.solids()) {
    for (std::size_t i = 0; i < solid.profile.size(); ++i) patches.push_back({&solid, i, nullptr});
    for (const FlatFace& face : solid.faces) patches.push_back({&solid, 0, &face});
  }
  return patches;
}

class Sampler {
 public:
  Sampler(const SceneGeometry& geometry, double spacing, double jitter)
      : geometry_(geometry), spacing_(spacing), jitter_(jitter) {}

  std::vector<SurfaceTruth> draw(const Patch& patch, RandomStream random) const {
    std::vector<SurfaceTruth> samples;
    if (patch.face != nullptr) {
      draw_face(patch, random, samples);
    } else {
      draw_segment(patch, random, samples);
    }
    return samples;
  }

 private:
  // Relative position of a sample in its grid cell, 0 to 1.
  double jittered(RandomStream& random) const { return 0.5 + jitter_ * (random.uniform() - 0.5); }

  void draw_segment(const Patch& patch, RandomStream& random,
                    std::vector<SurfaceTruth>& samples) const {
    const ProfileSegment& segment = patch.solid->profile[patch.segment];
    const double rows = steps_of(segment.length(), spacing_);
    for (double row = 0.0; row < rows; row += 1.0) {
      const double t0 = row / rows;
      const double t1 = (row + 1.0) / rows;
      const double columns = steps_of(segment.area_between(t0, t1) / spacing_, spacing_);
      const double phase = random.uniform();
      for (double column = 0.0; column < columns; column += 1.0) {
        const double angle = 2.0 * pi * (column + phase + jittered(random)) / columns;
        const double t = segment.t_of_area_fraction(t0, t1, jittered(random));
        samples.push_back(geometry_.on_profile(*patch.solid, patch.segment, t, angle));
      }
    }
  }

  // Ground with bumps is divided into tiles of about twelve spacings, to follow the slope.
  void draw_face(const Patch& patch, RandomStream& random,
                 std::vector<SurfaceTruth>& samples) const {
    const FlatFace& face = *patch.face;
    const bool bent = patch.solid->is_ground && geometry_.has_bumps();
    const double tiles_x = bent ? steps_of(2.0 * face.half_x, 12.0 * spacing_) : 1.0;
    const double tiles_y = bent ? steps_of(2.0 * face.half_y, 12.0 * spacing_) : 1.0;
    const Eigen::Vector2d tile(2.0 * face.half_x / tiles_x, 2.0 * face.half_y / tiles_y);
    double missing_points = 0.0;  // points missing so far because of rounding to whole rows
    for (double j = 0.0; j < tiles_y; j += 1.0)
      for (double i = 0.0; i < tiles_x; i += 1.0)
        draw_tile(patch, {i * tile.x() - face.half_x, j * tile.y() - face.half_y}, tile, random,
                  samples, missing_points);
  }

  void draw_tile(const Patch& patch, const Eigen::Vector2d& corner, const Eigen::Vector2d& tile,
                 RandomStream& random, std::vector<SurfaceTruth>& samples,
                 double& missing_points) const {
    const Stretch stretch = stretch_of(patch, corner, tile);
    const double wanted = tile.prod() * stretch.area / spacing_ / spacing_ + missing_points;
    // The longer side compensates the rounding of the shorter one.
    const bool is_wide = tile.x() > tile.y();
    const double across =
        steps_of(is_wide ? tile.y() * stretch.along_y : tile.x() * stretch.along_x, spacing_);
    const double along = std::max(1.0, std::round(wanted / across));
    const double columns = is_wide ? along : across;
    const double rows = is_wide ? across : along;
    missing_points = wanted - columns * rows;
    for (double row = 0.0; row < rows; row += 1.0) {
      for (double column = 0.0; column < columns; column += 1.0) {
        const double x = corner.x() + tile.x() * (column + jittered(random)) / columns;
        const double y = corner.y() + tile.y() * (row + jittered(random)) / rows;
        samples.push_back(geometry_.on_face(*patch.solid, *patch.face, x, y));
      }
    }
  }

  // Ratio of lengths and areas on the surface to those in the plane, mean over a tile.
  struct Stretch {
    double along_x = 1.0;
    double along_y = 1.0;
    double area = 1.0;
  };

  Stretch stretch_of(const Patch& patch, const Eigen::Vector2d& corner,
                     const Eigen::Vector2d& tile) const {
    if (!patch.solid->is_ground || !geometry_.has_bumps()) return {};
    constexpr int nodes = 4;
    constexpr double fraction = 1.0 / (nodes * nodes);
    Stretch sum{0.0, 0.0, 0.0};
    for (int j = 0; j < nodes; ++j) {
      for (int i = 0; i < nodes; ++i) {
        const Eigen::Vector2d at =
            corner + tile.cwiseProduct(Eigen::Vector2d(i + 0.5, j + 0.5)) / double{nodes};
        const Eigen::Vector2d gradient = geometry_.ground_height(at.x(), at.y()).gradient;
        sum.along_x += fraction * std::hypot(1.0, gradient.x());
        sum.along_y += fraction * std::hypot(1.0, gradient.y());
        sum.area += fraction * std::sqrt(1.0 + gradient.squaredNorm());
      }
    }
    return sum;
  }

  const SceneGeometry& geometry_;
  double spacing_;
  double jitter_;
};

// Visibility of each sample from outside.
std::vector<char> visible_of(const SceneGeometry& geometry, const SceneSolid& solid,
                             const std::vector<SurfaceTruth>& samples) {
  std::vector<char> visible(samples.size());
  parallel_each(samples.size(), 4096, [&](std::size_t i) {
    visible[i] = geometry.is_visible(solid, samples[i].position, samples[i].normal) ? 1 : 0;
  });
  return visible;
}

double area_of(const SceneGeometry& geometry, const Patch& patch) {
  if (patch.face == nullptr) return patch.solid->profile[patch.segment].area();
  const double flat = 4.0 * patch.face->half_x * patch.face->half_y;
  if (!patch.solid->is_ground || !geometry.has_bumps()) return flat;
  constexpr int nodes = 256;
  double stretch = 0.0;
  for (int j = 0; j < nodes; ++j)
    for (int i = 0; i < nodes; ++i)
      stretch += std::sqrt(
          1.0 + geometry
                    .ground_height(patch.face->half_x * ((2 * i + 1) / double{nodes} - 1.0),
                                   patch.face->half_y * ((2 * j + 1) / double{nodes} - 1.0))
                    .gradient.squaredNorm());
  return flat * stretch / (nodes * nodes);
}

struct PatchAreas {
  double whole = 0.0;
  double visible = 0.0;
};

// Estimates the visible area with about `points` samples.
PatchAreas measure_areas(const SceneGeometry& geometry, const std::vector<Patch>& patches,
                         double points) {
  PatchAreas areas;
  for (const Patch& patch : patches) areas.whole += area_of(geometry, patch);
  const Sampler sampler(geometry, std::sqrt(areas.whole / points), 0.3);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const std::vector<SurfaceTruth> samples = sampler.draw(patches[i], RandomStream(1, i));
    const std::vector<char> visible = visible_of(geometry, *patches[i].solid, samples);
    areas.visible += area_of(geometry, patches[i]) *
                     static_cast<double>(std::count(visible.begin(), visible.end(), 1)) /
                     static_cast<double>(samples.size());
  }
  return areas;
}

void append(const SurfaceTruth& truth, double shift, PointCloud& cloud,
            const std::array<ScalarField*, 4>& fields) {
  cloud.positions.push_back(truth.position + shift * truth.normal);
  cloud.normals.push_back(truth.normal.cast<float>());
  fields[0]->values.push_back(truth.shape);
  fields[1]->values.push_back(truth.height);
  fields[2]->values.push_back(truth.curvature_min);
  fields[3]->values.push_back(truth.curvature_max);
}

SceneSamples sample_at(const SceneGeometry& geometry, const std::vector<Patch>& patches,
                       double spacing, const SceneSamplingOptions& options) {
  SceneSamples result;
  result.spacing_m = spacing;
  PointCloud& cloud = result.cloud;
  cloud.fields = {{"shape", ScalarType::int32, {}},
                  {"height", ScalarType::float32, {}},
                  {"curvature_min", ScalarType::float32, {}},
                  {"curvature_max", ScalarType::float32, {}}};
  const std::array<ScalarField*, 4> fields = {&cloud.fields[0], &cloud.fields[1], &cloud.fields[2],
                                              &cloud.fields[3]};
  const Sampler sampler(geometry, spacing, options.jitter);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const std::vector<SurfaceTruth> samples =
        sampler.draw(patches[i], RandomStream(options.seed, 2 * i));
    const std::vector<char> visible = visible_of(geometry, *patches[i].solid, samples);
    RandomStream noise(options.seed, 2 * i + 1);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const double shift = options.noise_m > 0.0 ? options.noise_m * noise.normal() : 0.0;
      if (visible[k] != 0) append(samples[k], shift, cloud, fields);
    }
  }
  return result;
}

}  // namespace

SceneSamples sample_scene(const PrimitiveScene& scene, const SceneSamplingOptions& options) {
  const SceneGeometry geometry(scene);
  const std::vector<Patch> patches = patches_of(geometry);
  const auto wanted = static_cast<double>(options.count);
  if (options.count > 0)
    require_count(wanted, options.max_points, "points", "count", std::to_string(options.count));
  double spacing = options.spacing_m;
  const PatchAreas areas = measure_areas(geometry, patches, 20'000.0);
  if (options.count > 0) spacing = std::sqrt(areas.visible / wanted);
  // Hidden points are drawn and then dropped, so all are limited to ten times max_points.
  const double points = areas.visible / spacing / spacing;
  const double drawn = 0.1 * areas.whole / spacing / spacing;
  require_count(std::max(points, drawn), options.max_points, "points",
                options.count > 0 ? "count" : "spacing_m", to_text(spacing));
  SceneSamples samples = sample_at(geometry, patches, spacing, options);
  for (int round = 0; round < 3 && options.count > 0 && !samples.cloud.empty(); ++round) {
    const double fraction = static_cast<double>(samples.cloud.size()) / wanted;
    if (std::abs(fraction - 1.0) <= 0.005) break;
    spacing *= std::sqrt(fraction);
    samples = sample_at(geometry, patches, spacing, options);
  }
  return samples;
}

}  // namespace libmap
