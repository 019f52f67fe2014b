#include "libmap/simulate/site_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/simulate/rock_shape.h"
#include "libmap/simulate/rock_texture.h"
#include "libmap/simulate/scene_geometry.h"
#include "libmap/simulate/solid.h"
#include "libmap/simulate/solid_noise.h"

namespace libmap {

namespace {

constexpr double base_depth_m = 0.2;  // of rocks below the lowest ground beneath them

constexpr double splinter_share = 0.004;  // of the edge length: shorter edges are collapsed

double edge_length_of(const SiteRock& rock, double edge_length_m) {
  return std::min(edge_length_m,
                  0.1 * std::min({rock.width_m, rock.depth_m, rock.height_m}) + 0.002);
}

void check(const RockSite& site, const SiteMeshOptions& options) {
  site.check();
  double triangles = 2.0 * site.ground.size_x_m * site.ground.size_y_m /
                     (options.edge_length_m * options.edge_length_m);
  for (const SiteRock& rock : site.rocks) {
    const double edge = edge_length_of(rock, options.edge_length_m);
    const double around = 2.0 * (rock.width_m + rock.depth_m);
    triangles += (rock.width_m * rock.depth_m + around * (rock.height_m + base_depth_m)) /
                 (0.43 * edge * edge);
  }
  require_count(triangles, options.max_triangles, "triangles", "edge_length_m",
                to_text(options.edge_length_m));
}

Solid ground_solid(const RockSite& site, const GroundRelief& relief, double edge_length_m) {
  HeightGrid grid;
  grid.size_x_m = site.ground.size_x_m;
  grid.size_y_m = site.ground.size_y_m;
  grid.columns = 1 + static_cast<std::size_t>(std::ceil(grid.size_x_m / edge_length_m - 1e-9));
  grid.rows = 1 + static_cast<std::size_t>(std::ceil(grid.size_y_m / edge_length_m - 1e-9));
  grid.heights_m.resize(grid.columns * grid.rows);
  parallel_for(grid.rows, 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (std::size_t column = 0; column < grid.columns; ++column) {
        const Eigen::Vector2d at = grid.at(column, row);
        grid.heights_m[row * grid.columns + column] = relief.height(at.x(), at.y());
      }
    }
  });
  const double lowest = *std::min_element(grid.heights_m.begin(), grid.heights_m.end());
  // Below every rock, so that none reaches through the base.
  double reach = 0.0;
  for (const SiteRock& rock : site.rocks) reach = std::max(reach, rock.height_m);
  return block_solid(grid, lowest - 2.0 * base_depth_m - reach);
}

// The rock on the ground, in the ground's frame, its triangles labeled with its number.
Solid placed_rock(const SiteRock& rock, int number, const GroundRelief& relief,
                  double edge_length_m) {
  const double foot = relief.height(rock.x_m, rock.y_m);
  const double radius = 0.5 * std::hypot(rock.width_m, rock.depth_m);
  double lowest = foot;
  for (int n = 0; n < 24; ++n) {
    const double heading = 2.0 * M_PI * n / 24;
    lowest = std::min(lowest, relief.height(rock.x_m + radius * std::cos(heading),
                                            rock.y_m + radius * std::sin(heading)));
  }
  Solid solid = rock_solid(rock, edge_length_of(rock, edge_length_m),
                           foot - lowest + std::min(base_depth_m, 0.5 * rock.height_m));
  const Pose ground_from_rock =
      make_pose_from_rpy({rock.x_m, rock.y_m, foot}, {0.0, 0.0, rock.yaw_deg});
  for (Eigen::Vector3d& vertex : solid.vertices) vertex = ground_from_rock * vertex;
  std::fill(solid.labels.begin(), solid.labels.end(), number);
  return solid;
}

// The triangles that `keep` names and the vertices that they use.
template <typename Keep>
Solid select(const Solid& solid, const Keep& keep) {
  Solid kept;
  kept.vertices = solid.vertices;
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    if (!keep(n)) continue;
    kept.triangles.push_back(solid.triangles[n]);
    kept.labels.push_back(solid.labels[n]);
  }
  drop_unused_vertices(kept.vertices, kept.triangles);
  return kept;
}

