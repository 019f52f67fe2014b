#include "libmap/simulate/depth_camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/simulate/rock_texture.h"

namespace libmap {

namespace {

constexpr std::size_t rows_per_task = 8;
constexpr double radians = std::numbers::pi / 180.0;
// Band below max_incidence_deg over which the loss of measurements increases.
constexpr double grazing_band_deg = 10.0;

// Diffuse and directional light.
constexpr float sky_light = 0.7F;
constexpr float side_light = 0.4F;
const Eigen::Vector3f& toward_light() {
  static const Eigen::Vector3f direction = Eigen::Vector3f(0.4F, -0.5F, 0.75F).normalized();
  return direction;
}
// Color of pixels without a surface.
const Eigen::Vector3f background(0.62F, 0.64F, 0.66F);

std::vector<Eigen::Vector2d> lattice_rays(const Camera& camera, int width, int height,
                                          double shift) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector2d> rays;
  rays.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rays.push_back(pixel_to_ray(camera, Eigen::Vector2d(x + shift, y + shift))
                         .value_or(Eigen::Vector2d(nan, nan)));
  return rays;
}

}  // namespace

ViewRays make_view_rays(const Camera& camera) {
  return {camera.width, camera.height, ray_table(camera),
          lattice_rays(camera, camera.width + 1, camera.height + 1, -0.5)};
}

struct VisibleSurface::Seen {
  float depth = 0.0F;
  float incidence_cos = 0.0F;
  Eigen::Vector3f color = background;
};

struct VisibleSurface::Part {
  RayCaster caster;
  TriangleMesh mesh;  // with vertex normals
  std::uint64_t texture_seed = 1;

  Eigen::Vector3f albedo(const RayHit& hit, const Eigen::Vector3d& point) const;
  Seen look(const RayHit& hit, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
            bool with_color) const;
};

Eigen::Vector3f VisibleSurface::Part::albedo(const RayHit& hit,
                                             const Eigen::Vector3d& point) const {
  const auto to_vector = [](const Color& color) -> Eigen::Vector3f {
    return Eigen::Vector3f(color[0], color[1], color[2]) / 255.0F;
  };
  if (mesh.vertex_colors.empty()) return to_vector(rock_color(point, texture_seed));
  const Triangle& t = mesh.triangles[hit.triangle];
  return static_cast<float>(1.0 - hit.u - hit.v) * to_vector(mesh.vertex_colors[t[0]]) +
         static_cast<float>(hit.u) * to_vector(mesh.vertex_colors[t[1]]) +
         static_cast<float>(hit.v) * to_vector(mesh.vertex_colors[t[2]]);
}

VisibleSurface::Seen VisibleSurface::Part::look(const RayHit& hit, const Eigen::Vector3d& origin,
                                                const Eigen::Vector3d& direction,
                                                bool with_color) const {
  Seen seen;
  seen.depth = static_cast<float>(hit.distance);
  const Triangle& t = mesh.triangles[hit.triangle];
  const Eigen::Vector3d flat = area_normal(mesh, t).normalized();
  const double cosine = flat.dot(direction) / direction.norm();
  seen.incidence_cos = static_cast<float>(std::min(1.0, std::abs(cosine)));
  if (!with_color) return seen;
  Eigen::Vector3f normal = (static_cast<float>(1.0 - hit.u - hit.v) * mesh.vertex_normals[t[0]] +
                            static_cast<float>(hit.u) * mesh.vertex_normals[t[1]] +
                            static_cast<float>(hit.v) * mesh.vertex_normals[t[2]])
                               .normalized();
  if (!normal.allFinite()) normal = flat.cast<float>();
  // Open meshes are also visible from behind.
  if (cosine > 0) normal = -normal;
  const float light = sky_light * (0.75F + 0.25F * normal.z()) +
                      side_light * std::max(0.0F, normal.dot(toward_light()));
  seen.color = (light * albedo(hit, origin + hit.distance * direction)).cwiseMin(1.0F);
  return seen;
}

