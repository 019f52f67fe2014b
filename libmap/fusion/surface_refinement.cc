#include "libmap/fusion/surface_refinement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

constexpr std::size_t chunk_size = 128;
// Gate of Tukey's biweight, in standard deviations.
constexpr float refinement_gate_sigmas = 4.0F;
// Lower bound of the cosine of incidence for the gate along the ray.
constexpr float min_search_cosine = 0.2F;
// Weight of the noise model against the scatter between frames, as a number of frames.
constexpr float prior_frames = 4.0F;
// Lower bound of the cosine between a pixel's ray and the plane's normal.
constexpr float min_cosine = 0.02F;
// Share of a shift that is counted as remaining error, measured on the test sites.
constexpr float bend_fraction = 0.5F;
// Minimum cosine of incidence at which every surface is expected to be measured.
constexpr float sure_cosine = 0.5F;
// Share of a frame's depth range in which every surface is expected to be measured.
constexpr float sure_range = 0.95F;
// Weight of color without depth that confirms the element.
constexpr float unmeasured_color_fraction = 1e-3F;

using Four = Eigen::Array<float, 4, 1>;

// Weighted sums over one frame or all frames; heights are along the normal, m.
struct HeightSum {
  float weight = 0.0F;
  float height = 0.0F;   // sum of weight x height
  float squares = 0.0F;  // sum of weight^2 x variance of the measurement

  void operator+=(const HeightSum& more) {
    weight += more.weight;
    height += more.height;
    squares += more.squares;
  }
};

struct ElementSum {
  HeightSum all;
  // Frames' mean heights, weighted by their variances: sums of weights, heights and squares.
  std::array<float, 3> scatter{};
  std::uint32_t frames = 0;
  float seen = 0.0F;
  float seen_through = 0.0F;
  float missed = 0.0F;
  std::array<float, 3> color{};
  float color_weight = 0.0F;
  // The frame that is being gathered, possibly from several cameras.
  std::uint32_t frame = 0;
  HeightSum current;
};

struct Chunk {
  std::size_t begin = 0;
  std::size_t end = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

struct PixelBox {
  int left = 0;
  int right = 0;
  int top = 0;
  int bottom = 0;
};

// An element in the frame of one camera.
struct SeenElement {
  Eigen::Vector3f position;  // optical frame
  Eigen::Vector3f normal;
  float plane = 0.0F;   // normal . position
  float cosine = 0.0F;  // cosine of incidence
  Eigen::Vector2f pixel;
  float sigma = 0.0F;        // axial noise, m
  float gate = 0.0F;         // maximum difference between measured depth and the plane's depth, m
  float radius = 0.0F;       // radius of the disc, m
  float information = 0.0F;  // inverse variance along the normal
};

// Uses Eigen's `max`, which is vectorized, unlike a comparison.
inline Four not_negative_part(const Four& value) { return value.max(Four::Zero()); }

class ViewGather {
 public:
  ViewGather(const RefinementView& view, const DepthSensor& sensor, const SurfaceSearch& search)
      : view_(view),
        sensor_(sensor),
        search_(search),
        rotation_(view.camera_from_grid.linear()),
        translation_(view.camera_from_grid.translation()),
        rotation_f_(rotation_.cast<float>()),
        pixel_pitch_(
            static_cast<float>(1.0 / std::min(view.depth_camera.fx, view.depth_camera.fy))),
        min_incidence_(
            static_cast<float>(std::cos(sensor.max_incidence_deg * std::numbers::pi / 180.0))),
        is_distorted_(view.depth_camera.is_distorted()) {
    // Margin of two pixels around the image.
    const Eigen::Vector2d beyond = (view.rays->max - view.rays->min) * 2.0 /
                                   std::max(1, std::min(view.rays->width, view.rays->height));
    lowest_ray_ = view.rays->min - beyond;
    highest_ray_ = view.rays->max + beyond;
  }

