#include "libmap/site/edge_check.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/site/xy_polygon.h"

namespace libmap {

void bind(ParameterTable& table, EdgeCheckOptions& options) {
  table.add_former_key("places", "positions_per_edge");
  table.add("positions_per_edge", options.positions_per_edge, {1.0, 10000.0},
            "number of height comparisons along each edge of the site");
  table.add("inset_m", options.inset_m, not_negative,
            "distance from the site's edge, inwards, at which heights are compared, m");
}

namespace {

// Convex hull, counter-clockwise, by Andrew's monotone chain (1979).
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
  });
  std::vector<Eigen::Vector2d> hull;
  for (int side = 0; side < 2; ++side) {
    const std::size_t first = hull.size();
    for (const Eigen::Vector2d& point : points) {
      while (hull.size() >= first + 2 &&
             cross(hull.back() - hull[hull.size() - 2], point - hull.back()) <= 0.0)
        hull.pop_back();
      hull.push_back(point);
    }
    // The last point is the first of the other side.
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

struct TurnedBox {
  double angle = 0.0;  // of its first axis relative to x, rad
  Eigen::Vector2d min = Eigen::Vector2d::Zero();
  Eigen::Vector2d max = Eigen::Vector2d::Zero();
  double area() const { return (max - min).prod(); }
};

TurnedBox box_at(const std::vector<Eigen::Vector2d>& points, double angle) {
  const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
  const Eigen::Vector2d v(-u.y(), u.x());
  TurnedBox box{angle, {u.dot(points[0]), v.dot(points[0])}, {u.dot(points[0]), v.dot(points[0])}};
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d rotated(u.dot(point), v.dot(point));
    box.min = box.min.cwiseMin(rotated);
    box.max = box.max.cwiseMax(rotated);
  }
  return box;
}

// One side of the smallest rectangle contains an edge of the hull (Freeman and Shapira 1975).
TurnedBox min_box(const std::vector<Eigen::Vector2d>& hull) {
  constexpr double quarter = std::numbers::pi / 2;
  TurnedBox best = box_at(hull, 0.0);
  for (std::size_t n = 0; n < hull.size(); ++n) {
    const Eigen::Vector2d side = hull[(n + 1) % hull.size()] - hull[n];
    const double angle = std::remainder(std::atan2(side.y(), side.x()), quarter);
    const TurnedBox box = box_at(hull, angle);
    if (box.area() < best.area() * (1.0 - 1e-9)) best = box;
  }
  return best;
}

SiteCorners corners_of(const TurnedBox& box) {
  const Eigen::Rotation2Dd turn(box.angle);
  const Eigen::Vector2d& a = box.min;
  const Eigen::Vector2d& b = box.max;
  if (!(box.area() > 0.0) || !std::isfinite(box.area()))
    throw Error("the site has no area",
                {.field = "width and depth",
                 .value = to_text(static_cast<float>(b.x() - a.x())) + " m, " +
                          to_text(static_cast<float>(b.y() - a.y())) + " m",
                 .bound = "> 0"});
  return {{turn * a, turn * Eigen::Vector2d(b.x(), a.y()), turn * b,
           turn * Eigen::Vector2d(a.x(), b.y())}};
}

}  // namespace

SiteCorners bounding_corners(const std::vector<Eigen::Vector3d>& points, bool turned) {
  if (points.empty()) throw no_elements("points");
  std::vector<Eigen::Vector2d> plan_points;
  plan_points.reserve(points.size());
  for (const Eigen::Vector3d& point : points) plan_points.emplace_back(point.head<2>());
  if (!turned) return corners_of(box_at(plan_points, 0.0));
  const std::vector<Eigen::Vector2d> hull = convex_hull(plan_points);
  return corners_of(min_box(hull.empty() ? plan_points : hull));
}

SiteCorners corners_of(const Eigen::Vector2d& min, const Eigen::Vector2d& max) {
  return corners_of(TurnedBox{0.0, min, max});
}