void VisibleSurface::view_row(std::span<const Eigen::Vector2d> rays, const Pose& world_from_camera,
                              bool with_color, const Sink& sink) const {
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(rays.size());
  for (const Eigen::Vector2d& ray : rays)
    directions.emplace_back(world_from_camera.linear() * Eigen::Vector3d(ray.x(), ray.y(), 1.0));
  const Eigen::Vector3d origin = world_from_camera.translation();
  std::vector<RayHit> hits(rays.size());
  std::vector<RayHit> nearest(rays.size(), RayHit{.triangle = RayHit::no_triangle});
  std::vector<const Part*> seen(rays.size(), nullptr);
  for (const std::shared_ptr<const Part>& part : parts_) {
    part->caster.cast_bundle(origin, directions, hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (hits[i].triangle == RayHit::no_triangle) continue;
      if (seen[i] != nullptr && !(hits[i].distance < nearest[i].distance)) continue;
      nearest[i] = hits[i];
      seen[i] = part.get();
    }
  }
  for (std::size_t i = 0; i < hits.size(); ++i)
    sink(i, seen[i] == nullptr ? Seen{}
                               : seen[i]->look(nearest[i], origin, directions[i], with_color));
}

VisibleSurface::VisibleSurface(const TriangleMesh& mesh, TextureSource texture,
                               std::uint64_t texture_seed, ShadingNormals normals) {
  const auto part = std::make_shared<Part>(Part{RayCaster(mesh), mesh, texture_seed});
  std::vector<Color>& colors = part->mesh.vertex_colors;
  if (texture == TextureSource::mesh && colors.empty())
    throw Error("the mesh has none; use texture rock", {.field = "vertex colors"});
  const bool plain = std::all_of(colors.begin(), colors.end(),
                                 [&](const Color& color) { return color == colors.front(); });
  if (texture == TextureSource::rock || (texture == TextureSource::automatic && plain))
    colors.clear();
  if (normals == ShadingNormals::estimated)
    part->mesh.vertex_normals = estimate_vertex_normals(mesh);
  else if (mesh.vertex_normals.empty())
    throw Error("the mesh has none", {.field = "vertex normals"});
  part->mesh.vertex_fields.clear();
  part->mesh.face_fields.clear();
  parts_ = {part};
}

VisibleSurface::VisibleSurface(std::span<const VisibleSurface> parts) {
  for (const VisibleSurface& part : parts)
    parts_.insert(parts_.end(), part.parts_.begin(), part.parts_.end());
}

const RayCaster& VisibleSurface::caster() const { return parts_.front()->caster; }
const TriangleMesh& VisibleSurface::mesh() const { return parts_.front()->mesh; }

SurfaceView VisibleSurface::view(const ViewRays& rays, const Pose& world_from_camera,
                                 bool with_color) const {
  return view(
      rays, [&](double) { return world_from_camera; }, with_color);
}

SurfaceView VisibleSurface::view(const ViewRays& rays, const PoseOfRow& world_from_camera,
                                 bool with_color) const {
  const int w = rays.width;
  const int h = rays.height;
  SurfaceView view{DepthImage(w, h), DepthImage(w + 1, h + 1), Image<float>(w, h), {}};
  Image<Eigen::Vector3f> corner_color;
  if (with_color) {
    view.color = Image<Eigen::Vector3f>(w, h, background);
    corner_color = Image<Eigen::Vector3f>(w + 1, h + 1, background);
  }
  const auto row_of = [](const std::vector<Eigen::Vector2d>& all, std::size_t row, int width) {
    const auto count = static_cast<std::size_t>(width);
    return std::span<const Eigen::Vector2d>(all).subspan(row * count, count);
  };
  parallel_each(static_cast<std::size_t>(h) + 1, rows_per_task, [&](std::size_t y) {
    const std::size_t corner_start = y * static_cast<std::size_t>(w + 1);
    view_row(row_of(rays.corners, y, w + 1), world_from_camera(static_cast<double>(y) - 0.5),
             with_color, [&](std::size_t x, const Seen& seen) {
               view.corner_depth.pixels[corner_start + x] = seen.depth;
               if (with_color) corner_color.pixels[corner_start + x] = seen.color;
             });
    if (y == static_cast<std::size_t>(h)) return;
    const std::size_t start = y * static_cast<std::size_t>(w);
    view_row(row_of(rays.centers, y, w), world_from_camera(static_cast<double>(y)), with_color,
             [&](std::size_t x, const Seen& seen) {
               view.depth.pixels[start + x] = seen.depth;
               view.incidence_cos.pixels[start + x] = seen.incidence_cos;
               if (with_color) view.color.pixels[start + x] = seen.color;
             });
  });
  for (int y = 0; with_color && y < h; ++y)
    for (int x = 0; x < w; ++x)
      view.color.at(x, y) = 0.5F * view.color.at(x, y) +
                            0.125F * (corner_color.at(x, y) + corner_color.at(x + 1, y) +
                                      corner_color.at(x, y + 1) + corner_color.at(x + 1, y + 1));
  return view;
}