// The part that holds the ground's base. Hollows without a way out are dropped; a part that bears
// a rock's outside is a rock in the air.
Solid part_of_ground(const Solid& solid, const RockSite& site) {
  TriangleMesh mesh;
  mesh.vertices = solid.vertices;
  mesh.triangles = solid.triangles;
  const MeshComponents components = connected_components(mesh);
  const std::vector<std::uint32_t>& parts = components.of_triangle;
  const std::size_t count = components.areas_m2.size();
  if (count == 1) return solid;
  std::vector<double> volumes(count, 0.0);
  std::vector<int> labels(count, 0);
  std::size_t ground = 0;
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    const Triangle& t = solid.triangles[n];
    volumes[parts[n]] += solid.vertices[t[0]].dot(solid.vertices[t[1]].cross(solid.vertices[t[2]]));
    labels[parts[n]] = solid.labels[n];
    if (solid.labels[n] < 0) ground = parts[n];
  }
  for (std::size_t part = 0; part < count; ++part) {
    if (part == ground || volumes[part] < 0.0) continue;
    const SiteRock& rock = site.rocks[static_cast<std::size_t>(labels[part]) - 1];
    const std::string name = rock.name.empty() ? "" : " (" + rock.name + ")";
    throw Error("does not touch the ground",
                {.field = "rocks[" + std::to_string(labels[part] - 1) + "]" + name});
  }
  return select(solid, [&](std::size_t n) { return parts[n] == ground; });
}

Color color_of(const RockSite& site, int label, const Eigen::Vector3d& point) {
  if (label > 0) {
    const SiteRock& rock = site.rocks[static_cast<std::size_t>(label) - 1];
    const std::uint64_t seed = mix_bits(rock.seed, 30);
    return is_hold(rock.shape) ? hold_color(point, seed) : rock_color(point, seed);
  }
  const std::uint64_t seed = mix_bits(site.seed, 4);
  if (site.ground.texture == GroundTexture::panel) return panel_color(point, seed);
  if (site.ground.texture == GroundTexture::rock) return rock_color(point, seed);
  return soil_color(point, seed);
}

TriangleMesh painted(const Solid& solid, const RockSite& site) {
  TriangleMesh mesh;
  std::vector<int> vertex_labels(solid.vertices.size(), 0);
  std::vector<double> rocks(solid.triangles.size());
  for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
    rocks[n] = std::max(0, solid.labels[n]);
    for (const std::uint32_t vertex : solid.triangles[n])
      vertex_labels[vertex] = std::max(vertex_labels[vertex], solid.labels[n]);
  }
  const Pose site_from_ground = site.site_from_ground();
  mesh.vertices.resize(solid.vertices.size());
  mesh.vertex_colors.resize(solid.vertices.size());
  parallel_for(solid.vertices.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      mesh.vertex_colors[n] = color_of(site, vertex_labels[n], solid.vertices[n]);
      mesh.vertices[n] = site_from_ground * solid.vertices[n];
    }
  });
  mesh.triangles = solid.triangles;
  mesh.face_fields.push_back({"rock", ScalarType::int32, std::move(rocks)});
  return mesh;
}

}  // namespace

TriangleMesh site_mesh(const RockSite& site, const SiteMeshOptions& options) {
  check(site, options);
  const GroundRelief relief(site);
  std::vector<Solid> solids(site.rocks.size() + 1);
  parallel_for(solids.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      solids[n] = n == 0 ? ground_solid(site, relief, options.edge_length_m)
                         : placed_rock(site.rocks[n - 1], static_cast<int>(n), relief,
                                       options.edge_length_m);
  });
  Solid solid = part_of_ground(unite(solids, splinter_share * options.edge_length_m), site);
  if (!options.closed) solid = select(solid, [&](std::size_t n) { return solid.labels[n] >= 0; });
  return painted(solid, site);
}

}  // namespace libmap
