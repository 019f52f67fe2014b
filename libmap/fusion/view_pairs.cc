#include "libmap/fusion/view_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace libmap {

namespace {

constexpr double samples_per_view = 2000.0;
constexpr int patch_radius = 2;
constexpr std::size_t patch_pixels = 25;
constexpr float max_patch_relief = 0.05F;  // depth range of a patch, relative to its depth
constexpr float min_deviation = 4.0F;      // of the brightness, 0 to 255
constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

using Patch = Eigen::Array<float, patch_pixels, 1>;

// Brightness at a pixel of the depth image, linearly interpolated; nullopt outside the image.
std::optional<float> brightness(const RefinementView& view, const Eigen::Vector2d& pixel) {
  const Camera& depth = view.depth_camera;
  const Camera& color = view.color_camera;
  const double u = (pixel.x() - depth.cx) * color.fx / depth.fx + color.cx;
  const double v = (pixel.y() - depth.cy) * color.fy / depth.fy + color.cy;
  if (!(u >= 0.0 && v >= 0.0 && u < color.width - 1 && v < color.height - 1)) return std::nullopt;
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const auto at = [&](int column, int row) {
    const Color& rgb = view.color.at(column, row);
    return static_cast<float>(rgb[0] + 2 * rgb[1] + rgb[2]) / 4.0F;
  };
  const auto a = static_cast<float>(u - x);
  const auto b = static_cast<float>(v - y);
  return (1 - b) * ((1 - a) * at(x, y) + a * at(x + 1, y)) +
         b * ((1 - a) * at(x, y + 1) + a * at(x + 1, y + 1));
}

class ViewPair {
 public:
  ViewPair(const RefinementView& from, const RefinementView& onto, const Pose& onto_from,
           float gate)
      : from_(from),
        onto_(onto),
        onto_from_(onto_from),
        gate_(gate),
        patch_step_(std::max(1, from.depth_camera.width / 320)) {}

  ViewComparison run() const {
    const int width = from_.depth_camera.width;
    const int height = from_.depth_camera.height;
    const int step = std::max(
        1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / samples_per_view)));
    ViewComparison found;
    for (int y = step / 2; y < height; y += step)
      for (int x = step / 2; x < width; x += step) {
        found.points.push_back(point_at(index(x, y)));
        found.depth.push_back(depth_at(found.points.back()));
        found.color.push_back(std::abs(found.depth.back()) <= gate_ ? color_at(x, y) : unknown);
      }
    return found;
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(from_.depth_camera.width) +
           static_cast<std::size_t>(x);
  }
  Eigen::Vector3f point_at(std::size_t n) const {
    return Eigen::Vector3f(from_.rays->x[n], from_.rays->y[n], 1.0F) * from_.depth_m[n];
  }

  float depth_at(const Eigen::Vector3f& measured_point) const {
    if (!(measured_point.z() > 0.0F)) return unknown;
    const Eigen::Vector3d point = onto_from_ * measured_point.cast<double>();
    const Camera& camera = onto_.depth_camera;
    if (!(point.z() > 0.0)) return unknown;
    const auto pixel = project_point(camera, point);
    if (!pixel || !(pixel->x() > -0.5 && pixel->y() > -0.5 && pixel->x() < camera.width - 0.5 &&
                    pixel->y() < camera.height - 0.5))
      return unknown;
    const auto column = static_cast<std::size_t>(std::lround(pixel->x()));
    const auto row = static_cast<std::size_t>(std::lround(pixel->y()));
    const float measured = onto_.depth_m[row * static_cast<std::size_t>(camera.width) + column];
    if (!(measured > 0.0F)) return unknown;
    return static_cast<float>(static_cast<double>(measured) / point.z() - 1.0);
  }

  float color_at(int x, int y) const {
    const int reach = patch_radius * patch_step_;
    if (from_.color.empty() || onto_.color.empty() || x < reach || y < reach ||
        x + reach >= from_.depth_camera.width || y + reach >= from_.depth_camera.height)
      return unknown;
    const float middle = from_.depth_m[index(x, y)];
    Patch a;
    Patch b;
    Eigen::Index k = 0;
    for (int row = y - reach; row <= y + reach; row += patch_step_)
      for (int column = x - reach; column <= x + reach; column += patch_step_, ++k) {
        const std::size_t n = index(column, row);
        if (!(std::abs(from_.depth_m[n] - middle) < max_patch_relief * middle)) return unknown;
        const auto pixel =
            project_point(onto_.depth_camera, onto_from_ * point_at(n).cast<double>());
        if (!pixel) return unknown;
        const auto here = brightness(from_, Eigen::Vector2d(column, row));
        const auto there = brightness(onto_, *pixel);
        if (!here || !there) return unknown;
        a[k] = *here;
        b[k] = *there;
      }
    a -= a.mean();
    b -= b.mean();
    const float squares = std::sqrt(a.square().sum() * b.square().sum());
    constexpr float least = min_deviation * min_deviation * static_cast<float>(patch_pixels);
    if (a.square().sum() < least || !(squares > 0.0F)) return unknown;
    return 1.0F - (a * b).sum() / squares;
  }

  const RefinementView& from_;
  const RefinementView& onto_;
  Pose onto_from_;
  float gate_;
  int patch_step_;
};

}  // namespace

ViewComparison compare_views(const RefinementView& from, const RefinementView& onto,
                             const Pose& onto_from, float gate) {
  return ViewPair(from, onto, onto_from, gate).run();
}

}  // namespace libmap