void bind_noise(ParameterTable& table, DepthSensorOptions& options) {
  table.add("noise_m", options.noise_m, not_negative,
            "standard deviation of depth noise along the ray: constant term, m");
  table.add("noise_of_range", options.noise_of_range, not_negative,
            "standard deviation of depth noise: term proportional to range, m per m");
  table.add("noise_of_square", options.noise_of_square, not_negative,
            "standard deviation of depth noise: term proportional to squared range, 1/m");
  table.add("depth_offset_m", options.depth_offset_m, any_number,
            "offset added to every measured range, m");
  table.add("max_incidence_deg", options.max_incidence_deg, {0.0, 90.0},
            "maximum angle between ray and normal of measured surfaces, degrees; 90: no limit");
  table.add("edge_gap_m", options.edge_gap_m, positive,
            "depth difference within a pixel above which the pixel is at a depth discontinuity, m");
  table.add("flying_pixels", options.flying_pixels, zero_to_one,
            "share of the pixels at depth discontinuities that mix foreground and background");
  table.add("edge_dropouts", options.edge_dropouts, zero_to_one,
            "share of the pixels at depth discontinuities without depth");
}

void bind(ParameterTable& table, DepthSensorOptions& options) {
  bind_noise(table, options);
  table.add("depth_step_m", options.depth_step_m, not_negative,
            "step to which measured depth is rounded, m; 0: not rounded");
  table.add("near_m", options.near_m, not_negative, "minimum measured depth, m");
  table.add("far_m", options.far_m, positive, "maximum measured depth, m");
}

void bind(ParameterTable& table, PhotoOptions& options) {
  table.add("vignetting", options.vignetting, zero_to_one,
            "loss of brightness in the corners of color images, 0 to 1");
  table.add("color_noise", options.color_noise, not_negative,
            "standard deviation of color noise, in units of 0 to 255");
}

DepthSensorOptions ideal_depth_sensor(double near_m, double far_m) {
  return {.noise_m = 0.0,
          .noise_of_range = 0.0,
          .depth_offset_m = 0.0,
          .depth_step_m = 0.0,
          .near_m = near_m,
          .far_m = far_m,
          .max_incidence_deg = 90.0,
          .edge_gap_m = 0.05,
          .flying_pixels = 0.0,
          .edge_dropouts = 0.0};
}

void DepthSensorOptions::check() const {
  if (!(far_m > near_m))
    throw Error("the depth range is empty",
                {.field = "far_m", .value = to_text(far_m), .bound = "> " + to_text(near_m)});
  if (!(flying_pixels + edge_dropouts <= 1.0))
    throw Error("the sum of both exceeds 1", {.field = "flying_pixels + edge_dropouts",
                                              .value = to_text(flying_pixels + edge_dropouts),
                                              .bound = "<= 1"});
}

