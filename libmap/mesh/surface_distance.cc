#include "libmap/mesh/surface_distance.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"

namespace libmap {

namespace {

Eigen::Vector3d nearest_on_segment(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b) {
  const double square = (b - a).squaredNorm();
  if (!(square > 0.0)) return a;
  return a + std::clamp((point - a).dot(b - a) / square, 0.0, 1.0) * (b - a);
}

// Nearest point on the sides of a triangle without area.
Eigen::Vector3d nearest_on_sides(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                 const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  Eigen::Vector3d nearest = nearest_on_segment(point, a, b);
  for (const Eigen::Vector3d& other :
       {nearest_on_segment(point, b, c), nearest_on_segment(point, c, a)})
    if ((other - point).squaredNorm() < (nearest - point).squaredNorm()) nearest = other;
  return nearest;
}

Eigen::Vector3d nearest_on(const EmbreeMesh& mesh, std::uint32_t triangle,
                           const Eigen::Vector3d& point) {
  return nearest_on_triangle(point, mesh.corner(triangle, 0), mesh.corner(triangle, 1),
                             mesh.corner(triangle, 2));
}

}  // namespace

SurfacePoint SurfaceDistance::nearest(const Eigen::Vector3d& point) const {
  struct Search {
    const EmbreeMesh& mesh;
    Eigen::Vector3d point;
    double slack;  // maximum error of Embree's single precision
    Eigen::Vector3d best;
    std::uint32_t triangle;
    double distance;
  };
  const Eigen::Vector3d local = point - mesh_.center();
  const double slack = 1e-6 * (mesh_.size().norm() + local.norm());
  Search search{mesh_, local, slack, nearest_on(mesh_, 0, local), 0, 0.0};
  search.distance = (search.best - local).norm();
  RTCPointQuery query{};
  query.x = static_cast<float>(local.x());
  query.y = static_cast<float>(local.y());
  query.z = static_cast<float>(local.z());
  query.radius = static_cast<float>(search.distance + search.slack);
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  const auto visit = [](RTCPointQueryFunctionArguments* arguments) {
    Search& found = *static_cast<Search*>(arguments->userPtr);
    const Eigen::Vector3d at = nearest_on(found.mesh, arguments->primID, found.point);
    const double distance = (at - found.point).norm();
    // Among equal distances the lowest triangle, independent of the tree.
    if (distance > found.distance ||
        (distance == found.distance && arguments->primID >= found.triangle))
      return false;
    found.best = at;
    found.triangle = arguments->primID;
    found.distance = distance;
    arguments->query->radius = static_cast<float>(distance + found.slack);
    return true;
  };
  rtcPointQuery(mesh_.scene(), &query, &context, visit, &search);
  return {search.best + mesh_.center(), search.triangle, search.distance};
}

Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                                    const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a;
  const Eigen::Vector3d ac = c - a;
  if (!(ab.cross(ac).squaredNorm() > 1e-24 * ab.squaredNorm() * ac.squaredNorm()))
    return nearest_on_sides(point, a, b, c);
  const Eigen::Vector3d ap = point - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  const Eigen::Vector3d bp = point - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return b;
  const Eigen::Vector3d cp = point - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return c;
  const double of_c = d1 * d4 - d3 * d2;
  if (of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return a + d1 / (d1 - d3) * ab;
  const double of_b = d5 * d2 - d1 * d6;
  if (of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return a + d2 / (d2 - d6) * ac;
  const double of_a = d3 * d6 - d5 * d4;
  const double along = d4 - d3;
  const double back = d5 - d6;
  if (of_a <= 0.0 && along >= 0.0 && back >= 0.0) return b + along / (along + back) * (c - b);
  const double scale = 1.0 / (of_a + of_b + of_c);
  return a + of_b * scale * ab + of_c * scale * ac;
}

std::vector<double> distances_to_surface(const std::vector<Eigen::Vector3d>& points,
                                         const TriangleMesh& mesh) {
  const SurfaceDistance surface(mesh);
  std::vector<double> distances(points.size());
  parallel_each(points.size(), 1024,
                [&](std::size_t n) { distances[n] = surface.nearest(points[n]).distance_m; });
  return distances;
}

DistanceStatistics distance_statistics(std::vector<double> distances_m) {
  DistanceStatistics statistics;
  statistics.count = distances_m.size();
  if (distances_m.empty()) return statistics;
  std::sort(distances_m.begin(), distances_m.end());
  double sum = 0.0;
  double squares = 0.0;
  for (const double distance : distances_m) {
    sum += distance;
    squares += distance * distance;
  }
  const std::size_t n = distances_m.size();
  statistics.mean_m = sum / static_cast<double>(n);
  statistics.rmse_m = std::sqrt(squares / static_cast<double>(n));
  statistics.median_m = 0.5 * (distances_m[(n - 1) / 2] + distances_m[n / 2]);
  statistics.p95_m =
      distances_m[static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(n))) - 1];
  statistics.max_m = distances_m.back();
  return statistics;
}