  bool may_see(const Chunk& chunk) const {
    const Eigen::Vector3d p = rotation_ * chunk.center + translation_;
    if (p.z() + chunk.radius < sensor_.min_depth_m || p.z() - chunk.radius > sensor_.max_depth_m)
      return false;
    const auto beyond = [&](double offset, double slope) {
      return offset > chunk.radius * std::sqrt(1.0 + slope * slope);
    };
    const Eigen::Vector2d& low = view_.rays->min;
    const Eigen::Vector2d& high = view_.rays->max;
    return !beyond(low.x() * p.z() - p.x(), low.x()) &&
           !beyond(p.x() - high.x() * p.z(), high.x()) &&
           !beyond(low.y() * p.z() - p.y(), low.y()) && !beyond(p.y() - high.y() * p.z(), high.y());
  }

  void gather(const SurfaceElement& element, ElementSum& sum) const {
    SeenElement seen;
    if (!look_at(element, seen)) return;
    const int x = static_cast<int>(std::lround(seen.pixel.x()));
    const int y = static_cast<int>(std::lround(seen.pixel.y()));
    const float center = view_.depth_m[view_index(x, y)];
    const bool is_measured = center > 0.0F;
    const float miss = center - plane_depth(seen, x, y);
    if (is_measured && miss > seen.gate) {
      sum.seen_through += seen.cosine;
      return;
    }
    if (is_measured && miss < -seen.gate) return;  // hidden
    const HeightSum heights = disc(seen);
    if (!(heights.weight > 0.0F)) {
      if (should_measure(seen, x, y)) sum.missed += seen.cosine;
      return;
    }
    sum.current += heights;
    if (is_measured) sum.seen += seen.cosine;
    if (!view_.color.empty()) add_color(seen, is_measured ? 1.0F : unmeasured_color_fraction, sum);
  }

 private:
  std::size_t view_index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(view_.rays->width) +
           static_cast<std::size_t>(x);
  }

  bool look_at(const SurfaceElement& element, SeenElement& seen) const {
    const Eigen::Vector3d p = rotation_ * element.position.cast<double>() + translation_;
    if (!(p.z() >= sensor_.min_depth_m && p.z() <= sensor_.max_depth_m)) return false;
    if (is_distorted_) {
      const Eigen::Array2d ray = p.head<2>() / p.z();
      if (!((ray > lowest_ray_).all() && (ray < highest_ray_).all())) return false;
      const auto pixel = project_point(view_.depth_camera, p);
      if (!pixel) return false;
      seen.pixel = pixel->cast<float>();
    } else {
      const Camera& camera = view_.depth_camera;
      seen.pixel.x() = static_cast<float>(camera.fx * p.x() / p.z() + camera.cx);
      seen.pixel.y() = static_cast<float>(camera.fy * p.y() / p.z() + camera.cy);
    }
    if (!(seen.pixel.x() > -0.5F && seen.pixel.y() > -0.5F &&
          seen.pixel.x() < static_cast<float>(view_.rays->width) - 0.5F &&
          seen.pixel.y() < static_cast<float>(view_.rays->height) - 0.5F))
      return false;
    seen.position = p.cast<float>();
    seen.normal = rotation_f_ * element.normal;
    seen.plane = seen.normal.dot(seen.position);
    seen.cosine = -seen.plane / seen.position.norm();
    if (!(seen.cosine >= min_incidence_)) return false;
    const float z = seen.position.z();
    const float square = seen.cosine * seen.cosine;
    const float lateral = static_cast<float>(sensor_.noise.lateral_px) * pixel_pitch_ * z;
    seen.sigma = static_cast<float>(sensor_.noise.axial_at(p.z()));
    seen.information =
        1.0F / (seen.sigma * seen.sigma * square + lateral * lateral * (1.0F - square));
    seen.gate = refinement_gate_sigmas * seen.sigma +
                static_cast<float>(search_.search_m) / std::max(seen.cosine, min_search_cosine);
    // At least the footprint of a pixel, so that the disc is not empty.
    seen.radius = std::max(static_cast<float>(search_.disc_radius_m),
                           static_cast<float>(min_disc_pixels) * pixel_pitch_ * z);
    return true;
  }

  // Returns true if the view should measure the element but has no depth around its pixel.
  bool should_measure(const SeenElement& seen, int x, int y) const {
    const float z = seen.position.z();
    if (seen.cosine < sure_cosine || z * sure_range < view_.nearest_m ||
        z > sure_range * view_.farthest_m || x < 1 || y < 1 || x + 1 >= view_.rays->width ||
        y + 1 >= view_.rays->height)
      return false;
    for (int row = y - 1; row <= y + 1; ++row)
      for (int column = x - 1; column <= x + 1; ++column)
        if (view_.depth_m[view_index(column, row)] > 0.0F) return false;
    return true;
  }