HeightFunction heights_of(const TriangleMesh& mesh, double from_z) {
  const auto caster = std::make_shared<const RayCaster>(mesh);
  const double top = std::min(from_z, bounds_of(mesh.vertices).max.z() + 1.0);
  return [caster, top](const Eigen::Vector2d& position) -> std::optional<double> {
    const auto hit =
        caster->cast({position.x(), position.y(), top}, Eigen::Vector3d(0.0, 0.0, -1.0));
    if (!hit) return std::nullopt;
    return top - hit->distance;
  };
}

HeightFunction heights_of(const std::vector<Eigen::Vector3d>& points, double radius_m,
                          int min_points) {
  struct Columns {
    std::vector<Eigen::Vector3d> feet;  // z = 0
    std::vector<double> heights;
    std::optional<PointTree> tree{};
  };
  const auto columns = std::make_shared<Columns>();
  columns->feet.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    columns->feet.emplace_back(point.x(), point.y(), 0.0);
    columns->heights.push_back(point.z());
  }
  columns->tree.emplace(columns->feet);
  return [columns, radius_m, min_points](const Eigen::Vector2d& position) -> std::optional<double> {
    std::vector<double> heights;
    for (const NeighborPoint& neighbor :
         columns->tree->within({position.x(), position.y(), 0.0}, radius_m))
      heights.push_back(columns->heights[neighbor.index]);
    if (heights.empty() || heights.size() < static_cast<std::size_t>(std::max(min_points, 0)))
      return std::nullopt;
    std::sort(heights.begin(), heights.end());
    return 0.5 * (heights[(heights.size() - 1) / 2] + heights[heights.size() / 2]);
  };
}

namespace {

void check(const EdgeCheckOptions& options, const SiteCorners& site) {
  check_parameters(options);
  const double least = std::min((site.corners[1] - site.corners[0]).norm(),
                                (site.corners[2] - site.corners[1]).norm());
  if (!(2.0 * options.inset_m < least))
    throw Error(
        "the positions would not be inside the site",
        {.field = "inset_m",
         .value = to_text(options.inset_m),
         .bound = "< " + to_text(static_cast<float>(least / 2)) + " (half the shorter side)"});
}

void summarize(EdgeCheckResult& result) {
  double sum = 0.0;
  for (std::size_t e = 0; e < result.edges.size(); ++e) {
    double of_edge = 0.0;
    std::size_t count = 0;
    for (const EdgeCheckPoint& point : result.edges[e]) {
      const auto error = point.error_m();
      if (!error) {
        ++result.missing;
        continue;
      }
      ++count;
      of_edge += std::abs(*error);
      result.mean_error_m += *error;
      result.max_abs_error_m = std::max(result.max_abs_error_m, std::abs(*error));
    }
    if (count > 0) result.mean_m[e] = of_edge / static_cast<double>(count);
    sum += of_edge;
    result.measured += count;
  }
  if (result.measured == 0)
    throw Error("none along the site's edges has both data and ground", {.field = "positions"});
  result.mean_abs_error_m = sum / static_cast<double>(result.measured);
  result.mean_error_m /= static_cast<double>(result.measured);
}

}  // namespace

EdgeCheckResult check_edges(const SiteCorners& site, const HeightFunction& surface,
                            const HeightFunction& ground, const EdgeCheckOptions& options) {
  check(options, site);
  EdgeCheckResult result;
  for (std::size_t e = 0; e < 4; ++e) {
    const Eigen::Vector2d& from = site.corners[e];
    const Eigen::Vector2d along = site.corners[(e + 1) % 4] - from;
    const Eigen::Vector2d inwards = Eigen::Vector2d(-along.y(), along.x()).normalized();
    for (int n = 0; n < options.positions_per_edge; ++n) {
      const double fraction = (n + 0.5) / options.positions_per_edge;
      EdgeCheckPoint& point = result.edges[e].emplace_back();
      point.position = from + fraction * along + options.inset_m * inwards;
      point.height_m = surface(point.position);
      point.ground_m = ground(point.position);
    }
  }
  summarize(result);
  return result;
}

}  // namespace libmap