std::vector<TrianglePoint> sample_triangles(const TriangleMesh& mesh, double per_m2,
                                            std::uint64_t seed) {
  // A sample takes some hundred bytes in total, so the limit is proportional to the mesh's size.
  const double most = std::clamp(100.0 * static_cast<double>(mesh.triangles.size()), 2.5e6, 1e8);
  std::vector<double> area_before;
  double area = 0.0;
  for (const Triangle& triangle : mesh.triangles) {
    area_before.push_back(area);
    area += 0.5 * area_normal(mesh, triangle).norm();
  }
  if (!(area > 0.0) || !std::isfinite(area)) throw Error("has no area", {.field = "mesh"});
  const double wanted = std::ceil(per_m2 * area);
  if (!(wanted >= 0.0 && wanted <= most))
    throw Error("too many for the surface",
                {.field = "number of samples",
                 .value = to_text(wanted) + " (" + to_text(per_m2) + " per m2)",
                 .bound = "<= " + std::to_string(static_cast<std::size_t>(most)) + " for " +
                          std::to_string(mesh.triangles.size()) + " triangles"});
  const auto count = static_cast<std::size_t>(wanted);
  RandomStream random(seed, 0);
  std::vector<TrianglePoint> samples(count);
  for (std::size_t n = 0; n < count; ++n) {
    // One sample in each of `count` strata of equal area.
    const double at =
        (static_cast<double>(n) + random.uniform()) / static_cast<double>(count) * area;
    const auto above = std::upper_bound(area_before.begin(), area_before.end(), at);
    const double root = std::sqrt(random.uniform());
    const double fraction = random.uniform();
    samples[n] = {static_cast<std::uint32_t>(above - area_before.begin() - 1),
                  root * (1.0 - fraction), root * fraction};
  }
  return samples;
}

std::vector<SurfacePoint> sample_surface(const TriangleMesh& mesh, double per_m2,
                                         std::uint64_t seed) {
  const std::vector<TrianglePoint> triangle_points = sample_triangles(mesh, per_m2, seed);
  std::vector<SurfacePoint> samples(triangle_points.size());
  for (std::size_t n = 0; n < triangle_points.size(); ++n)
    samples[n] = {position_on(mesh, triangle_points[n]), triangle_points[n].triangle, 0.0};
  return samples;
}

std::vector<bool> covered(const std::vector<Eigen::Vector3d>& samples,
                          const std::vector<Eigen::Vector3d>& points, double radius_m) {
  std::vector<char> flags(samples.size(), 0);
  if (!points.empty()) {
    const PointTree tree(points);
    parallel_each(samples.size(), 1024, [&](std::size_t n) {
      flags[n] = tree.nearest(samples[n]).square_m2 <= radius_m * radius_m ? 1 : 0;
    });
  }
  return {flags.begin(), flags.end()};
}

double fraction_of(const std::vector<bool>& flags) {
  if (flags.empty()) return 0.0;
  return static_cast<double>(std::count(flags.begin(), flags.end(), true)) /
         static_cast<double>(flags.size());
}

void describe(ResultTable& table, const DistanceStatistics& statistics) {
  table.add("rmse_m", statistics.rmse_m, "root mean square distance, m");
  table.add("mean_m", statistics.mean_m, "mean distance, m");
  table.add("median_m", statistics.median_m, "median distance, m");
  table.add("p95_m", statistics.p95_m, "95th percentile of the distances, m");
  table.add("max_m", statistics.max_m, "maximum distance, m");
}

}  // namespace libmap