  float plane_depth(const SeenElement& seen, int x, int y) const {
    const std::size_t n = view_index(x, y);
    const float along =
        seen.normal.x() * view_.rays->x[n] + seen.normal.y() * view_.rays->y[n] + seen.normal.z();
    return seen.plane / std::min(along, -min_cosine);
  }

  // Bounding box of the disc's image, to first order.
  PixelBox box_of(const SeenElement& seen) const {
    const Eigen::Vector3f& p = seen.position;
    const auto reach = [&](int axis, double focal_length) {
      Eigen::Vector3f slope = Eigen::Vector3f::Unit(axis);
      slope.z() = -p[axis] / p.z();
      const float across = slope.dot(seen.normal);
      const float in_plane = std::sqrt(std::max(0.0F, slope.squaredNorm() - across * across));
      return static_cast<float>(focal_length) * seen.radius * in_plane / p.z();
    };
    const float rx = std::min(reach(0, view_.depth_camera.fx), 1e6F);
    const float ry = std::min(reach(1, view_.depth_camera.fy), 1e6F);
    const int width = view_.rays->width;
    const int height = view_.rays->height;
    return {std::max(0, static_cast<int>(std::ceil(seen.pixel.x() - rx))),
            std::min(width - 1, static_cast<int>(std::floor(seen.pixel.x() + rx))),
            std::max(0, static_cast<int>(std::ceil(seen.pixel.y() - ry))),
            std::min(height - 1, static_cast<int>(std::floor(seen.pixel.y() + ry)))};
  }

  // Sums heights of the measurements above the element's plane, weighted by their distance from its
  // center (Epanechnikov) and from the plane (Tukey). A measurement's position is the intersection
  // of its ray with the plane, which does not depend on noise.
  HeightSum disc(const SeenElement& seen) const {
    const PixelBox box = box_of(seen);
    const float* ray_x = view_.rays->x.data();
    const float* ray_y = view_.rays->y.data();
    const float disc_scale = 1.0F / (seen.radius * seen.radius);
    const float gate_scale = 1.0F / (seen.gate * seen.gate);
    Four weights = Four::Zero();
    Four heights = Four::Zero();
    Four squares = Four::Zero();
    for (int y = box.top; y <= box.bottom; ++y) {
      const std::size_t row = view_index(0, y);
      for (int x = box.left; x <= box.right; x += 4) {
        const std::size_t n = row + static_cast<std::size_t>(x);
        const Four rx = Eigen::Map<const Four>(ray_x + n);
        const Four ry = Eigen::Map<const Four>(ray_y + n);
        const Four depth = Eigen::Map<const Four>(view_.depth_m.data() + n);
        const Four along =
            (seen.normal.x() * rx + seen.normal.y() * ry + seen.normal.z()).min(-min_cosine);
        const Four plane = seen.plane / along;
        const Four dx = rx * plane - seen.position.x();
        const Four dy = ry * plane - seen.position.y();
        const Four dz = plane - seen.position.z();
        const Four near = not_negative_part(1.0F - disc_scale * (dx * dx + dy * dy + dz * dz));
        const Four miss = depth - plane;
        const Four fits = not_negative_part(1.0F - gate_scale * miss * miss);
        const Four weight = near * fits * fits;
        weights += weight;
        heights += weight * (miss * along);
        squares += weight * weight;
      }
    }
    // A depth difference along a ray is `along` times the height along the normal; both are
    // negative towards the camera.
    return {seen.information * weights.sum(), seen.information * heights.sum(),
            seen.information * squares.sum()};
  }

