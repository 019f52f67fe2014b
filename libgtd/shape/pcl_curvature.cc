#include "libgtd/shape/pcl_curvature.h"

#include <pcl/features/normal_3d.h>
#include <pcl/features/principal_curvatures.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <cmath>

#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Points = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;
using Search = pcl::search::KdTree<pcl::PointXYZ>;

constexpr std::size_t grain = 256;

Points::Ptr to_pcl(const libmap::PointCloud& cloud) {
  Points::Ptr points(new Points);
  points->reserve(cloud.size());
  for (const Eigen::Vector3d& p : cloud.positions) {
    const Eigen::Vector3f at = p.cast<float>();
    points->emplace_back(at.x(), at.y(), at.z());
    if (!at.allFinite()) points->is_dense = false;
  }
  return points;
}

pcl::Normal normal_at(const Points& points, const pcl::Indices& neighbors,
                      const pcl::PointXYZ& at) {
  pcl::Normal normal;
  Eigen::Vector4f plane;
  float change = 0;
  if (!pcl::computePointNormal(points, neighbors, plane, change)) {
    normal.normal_x = normal.normal_y = normal.normal_z = Curvature::nan;
    return normal;
  }
  pcl::flipNormalTowardsViewpoint(at, 0.0F, 0.0F, 0.0F, plane);
  normal.normal_x = plane[0];
  normal.normal_y = plane[1];
  normal.normal_z = plane[2];
  return normal;
}

// PCL's estimator for one point adds up the normals of all neighbours: one without a normal would
// spoil the sum, as it does in PCL's own loop over a cloud.
Curvature curvature_at(pcl::PrincipalCurvaturesEstimation<pcl::PointXYZ, pcl::Normal>& estimator,
                       const Normals& normals, std::size_t point, const pcl::Indices& neighbors) {
  Curvature result;
  float x = 0, y = 0, z = 0, k1 = 0, k2 = 0;
  estimator.computePointPrincipalCurvatures(normals, static_cast<int>(point), neighbors, x, y, z,
                                            k1, k2);
  const pcl::Normal& n = normals[point];
  result.normal = Eigen::Vector3f(n.normal_x, n.normal_y, n.normal_z);
  result.valid = std::isfinite(k1) && std::isfinite(k2) && result.normal.allFinite();
  if (!result.valid) return {};
  result.k1 = k1;
  result.k2 = k2;
  return result;
}

}  // namespace

std::vector<Curvature> estimate_pcl_curvature(const libmap::PointCloud& cloud, double radius_m,
                                              const std::vector<std::size_t>& queries) {
  std::vector<Curvature> results(queries.size());
  const Points::Ptr points = to_pcl(cloud);
  if (queries.empty()) return results;
  Search search;
  search.setInputCloud(points);

  Normals normals;
  normals.resize(points->size());
  libmap::parallel_for(points->size(), grain, [&](std::size_t begin, std::size_t end) {
    pcl::Indices neighbors;
    std::vector<float> distances;
    for (std::size_t i = begin; i < end; ++i) {
      neighbors.clear();
      if (pcl::isFinite((*points)[i]))
        search.radiusSearch((*points)[i], radius_m, neighbors, distances);
      normals[i] = normal_at(*points, neighbors, (*points)[i]);
    }
  });

  libmap::parallel_for(queries.size(), grain, [&](std::size_t begin, std::size_t end) {
    pcl::PrincipalCurvaturesEstimation<pcl::PointXYZ, pcl::Normal> estimator;
    pcl::Indices neighbors;
    std::vector<float> distances;
    for (std::size_t q = begin; q < end; ++q) {
      const pcl::PointXYZ& at = (*points)[queries[q]];
      if (!pcl::isFinite(at) || search.radiusSearch(at, radius_m, neighbors, distances) == 0)
        continue;
      results[q] = curvature_at(estimator, normals, queries[q], neighbors);
    }
  });
  return results;
}

}  // namespace libgtd