namespace {

struct PixelDepths {
  double center = 0.0;
  std::array<double, 4> corners{};  // opposite corners are adjacent
};

PixelDepths depths_of(const SurfaceView& view, int x, int y) {
  const auto corner = [&](int i, int j) {
    return static_cast<double>(view.corner_depth.at(x + i, y + j));
  };
  return {static_cast<double>(view.depth.at(x, y)),
          {corner(0, 0), corner(1, 1), corner(1, 0), corner(0, 1)}};
}

// Returns true if depth is discontinuous within the pixel. On a plane, inverse depth is linear in
// the image, so the harmonic mean of opposite corners is the center's depth at any incidence. With
// a discontinuity g, the center deviates by at least g / 2 from one of the two means.
bool is_edge(const PixelDepths& depths, double gap) {
  for (std::size_t k = 0; k < 4; k += 2) {
    const double a = depths.corners[k];
    const double b = depths.corners[k + 1];
    if (a <= 0 || b <= 0) return true;
    if (std::abs(depths.center - 2 * a * b / (a + b)) > gap / 2) return true;
  }
  return false;
}

// Probability of a missing depth at this incidence.
double grazing_loss(double incidence_cos, double max_incidence_deg) {
  if (max_incidence_deg >= 90.0) return 0.0;
  const double angle = std::acos(std::clamp(incidence_cos, 0.0, 1.0)) / radians;
  return std::clamp((angle - max_incidence_deg) / grazing_band_deg + 1.0, 0.0, 1.0);
}

enum class PixelKind { nothing, plain, edge, flying };

// Measured depth of one pixel, 0 if there is none.
std::pair<double, PixelKind> measure_pixel(const PixelDepths& depths, double incidence_cos,
                                           double range_of_depth, const DepthSensorOptions& options,
                                           RandomStream random) {
  if (depths.center <= 0 || !std::isfinite(range_of_depth)) return {0.0, PixelKind::nothing};
  const double fate = random.uniform();
  const double grazing_fate = random.uniform();
  const double blend = random.uniform();
  double depth = depths.center;
  PixelKind kind = PixelKind::plain;
  if (is_edge(depths, options.edge_gap_m)) {
    kind = PixelKind::edge;
    if (fate < options.edge_dropouts) return {0.0, kind};
    if (fate < options.edge_dropouts + options.flying_pixels) {
      double front = depth;
      double back = depth;
      for (const double corner : depths.corners) {
        if (corner <= 0) continue;
        front = std::min(front, corner);
        back = std::max(back, corner);
      }
      depth = front + blend * (back - front);
      if (back > front) kind = PixelKind::flying;
    }
  }
  if (grazing_fate < grazing_loss(incidence_cos, options.max_incidence_deg)) return {0.0, kind};
  const double range = depth * range_of_depth;
  const double deviation =
      options.noise_m + options.noise_of_range * range + options.noise_of_square * range * range;
  const double measured_range = range + options.depth_offset_m + deviation * random.normal();
  double measured = measured_range / range_of_depth;
  if (options.depth_step_m > 0)
    measured = std::round(measured / options.depth_step_m) * options.depth_step_m;
  if (!(measured > 0 && measured >= options.near_m && measured <= options.far_m))
    return {0.0, kind};
  return {measured, kind};
}

}  // namespace

DepthMeasurement measure_depth(const SurfaceView& view, const ViewRays& rays,
                               const DepthSensorOptions& options, std::uint64_t seed) {
  DepthMeasurement result{.depth = DepthImage(view.depth.width, view.depth.height)};
  struct Counts {
    std::size_t measured = 0, edges = 0, flying = 0;
  };
  const Counts counts = parallel_reduce(
      static_cast<std::size_t>(view.depth.height), rows_per_task, Counts{},
      [&](std::size_t begin, std::size_t end) {
        Counts part;
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
          for (int x = 0; x < view.depth.width; ++x) {
            const std::size_t index = view.depth.index(x, y);
            const auto [depth, kind] = measure_pixel(
                depths_of(view, x, y), static_cast<double>(view.incidence_cos.pixels[index]),
                rays.centers[index].homogeneous().norm(), options, RandomStream(seed, index));
            result.depth.pixels[index] = static_cast<float>(depth);
            part.measured += depth > 0;
            part.edges += kind == PixelKind::edge || kind == PixelKind::flying;
            part.flying += kind == PixelKind::flying && depth > 0;
          }
        return part;
      },
      [](const Counts& a, const Counts& b) {
        return Counts{a.measured + b.measured, a.edges + b.edges, a.flying + b.flying};
      });
  result.measured = counts.measured;
  result.edges = counts.edges;
  result.flying = counts.flying;
  return result;
}

ColorImage take_photo(const SurfaceView& view, const PhotoOptions& options, std::uint64_t seed) {
  const int w = view.color.width;
  const int h = view.color.height;
  ColorImage photo(w, h);
  const Eigen::Vector2d middle(0.5 * (w - 1), 0.5 * (h - 1));
  const double largest = std::max(middle.squaredNorm(), 1e-9);
  parallel_each(static_cast<std::size_t>(h), rows_per_task, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < w; ++x) {
      const std::size_t index = photo.index(x, y);
      RandomStream random(seed, index);
      const double radius2 = (Eigen::Vector2d(x, y) - middle).squaredNorm() / largest;
      const double scale = 255.0 * (1.0 - options.vignetting * radius2);
      for (std::size_t c = 0; c < 3; ++c) {
        double value =
            scale * static_cast<double>(view.color.pixels[index][static_cast<Eigen::Index>(c)]);
        if (options.color_noise > 0) value += options.color_noise * random.normal();
        photo.pixels[index][c] =
            static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
      }
    }
  });
  return photo;
}

}  // namespace libmap