  void add_color(const SeenElement& seen, float fraction, ElementSum& sum) const {
    const Camera& camera = view_.color_camera;
    Eigen::Vector2f pixel = seen.pixel;
    if (camera.width != view_.depth_camera.width || camera.height != view_.depth_camera.height) {
      const auto exact = project_point(camera, seen.position.cast<double>());
      if (!exact) return;
      pixel = exact->cast<float>();
    }
    const float u = std::clamp(pixel.x(), 0.0F, static_cast<float>(camera.width - 1));
    const float v = std::clamp(pixel.y(), 0.0F, static_cast<float>(camera.height - 1));
    const int x = std::min(static_cast<int>(u), std::max(0, camera.width - 2));
    const int y = std::min(static_cast<int>(v), std::max(0, camera.height - 2));
    const int right = std::min(x + 1, camera.width - 1);
    const int below = std::min(y + 1, camera.height - 1);
    const float a = u - static_cast<float>(x);
    const float b = v - static_cast<float>(y);
    // The squared number of pixels on the element favors near and frontal views.
    const float area = seen.cosine / (seen.position.z() * seen.position.z());
    const float weight = fraction * area * area;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto at = [&](int column, int row) {
        return static_cast<float>(view_.color.at(column, row)[c]);
      };
      sum.color[c] += weight * ((1 - b) * ((1 - a) * at(x, y) + a * at(right, y)) +
                                b * ((1 - a) * at(x, below) + a * at(right, below)));
    }
    sum.color_weight += weight;
  }

  const RefinementView& view_;
  const DepthSensor& sensor_;
  const SurfaceSearch& search_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
  Eigen::Matrix3f rotation_f_;
  float pixel_pitch_;
  float min_incidence_;
  bool is_distorted_;
  Eigen::Array2d lowest_ray_;
  Eigen::Array2d highest_ray_;
};

void close_frame(ElementSum& sum, float pose_variance) {
  const HeightSum& one = sum.current;
  if (one.weight > 0.0F) {
    const float mean = one.height / one.weight;
    // All measurements of a frame share its pose error.
    const float own = one.weight * one.weight / one.squares;
    const float information = own / (1.0F + pose_variance * own);
    const float fraction = 1.0F / (1.0F + pose_variance * own);
    sum.scatter[0] += information;
    sum.scatter[1] += information * mean;
    sum.scatter[2] += information * mean * mean;
    sum.all += {fraction * one.weight, fraction * one.height,
                fraction * fraction * (one.squares + pose_variance * one.weight * one.weight)};
    ++sum.frames;
  }
  sum.current = {};
}

RefinedElement result_of(const ElementSum& sum) {
  RefinedElement refined;
  refined.frames = sum.frames;
  refined.seen = sum.seen;
  refined.seen_through = sum.seen_through;
  refined.missed = sum.missed;
  if (sum.frames == 0) return refined;
  const float mean = sum.all.height / sum.all.weight;
  refined.shift_m = mean;
  // Scales the error of the mean by the ratio of frames' scatter to noise (Birge 1932).
  const float excess =
      std::max(0.0F, sum.scatter[2] - 2.0F * mean * sum.scatter[1] + mean * mean * sum.scatter[0]);
  const float birge =
      (prior_frames + excess) / (prior_frames + static_cast<float>(sum.frames) - 1.0F);
  const float noise = std::sqrt(sum.all.squares * birge) / sum.all.weight;
  refined.expected_error_m = std::hypot(noise, bend_fraction * mean);
  for (std::size_t c = 0; c < 3; ++c)
    if (sum.color_weight > 0.0F)
      refined.color[c] =
          static_cast<std::uint8_t>(std::lround(std::min(255.0F, sum.color[c] / sum.color_weight)));
  return refined;
}

std::vector<Chunk> chunks_of(std::span<const SurfaceElement> elements, double margin_m) {
  std::vector<Chunk> chunks;
  for (std::size_t begin = 0; begin < elements.size(); begin += chunk_size) {
    Chunk chunk{begin, std::min(begin + chunk_size, elements.size()), {}, 0.0};
    Eigen::AlignedBox3d box;
    for (std::size_t n = chunk.begin; n < chunk.end; ++n)
      box.extend(elements[n].position.cast<double>());
    chunk.center = box.center();
    chunk.radius = 0.5 * box.diagonal().norm() + margin_m;
    chunks.push_back(chunk);
  }
  return chunks;
}

}  // namespace

double max_gate_m(const DepthSensor& sensor, const SurfaceSearch& search) {
  return static_cast<double>(refinement_gate_sigmas) * sensor.noise.axial_at(sensor.max_depth_m) +
         search.search_m / static_cast<double>(min_search_cosine);
}

