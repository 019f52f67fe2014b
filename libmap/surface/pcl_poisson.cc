#include <fcntl.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/surface/poisson.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <mutex>

#include "libmap/core/error.h"
#include "libmap/surface/surface_solvers.h"

namespace libmap {

namespace {

// Redirects standard output and error, because PCL prints a line for each face that it drops.
class StdoutRedirect {
 public:
  StdoutRedirect() {
    flush();
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    for (std::size_t n = 0; n < kept_.size(); ++n) {
      const int stream = static_cast<int>(n) + 1;
      kept_[n] = nowhere < 0 ? -1 : fcntl(stream, F_DUPFD_CLOEXEC, 3);
      if (kept_[n] >= 0) dup2(nowhere, stream);
    }
    if (nowhere >= 0) close(nowhere);
  }
  ~StdoutRedirect() {
    flush();
    for (std::size_t n = 0; n < kept_.size(); ++n) {
      if (kept_[n] < 0) continue;
      dup2(kept_[n], static_cast<int>(n) + 1);
      close(kept_[n]);
    }
  }
  StdoutRedirect(const StdoutRedirect&) = delete;
  StdoutRedirect& operator=(const StdoutRedirect&) = delete;

 private:
  static void flush() {
    std::cout.flush();
    std::fflush(stdout);
    std::fflush(stderr);
  }
  std::array<int, 2> kept_{};
};

pcl::PointCloud<pcl::PointNormal>::Ptr to_pcl(const std::vector<SurfaceSample>& samples) {
  pcl::PointCloud<pcl::PointNormal>::Ptr cloud(new pcl::PointCloud<pcl::PointNormal>);
  cloud->reserve(samples.size());
  for (const SurfaceSample& sample : samples) {
    pcl::PointNormal point;
    point.getVector3fMap() = sample.position;
    // The length of the normal is the confidence.
    point.getNormalVector3fMap() = sample.weight * sample.normal;
    cloud->push_back(point);
  }
  return cloud;
}

float extent_of(const std::vector<SurfaceSample>& samples) {
  Eigen::Array3f low = samples.front().position;
  Eigen::Array3f high = low;
  for (const SurfaceSample& sample : samples) {
    low = low.min(sample.position.array());
    high = high.max(sample.position.array());
  }
  return (high - low).maxCoeff();
}

}  // namespace

TriangleMesh solve_poisson(const std::vector<SurfaceSample>& samples,
                           const PoissonProblem& problem) {
  // PCL's octrees share one allocator.
  static std::mutex in_use;
  const std::lock_guard lock(in_use);
  pcl::PointCloud<pcl::PointNormal> points;
  std::vector<pcl::Vertices> polygons;
  try {
    const StdoutRedirect silence;
    pcl::Poisson<pcl::PointNormal> poisson;
    poisson.setInputCloud(to_pcl(samples));
    poisson.setThreads(1);
    poisson.setDepth(problem.depth);
    poisson.setMinDepth(std::min(5, problem.depth));
    poisson.setScale(static_cast<float>(problem.cube_m) / extent_of(samples));
    poisson.setPointWeight(static_cast<float>(problem.screening));
    poisson.setSamplesPerNode(static_cast<float>(problem.samples_per_cell));
    poisson.setConfidence(true);
    poisson.setManifold(true);
    poisson.performReconstruction(points, polygons);
  } catch (const std::exception& error) {
    throw Error(std::string("Poisson reconstruction failed: ") + error.what(), {},
                ErrorKind::failed);
  }
  TriangleMesh mesh;
  mesh.vertices.reserve(points.size());
  for (const pcl::PointNormal& point : points)
    mesh.vertices.push_back(point.getVector3fMap().cast<double>());
  mesh.triangles.reserve(polygons.size());
  for (const pcl::Vertices& polygon : polygons)
    mesh.triangles.push_back({static_cast<std::uint32_t>(polygon.vertices.at(0)),
                              static_cast<std::uint32_t>(polygon.vertices.at(1)),
                              static_cast<std::uint32_t>(polygon.vertices.at(2))});
  return mesh;
}

}  // namespace libmap
