#include "libmap/site/xy_polygon.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

using Eigen::Vector2d;

constexpr double on_border_m = 1e-9;
constexpr std::size_t max_strips = 1024;

double distance_to_segment(const Vector2d& point, const Vector2d& a, const Vector2d& b) {
  const Vector2d along = b - a;
  const double t = std::clamp((point - a).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (point - a - t * along).norm();
}

// Returns 1 if the point is left of the line from a to b, -1 if right, 0 if on it within rounding.
int side_of(const Vector2d& a, const Vector2d& b, const Vector2d& point) {
  const double turn = cross(b - a, point - a);
  const double exact = 1e-14 * (b - a).norm() * (point - a).norm();
  return turn > exact ? 1 : turn < -exact ? -1 : 0;
}

bool in_box_of(const Vector2d& a, const Vector2d& b, const Vector2d& point) {
  return (point.array() >= a.cwiseMin(b).array()).all() &&
         (point.array() <= a.cwiseMax(b).array()).all();
}

bool segments_meet(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const int c_side = side_of(a, b, c);
  const int d_side = side_of(a, b, d);
  const int a_side = side_of(c, d, a);
  const int b_side = side_of(c, d, b);
  if (c_side * d_side < 0 && a_side * b_side < 0) return true;
  return (c_side == 0 && in_box_of(a, b, c)) || (d_side == 0 && in_box_of(a, b, d)) ||
         (a_side == 0 && in_box_of(c, d, a)) || (b_side == 0 && in_box_of(c, d, b));
}

std::string text_of(const Vector2d& point) {
  return "(" + to_text(point.x()) + ", " + to_text(point.y()) + ")";
}

std::string corner_name(std::size_t n) { return "corner " + std::to_string(n + 1); }

}  // namespace

XyPolygon::XyPolygon(std::vector<Vector2d> corners) : corners_(std::move(corners)) {
  for (std::size_t n = 0; n < corners_.size(); ++n)
    if (!corners_[n].allFinite())
      throw Error("not finite", {.field = corner_name(n), .value = text_of(corners_[n])});
  if (corners_.size() > 3 && corners_.front() == corners_.back()) corners_.pop_back();
  if (corners_.size() < 3)
    throw Error("the outline has too few corners",
                {.field = "corners", .value = std::to_string(corners_.size()), .bound = ">= 3"});
  min_ = max_ = corners_.front();
  double twice = 0.0;
  for (std::size_t n = 0; n < corners_.size(); ++n) {
    const Vector2d& next = corners_[(n + 1) % corners_.size()];
    if ((next - corners_[n]).norm() <= on_border_m)
      throw Error("the corner occurs twice in the outline",
                  {.field = corner_name(n), .value = text_of(corners_[n])});
    twice += cross(corners_[n] - corners_.front(), next - corners_.front());
    min_ = min_.cwiseMin(corners_[n]);
    max_ = max_.cwiseMax(corners_[n]);
  }
  if (twice < 0.0) std::reverse(corners_.begin() + 1, corners_.end());
  area_m2_ = std::abs(twice) / 2.0;
  make_strips();
  require_simple();
  if (!(area_m2_ > on_border_m * (max_ - min_).norm())) throw Error("the outline encloses no area");
}

std::size_t XyPolygon::strip_of(double y) const {
  const double height = max_.y() - min_.y();
  const double fraction = height > 0.0 ? (y - min_.y()) / height : 0.0;
  const auto count = static_cast<double>(strips_.size());
  return static_cast<std::size_t>(std::clamp(std::floor(fraction * count), 0.0, count - 1.0));
}

void XyPolygon::make_strips() {
  strips_.resize(std::min(corners_.size(), max_strips));
  for (std::uint32_t n = 0; n < corners_.size(); ++n) {
    const double a = corners_[n].y();
    const double b = corners_[(n + 1) % corners_.size()].y();
    const std::size_t last = strip_of(std::max(a, b) + on_border_m);
    for (std::size_t s = strip_of(std::min(a, b) - on_border_m); s <= last; ++s)
      strips_[s].push_back(n);
  }
}

