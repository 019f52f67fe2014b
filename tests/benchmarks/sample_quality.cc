// sample_quality MESH CLOUD [DARTS]: how evenly a program's samples lie on a surface, as JSON.
// Written apart from the sampler, so that it evaluates any program alike.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/surface_distance.h"

namespace {

void evaluate(const std::string& mesh_path, const std::string& cloud_path, double darts) {
  const libmap::TriangleMesh mesh = libmap::read_mesh(mesh_path).mesh;
  const libmap::PointCloud cloud = libmap::read_cloud(cloud_path).cloud;
  if (cloud.size() < 2) throw libmap::Error("fewer than two points", {.file = cloud_path});
  const double area = libmap::surface_area(mesh);
  const libmap::PointTree tree(cloud.positions);
  double smallest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& point : cloud.positions)
    smallest = std::min(smallest, tree.nearest(point, 2)[1].square_m2);
  double largest = 0.0;
  for (const libmap::SurfacePoint& dart : libmap::sample_surface(mesh, darts / area, 1))
    largest = std::max(largest, tree.nearest(dart.position).square_m2);
  const auto count = static_cast<double>(cloud.size());
  smallest = std::sqrt(smallest);
  std::cout << nlohmann::ordered_json(
                   {{"points", cloud.size()},
                    {"smallest_distance_m", smallest},
                    {"relative_radius",
                     smallest / (2.0 * std::sqrt(area / (2.0 * std::sqrt(3.0) * count)))},
                    {"largest_hole_m", std::sqrt(largest)}})
                   .dump()
            << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: sample_quality MESH CLOUD [DARTS]\n";
    return 2;
  }
  try {
    evaluate(argv[1], argv[2], argc > 3 ? libmap::parse_double(argv[3]).value_or(1e6) : 1e6);
  } catch (const std::exception& error) {
    std::cerr << "sample_quality: error: " << error.what() << "\n";
    return 1;
  }
}
