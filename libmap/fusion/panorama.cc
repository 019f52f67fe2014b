#include "libmap/fusion/panorama.h"

#include <cmath>
#include <optional>
#include <utility>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

constexpr std::size_t rows_per_chunk = 8;

struct Part {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;
  PanoramaCounts counts;
};

void append(Part& to, Part&& more) {
  to.positions.insert(to.positions.end(), more.positions.begin(), more.positions.end());
  to.normals.insert(to.normals.end(), more.normals.begin(), more.normals.end());
  merge_into(to.counts, more.counts);
}

bool is_measured(double depth) { return depth > 0 && std::isfinite(depth); }

class ViewProjection {
 public:
  ViewProjection(const PanoramaView& view, const PanoramaOptions& options)
      : view_(view), options_(options) {}

  Part rows(std::size_t first, std::size_t last) const {
    Part part;
    for (std::size_t row = first; row < last; ++row)
      for (int x = 0; x < view_.depth.width; x += options_.stride_px)
        add_pixel(x, static_cast<int>(row) * options_.stride_px, part);
    return part;
  }

 private:
  void add_pixel(int x, int y, Part& part) const {
    const double depth = view_.depth.at(x, y);
    ++part.counts.pixels;
    if (!is_measured(depth)) {
      ++part.counts.unmeasured;
    } else if (depth < view_.near_m) {
      ++part.counts.too_near;
    } else if (depth > view_.far_m) {
      ++part.counts.too_far;
    } else if (is_flying(x, y)) {
      ++part.counts.flying;
    } else if (const auto point = point_in_camera(x, y)) {
      ++part.counts.points;
      part.positions.push_back(view_.camera.base_from_camera * *point);
      if (options_.normals) part.normals.push_back(normal(x, y, *point));
    } else {
      ++part.counts.without_ray;
    }
  }

  // Thesis eq. 2-12.
  std::optional<Eigen::Vector3d> point_in_camera(int x, int y) const {
    const auto ray = pixel_to_ray(view_.camera, Eigen::Vector2d(x, y));
    if (!ray) return std::nullopt;
    const double depth = view_.depth.at(x, y);
    return Eigen::Vector3d(ray->x() * depth, ray->y() * depth, depth);
  }

  // Returns nullopt outside the image and for pixels without depth.
  std::optional<double> depth_at(int x, int y) const {
    if (x < 0 || y < 0 || x >= view_.depth.width || y >= view_.depth.height) return std::nullopt;
    const double depth = view_.depth.at(x, y);
    return is_measured(depth) ? std::optional(depth) : std::nullopt;
  }

  bool is_flying(int x, int y) const {
    if (options_.flying_pixel_jump_m == 0) return false;
    const double depth = view_.depth.at(x, y);
    const auto jumps = [&](int dx, int dy) {
      const auto neighbor = depth_at(x + dx, y + dy);
      return neighbor && std::abs(*neighbor - depth) > options_.flying_pixel_jump_m;
    };
    return (jumps(-1, 0) && jumps(1, 0)) || (jumps(0, -1) && jumps(0, 1));
  }

  // If only one of two opposite neighbors is on the surface, the pixel itself replaces the other.
  std::optional<Eigen::Vector3d> tangent(int x, int y, int dx, int dy,
                                         const Eigen::Vector3d& point) const {
    const auto neighbor = [&](int sign) -> std::optional<Eigen::Vector3d> {
      const auto depth = depth_at(x + sign * dx, y + sign * dy);
      if (!depth || std::abs(*depth - point.z()) > options_.normal_jump_m) return std::nullopt;
      return point_in_camera(x + sign * dx, y + sign * dy);
    };
    const auto after = neighbor(1);
    const auto before = neighbor(-1);
    if (!after && !before) return std::nullopt;
    return after.value_or(point) - before.value_or(point);
  }

  Eigen::Vector3f normal(int x, int y, const Eigen::Vector3d& point) const {
    const auto along_row = tangent(x, y, 1, 0, point);
    const auto along_column = tangent(x, y, 0, 1, point);
    if (!along_row || !along_column) return Eigen::Vector3f::Zero();
    // With rows to the right and columns downwards, this product points to the camera.
    Eigen::Vector3d across = along_column->cross(*along_row);
    if (!(across.norm() > 0)) return Eigen::Vector3f::Zero();
    if (across.dot(point) > 0) across = -across;
    return (view_.camera.base_from_camera.linear() * across.normalized()).cast<float>();
  }

  const PanoramaView& view_;
  const PanoramaOptions& options_;
};

}  // namespace

void bind(ParameterTable& table, PanoramaOptions& options) {
  table.add("stride_px", options.stride_px, Range{1, 1e6},
            "step between used rows and columns of an image, pixels; 1: all pixels");
  table.add("flying_pixel_jump_m", options.flying_pixel_jump_m, not_negative,
            "depth difference from both neighbors in a row or column above which a pixel is "
            "dropped, m; 0: no pixel is dropped");
  table.add("normals", options.normals, "add normals, from neighboring pixels");
  table.add("normal_jump_m", options.normal_jump_m, positive,
            "maximum depth difference between neighboring pixels of one surface, m");
}

PanoramaResult make_panorama(const std::vector<PanoramaView>& views,
                             const PanoramaOptions& options) {
  check_parameters(options);
  PanoramaResult result;
  std::vector<double> camera;
  for (const PanoramaView& view : views) {
    const ViewProjection projection(view, options);
    const int rows_in_steps = (view.depth.height - 1) / options.stride_px + 1;
    const auto rows = static_cast<std::size_t>(rows_in_steps);
    Part part = parallel_reduce(
        rows, rows_per_chunk, Part{},
        [&](std::size_t first, std::size_t last) { return projection.rows(first, last); },
        [](Part left, Part right) {
          append(left, std::move(right));
          return left;
        });
    PointCloud& cloud = result.cloud;
    cloud.positions.insert(cloud.positions.end(), part.positions.begin(), part.positions.end());
    cloud.normals.insert(cloud.normals.end(), part.normals.begin(), part.normals.end());
    camera.insert(camera.end(), part.positions.size(), view.index);
    result.views.push_back(part.counts);
  }
  result.cloud.add_field("camera", ScalarType::int32).values = std::move(camera);
  return result;
}

void describe(ResultTable& table, const PanoramaCounts& counts) {
  table.add_hidden("pixels", counts.pixels, Merge::sum);
  table.add("points", counts.points, Merge::sum, "number of points of the view");
  table.add("unmeasured", counts.unmeasured, Merge::sum, "number of pixels without depth");
  table.add("too_near", counts.too_near, Merge::sum, "number of pixels nearer than near_m");
  table.add("too_far", counts.too_far, Merge::sum, "number of pixels farther than far_m");
  table.add("flying", counts.flying, Merge::sum,
            "number of flying pixels, whose depth differs from both neighbors");
  table.add("without_ray", counts.without_ray, Merge::sum,
            "number of pixels whose lens distortion cannot be inverted");
}

}  // namespace libmap