void XyPolygon::require_simple() const {
  const auto count = static_cast<std::uint32_t>(corners_.size());
  const auto end = [&](std::uint32_t n) -> const Vector2d& { return corners_[(n + 1) % count]; };
  const auto crossing = [&](std::uint32_t a, std::uint32_t b) {
    return Error(
        "the outline crosses or touches itself",
        {.field = "edge from " + text_of(corners_[a]) + " to " + text_of(end(a)),
         .value = "meeting the edge from " + text_of(corners_[b]) + " to " + text_of(end(b))});
  };
  for (const std::vector<std::uint32_t>& strip : strips_)
    for (std::size_t i = 0; i < strip.size(); ++i)
      for (std::size_t j = i + 1; j < strip.size(); ++j) {
        std::uint32_t a = strip[i];
        std::uint32_t b = strip[j];
        if ((b + 1) % count == a) std::swap(a, b);
        if ((a + 1) % count == b) {
          // Neighbors share a corner; one may not turn back onto the other.
          if (side_of(corners_[a], end(a), end(b)) == 0 &&
              (end(a) - corners_[a]).dot(end(b) - corners_[b]) < 0.0)
            throw crossing(a, b);
        } else if (segments_meet(corners_[a], end(a), corners_[b], end(b))) {
          throw crossing(a, b);
        }
      }
}

bool XyPolygon::contains(const Vector2d& point) const {
  if ((point.array() < min_.array() - on_border_m).any() ||
      (point.array() > max_.array() + on_border_m).any())
    return false;
  bool inside = false;
  for (const std::uint32_t n : strips_[strip_of(point.y())]) {
    const Vector2d& a = corners_[n];
    const Vector2d& b = corners_[(n + 1) % corners_.size()];
    if (distance_to_segment(point, a, b) <= on_border_m) return true;
    // An edge includes its lower end and excludes its upper end.
    if ((a.y() > point.y()) == (b.y() > point.y())) continue;
    const bool left = cross(b - a, point - a) > 0.0;
    if (left == (b.y() > a.y())) inside = !inside;
  }
  return inside;
}

std::vector<std::uint32_t> XyPolygon::edges_near(const Vector2d& box_min,
                                                 const Vector2d& box_max) const {
  std::vector<std::uint32_t> edges;
  if ((box_max.array() < min_.array()).any() || (box_min.array() > max_.array()).any())
    return edges;
  const Vector2d center = (box_min + box_max) / 2.0;
  const Vector2d half = (box_max - box_min) / 2.0;
  const std::size_t last = strip_of(box_max.y());
  for (std::size_t s = strip_of(box_min.y()); s <= last; ++s)
    for (const std::uint32_t n : strips_[s]) {
      const Vector2d& a = corners_[n];
      const Vector2d& b = corners_[(n + 1) % corners_.size()];
      if ((a.cwiseMax(b).array() < box_min.array()).any() ||
          (a.cwiseMin(b).array() > box_max.array()).any())
        continue;
      // Skips edges whose line does not intersect the box.
      const Vector2d normal(a.y() - b.y(), b.x() - a.x());
      if (std::abs(normal.dot(center - a)) > normal.cwiseAbs().dot(half) * (1.0 + 1e-9)) continue;
      edges.push_back(n);
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

XyPolygon make_rectangle(const Vector2d& min, const Vector2d& max) {
  return XyPolygon({min, {max.x(), min.y()}, max, {min.x(), max.y()}});
}

PointCloud clip_cloud(const PointCloud& cloud, const ExtrudedPolygon& prism) {
  std::vector<char> inside(cloud.size());
  parallel_each(cloud.size(), 8192,
                [&](std::size_t n) { inside[n] = prism.contains(cloud.positions[n]) ? 1 : 0; });
  std::vector<std::size_t> indices;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (inside[n] != 0) indices.push_back(n);
  return select_points(cloud, indices);
}

}  // namespace libmap
