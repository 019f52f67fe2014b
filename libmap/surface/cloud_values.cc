#include "libmap/surface/cloud_values.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "libmap/core/parallel.h"

namespace libmap {

namespace {

constexpr std::size_t neighbor_count = 4;

bool is_whole(ScalarType type) {
  return type != ScalarType::float32 && type != ScalarType::float64;
}

}  // namespace

void carry_values(const PointCloud& cloud, const PointTree& tree, double radius_m,
                  TriangleMesh& mesh) {
  const std::size_t count = mesh.vertices.size();
  mesh.vertex_colors.assign(cloud.has_colors() ? count : 0, Color{});
  mesh.vertex_fields.clear();
  for (const ScalarField& field : cloud.fields)
    mesh.vertex_fields.push_back({field.name, field.type, std::vector<double>(count, 0.0)});
  if (cloud.empty() || (!cloud.has_colors() && cloud.fields.empty())) return;
  parallel_for(count, 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      const auto neighbors = tree.nearest(mesh.vertices[v], neighbor_count);
      const auto weight = [&](const NeighborPoint& point) {
        return 1.0 / (point.square_m2 + radius_m * radius_m);
      };
      if (cloud.has_colors()) {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        double weights = 0.0;
        for (const NeighborPoint& point : neighbors) {
          const Color& color = cloud.colors[point.index];
          sum += weight(point) * Eigen::Vector3d(color[0], color[1], color[2]);
          weights += weight(point);
        }
        for (std::size_t c = 0; c < 3; ++c)
          mesh.vertex_colors[v][c] = static_cast<std::uint8_t>(
              std::lround(std::clamp(sum[static_cast<Eigen::Index>(c)] / weights, 0.0, 255.0)));
      }
      for (std::size_t f = 0; f < cloud.fields.size(); ++f) {
        const ScalarField& field = cloud.fields[f];
        double& value = mesh.vertex_fields[f].values[v];
        value = field.values[neighbors.front().index];
        if (is_whole(field.type)) continue;
        double sum = 0.0;
        double weights = 0.0;
        for (const NeighborPoint& point : neighbors) {
          if (std::isnan(field.values[point.index])) continue;
          sum += weight(point) * field.values[point.index];
          weights += weight(point);
        }
        if (weights > 0.0) value = sum / weights;
      }
    }
  });
}

}  // namespace libmap