RefinedSurface refine_surface(std::vector<SurfaceElement> elements, const DepthSensor& sensor,
                              const SurfaceSearch& search, double pose_error_m,
                              const std::function<void(const AddViews&)>& each_group) {
  const std::vector<Chunk> chunks = chunks_of(elements, search.disc_radius_m);
  const auto variance = static_cast<float>(pose_error_m * pose_error_m);
  std::vector<ElementSum> sums(elements.size());
  RefinedSurface surface;
  each_group([&](std::span<const RefinementView> views) {
    std::vector<ViewGather> gathers;
    gathers.reserve(views.size());
    for (const RefinementView& view : views) {
      gathers.emplace_back(view, sensor, search);
      surface.has_color = surface.has_color || !view.color.empty();
    }
    parallel_for(chunks.size(), 4, [&](std::size_t first, std::size_t last) {
      for (std::size_t c = first; c < last; ++c)
        for (std::size_t v = 0; v < views.size(); ++v) {
          if (!gathers[v].may_see(chunks[c])) continue;
          for (std::size_t n = chunks[c].begin; n < chunks[c].end; ++n) {
            if (sums[n].frame != views[v].frame) {
              close_frame(sums[n], variance);
              sums[n].frame = views[v].frame;
            }
            gathers[v].gather(elements[n], sums[n]);
          }
        }
    });
  });
  surface.refined.resize(sums.size());
  parallel_for(sums.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      close_frame(sums[n], variance);
      surface.refined[n] = result_of(sums[n]);
    }
  });
  surface.elements = std::move(elements);
  return surface;
}

std::vector<SurfaceObservation> observe_surface(std::span<const SurfaceElement> elements,
                                                std::span<const RefinementView> views,
                                                const DepthSensor& sensor,
                                                const SurfaceSearch& search) {
  std::vector<ViewGather> gathers;
  gathers.reserve(views.size());
  for (const RefinementView& view : views) gathers.emplace_back(view, sensor, search);
  const std::vector<Chunk> chunks = chunks_of(elements, search.disc_radius_m);
  std::vector<std::vector<SurfaceObservation>> found(chunks.size());
  parallel_for(chunks.size(), 4, [&](std::size_t first, std::size_t last) {
    for (std::size_t c = first; c < last; ++c) {
      std::vector<std::size_t> seen_by;
      for (std::size_t v = 0; v < views.size(); ++v)
        if (gathers[v].may_see(chunks[c])) seen_by.push_back(v);
      for (std::size_t n = chunks[c].begin; n < chunks[c].end; ++n)
        for (const std::size_t v : seen_by) {
          ElementSum sum;
          gathers[v].gather(elements[n], sum);
          const HeightSum& one = sum.current;
          if (!(one.weight > 0.0F)) continue;
          found[c].push_back({static_cast<std::uint32_t>(n), views[v].frame,
                              one.height / one.weight, one.squares / (one.weight * one.weight)});
        }
    }
  });
  std::vector<SurfaceObservation> observations;
  for (const auto& part : found) observations.insert(observations.end(), part.begin(), part.end());
  return observations;
}

RefinementView make_refinement_view(CameraView view, std::shared_ptr<const PixelRays> rays,
                                    const Pose& camera_from_grid, std::uint32_t frame) {
  RefinementView made;
  made.frame = frame;
  made.depth_camera = std::move(view.depth_camera);
  made.color_camera = std::move(view.color_camera);
  made.depth_m = std::move(view.depth.pixels);
  for (float& z : made.depth_m)
    if (!(z > 0.0F && std::isfinite(z))) z = 0.0F;
  for (const float z : made.depth_m) {
    if (z == 0.0F) continue;
    made.nearest_m = made.nearest_m > 0.0F ? std::min(made.nearest_m, z) : z;
    made.farthest_m = std::max(made.farthest_m, z);
  }
  made.depth_m.resize(made.depth_m.size() + 4, 0.0F);
  for (const std::size_t n : rays->blind) made.depth_m[n] = 0.0F;
  made.color = std::move(view.color);
  made.rays = std::move(rays);
  made.camera_from_grid = camera_from_grid;
  return made;
}

}  // namespace libmap
