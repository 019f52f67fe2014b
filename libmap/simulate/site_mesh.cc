#include "libmap/simulate/site_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "libmap/core/angle.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/scenes/scene_geometry.h"
#include "libmap/scenes/solid.h"
#include "libmap/scenes/solid_noise.h"
#include "libmap/simulate/rock_texture.h"

namespace libmap {

namespace {

using std::numbers::pi;

HalfSpace through(const Eigen::Vector3d& normal, const Eigen::Vector3d& point) {
  const Eigen::Vector3d unit = normal.normalized();
  return {unit, unit.dot(point)};
}

// Unit vector with azimuth `heading` and elevation `rise` (radians).
Eigen::Vector3d direction(double heading, double rise) {
  return {std::cos(heading) * std::cos(rise), std::sin(heading) * std::cos(rise), std::sin(rise)};
}

struct BlockSize {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  Eigen::Vector2d half = Eigen::Vector2d::Zero();
  double top_m = 0.0;
  double bottom_m = 0.0;
};

// Distance of a wall from the center at azimuth `heading`: between an ellipse and a rectangle.
double wall_distance(const Eigen::Vector2d& half, double heading) {
  const double x = half.x() * std::cos(heading);
  const double y = half.y() * std::sin(heading);
  return 0.65 * std::hypot(x, y) + 0.35 * (std::abs(x) + std::abs(y));
}

// Walls, slanted shoulders, a flat top and a base.
std::vector<HalfSpace> block_half_spaces(const BlockSize& size, const SiteRock& rock,
                                         RandomStream& draw) {
  std::vector<HalfSpace> planes;
  const Eigen::Vector3d center(size.center.x(), size.center.y(), 0.0);
  const double first = draw.uniform(0.0, 2.0 * pi);
  const int overhanging = rock.overhang_deg > 0.0 ? std::max(1, rock.sides / 3) : 0;
  for (int n = 0; n < rock.sides; ++n) {
    const double heading = first + 2.0 * pi * (n + draw.uniform(-0.28, 0.28)) / rock.sides;
    const bool leans_out = n < overhanging;
    const double rise = leans_out
                            ? -rock.overhang_deg * radians_per_degree * draw.uniform(0.75, 1.0)
                            : radians_per_degree * draw.uniform(1.0, 13.0);
    const double distance = wall_distance(size.half, heading) * draw.uniform(0.86, 1.0);
    const double level = leans_out ? draw.uniform(0.55, 0.75) * size.top_m : 0.0;
    planes.push_back(through(direction(heading, rise), center + distance * direction(heading, 0.0) +
                                                           Eigen::Vector3d(0.0, 0.0, level)));
  }
  // Shoulders are cut from the rim of the top.
  const int shoulders = 2 + static_cast<int>(draw.uniform(0.0, 3.0));
  for (int n = 0; n < shoulders; ++n) {
    const double heading = draw.uniform(0.0, 2.0 * pi);
    const double distance = wall_distance(size.half, heading) * draw.uniform(0.55, 0.85);
    planes.push_back(through(
        direction(heading, radians_per_degree * draw.uniform(25.0, 60.0)),
        center + distance * direction(heading, 0.0) + Eigen::Vector3d(0.0, 0.0, size.top_m)));
  }
  const double slope = radians_per_degree * draw.uniform(0.5, 4.0);
  planes.push_back(through(direction(draw.uniform(0.0, 2.0 * pi), 0.5 * pi - slope),
                           center + Eigen::Vector3d(0.0, 0.0, size.top_m)));
  planes.push_back({-Eigen::Vector3d::UnitZ(), -size.bottom_m});
  return planes;
}

// Adds a half-space for most sharp edges that chips the edge off.
void chip_edges(std::vector<HalfSpace>& planes, double chip_m, double bound_m, RandomStream& draw) {
  const Solid solid = convex_solid(planes, bound_m);
  std::map<std::pair<int, int>, Eigen::Vector3d> middles;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> label_of;
  for (std::size_t n = 0; n < solid.triangles.size(); ++n)
    for (std::size_t k = 0; k < 3; ++k)
      label_of[{solid.triangles[n][k], solid.triangles[n][(k + 1) % 3]}] = solid.labels[n];
  for (const auto& [edge, label] : label_of) {
    const int across = label_of.at({edge.second, edge.first});
    if (label < across)
      middles[{label, across}] = 0.5 * (solid.vertices[edge.first] + solid.vertices[edge.second]);
  }
  for (const auto& [labels, middle] : middles) {
    const Eigen::Vector3d& a = planes[static_cast<std::size_t>(labels.first)].normal;
    const Eigen::Vector3d& b = planes[static_cast<std::size_t>(labels.second)].normal;
    const double depth = chip_m * draw.uniform(0.25, 1.0);
    const Eigen::Vector3d tilt{draw.uniform(-0.2, 0.2), draw.uniform(-0.2, 0.2),
                               draw.uniform(-0.2, 0.2)};  // braces: drawn in this order
    if (a.dot(b) > 0.85 || draw.uniform() >= 0.85) continue;
    const HalfSpace chip = through(a + b + tilt, middle);
    planes.push_back({chip.normal, chip.offset_m - depth});
  }
}

// A wedge whose sharp edge runs into the rock at cleft_m below the top.
std::vector<HalfSpace> cleft_half_spaces(const SiteRock& rock, RandomStream& draw) {
  const double heading = draw.uniform(0.0, 2.0 * pi);
  const double opening =
      radians_per_degree * draw.uniform(9.0, 16.0);  // between each flank and the vertical
  const double lean = radians_per_degree * draw.uniform(-12.0, 12.0);
  const Eigen::Vector3d along = direction(heading, radians_per_degree * draw.uniform(5.0, 25.0));
  const Eigen::Vector3d across(-std::sin(heading), std::cos(heading), 0.0);
  const Eigen::Vector3d up = along.cross(across);
  const double reach = std::min(rock.width_m, rock.depth_m);
  const Eigen::Vector3d apex = draw.uniform(-0.15, 0.15) * reach * across +
                               Eigen::Vector3d(0.0, 0.0, rock.height_m - rock.cleft_m);
  const auto flank = [&](double side) {
    const double angle = opening + side * lean;
    return through(side * std::cos(angle) * across - std::sin(angle) * up, apex);
  };
  // The wedge is open on one side of the rock and ends inside it, or passes through.
  const double end = draw.uniform(0.1, 0.6) * reach;
  return {flank(1.0), flank(-1.0), through(-along, -end * along),
          through(along, 3.0 * (rock.width_m + rock.depth_m) * along),
          through(up, apex + (rock.height_m + 0.3) * up)};
}

Solid with_labels_from(Solid solid, int first) {
  for (int& label : solid.labels) label += first;
  return solid;
}

// Bounding box of the part above the ground.
Eigen::AlignedBox3d box_above_ground(const Solid& solid) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : solid.vertices)
    if (vertex.z() >= 0.0) box.extend(vertex);
  return box;
}

// Shifts and scales the solid to the rock's size.
void fit(Solid& solid, const SiteRock& rock) {
  double top = 0.0;
  for (const Eigen::Vector3d& vertex : solid.vertices) top = std::max(top, vertex.z());
  for (Eigen::Vector3d& vertex : solid.vertices) vertex.z() += rock.height_m - top;
  const Eigen::AlignedBox3d box = box_above_ground(solid);
  const Eigen::Vector2d scale(rock.width_m / box.sizes().x(), rock.depth_m / box.sizes().y());
  const Eigen::Vector3d center = box.center();
  for (Eigen::Vector3d& vertex : solid.vertices) {
    vertex.x() = (vertex.x() - center.x()) * scale.x();
    vertex.y() = (vertex.y() - center.y()) * scale.y();
  }
}

// Displaces all vertices by noise in four octaves. Amplitudes are small against wavelengths, so
// that the surface does not intersect itself.
void roughen(Solid& solid, const SiteRock& rock) {
  const double size = std::min({rock.width_m, rock.depth_m, rock.height_m});
  struct Octave {
    double length_m;
    double height_m;
  };
  const std::array<Octave, 4> octaves = {
      Octave{0.9 * size, 0.055 * size}, Octave{0.3 * size, 0.016 * size},
      Octave{std::min(0.08, 0.3 * size), std::min(0.08, 0.3 * size) * 0.05},
      Octave{std::min(0.03, 0.2 * size), std::min(0.03, 0.2 * size) * 0.05}};
  const auto displacement = [&](const Eigen::Vector3d& point) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < octaves.size(); ++n)
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        sum[axis] +=
            octaves[n].height_m *
            gradient_noise(point / octaves[n].length_m,
                           mix_bits(rock.seed, 20 + 3 * n + static_cast<std::uint64_t>(axis)));
    return sum;
  };
  for (Eigen::Vector3d& vertex : solid.vertices) vertex += rock.roughness * displacement(vertex);
}

Solid block(const SiteRock& rock, double edge_length_m, double sink_m) {
  RandomStream draw(rock.seed, 10);
  const double largest = std::max({rock.width_m, rock.depth_m, rock.height_m});
  const double bound = 4.0 * (largest + sink_m);
  const double chip = 0.03 * largest;
  BlockSize size;
  size.half = 0.5 * Eigen::Vector2d(rock.width_m, rock.depth_m);
  size.top_m = rock.height_m;
  size.bottom_m = -sink_m;
  std::vector<HalfSpace> planes = block_half_spaces(size, rock, draw);
  chip_edges(planes, chip, bound, draw);
  std::vector<Solid> parts = {convex_solid(planes, bound)};
  for (int n = 0; n < rock.ledges; ++n) {
    BlockSize ledge = size;
    const double heading = draw.uniform(0.0, 2.0 * pi);
    ledge.half *= draw.uniform(0.5, 0.7);
    ledge.center = wall_distance(size.half, heading) * draw.uniform(0.55, 0.75) *
                   direction(heading, 0.0).head<2>();
    ledge.top_m *= draw.uniform(0.4, 0.8);
    ledge.bottom_m *= draw.uniform(0.85, 0.95);
    planes = block_half_spaces(ledge, rock, draw);
    chip_edges(planes, chip, bound, draw);
    parts.push_back(with_labels_from(convex_solid(planes, bound), 1000 * (n + 1)));
  }
  Solid coarse = unite(parts);
  if (rock.cleft_m > 0.0) {
    const Solid wedge = convex_solid(cleft_half_spaces(rock, draw), 10.0 * bound);
    coarse = subtract(coarse, with_labels_from(wedge, 100'000));
  }
  fit(coarse, rock);
  Solid solid = refine_facets(coarse, edge_length_m);
  roughen(solid, rock);
  return solid;
}

Solid rounded(const SiteRock& rock, double edge_length_m) {
  const double w = 0.5 * rock.width_m;
  const double d = 0.5 * rock.depth_m;
  const double h = rock.height_m;
  const auto ellipsoid = [&](const Eigen::Vector3d& radii, const Eigen::Vector3d& center) {
    Solid solid = ellipsoid_solid(radii, edge_length_m);
    for (Eigen::Vector3d& vertex : solid.vertices) vertex += center;
    roughen(solid, rock);
    return solid;
  };
  switch (rock.shape) {
    case RockShape::dome:
      return ellipsoid({1.1 * w, 1.1 * d, 1.7 * h}, {0.0, 0.0, -0.7 * h});
    case RockShape::sloper:
      return ellipsoid({1.15 * w, 1.15 * d, 2.0 * h}, {0.0, 0.0, -h});
    case RockShape::pinch:
      return ellipsoid({w, d, 0.6 * h}, {0.0, 0.0, 0.4 * h});
    case RockShape::jug:
      // The bowl is cut from above, behind the lip, slightly off the axes for general position.
      return subtract(ellipsoid({w, d, 0.8 * h}, {0.0, 0.0, 0.2 * h}),
                      ellipsoid({0.72 * w, 0.75 * d, 0.5 * h}, {0.011 * w, 0.72 * d, 0.3713 * h}));
    default:
      return ellipsoid({w, d, 0.62 * h}, {0.0, 0.0, 0.38 * h});
  }
}

}  // namespace

Solid rock_solid(const SiteRock& rock, double edge_length_m, double sink_m) {
  const bool has_facets = rock.shape == RockShape::block || rock.shape == RockShape::crimp;
  Solid solid = has_facets ? block(rock, edge_length_m, sink_m) : rounded(rock, edge_length_m);
  fit(solid, rock);
  std::fill(solid.labels.begin(), solid.labels.end(), 0);
  return solid;
}

namespace {

constexpr double base_depth_m = 0.2;  // depth of rocks below the lowest ground under them

constexpr double splinter_fraction = 0.004;  // minimum edge length, relative to edge_length_m

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
  parallel_each(grid.rows, 8, [&](std::size_t row) {
    for (std::size_t column = 0; column < grid.columns; ++column) {
      const Eigen::Vector2d at = grid.at(column, row);
      grid.heights_m[row * grid.columns + column] = relief.height(at.x(), at.y());
    }
  });
  const double lowest = *std::min_element(grid.heights_m.begin(), grid.heights_m.end());
  // The base is below all rocks.
  double reach = 0.0;
  for (const SiteRock& rock : site.rocks) reach = std::max(reach, rock.height_m);
  return block_solid(grid, lowest - 2.0 * base_depth_m - reach);
}

// The rock in the ground frame; triangles are labeled with `number`.
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

// The triangles for which `keep` returns true, and their vertices.
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

// The connected part that contains the ground's base. Enclosed cavities are dropped. Throws Error
// if another part contains the outside of a rock, which then does not touch the ground.
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
    throw Error("the rock does not touch the ground",
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
  parallel_each(solid.vertices.size(), 4096, [&](std::size_t n) {
    mesh.vertex_colors[n] = color_of(site, vertex_labels[n], solid.vertices[n]);
    mesh.vertices[n] = site_from_ground * solid.vertices[n];
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
  parallel_each(solids.size(), [&](std::size_t n) {
    solids[n] =
        n == 0 ? ground_solid(site, relief, options.edge_length_m)
               : placed_rock(site.rocks[n - 1], static_cast<int>(n), relief, options.edge_length_m);
  });
  Solid solid = part_of_ground(unite(solids, splinter_fraction * options.edge_length_m), site);
  if (!options.closed) solid = select(solid, [&](std::size_t n) { return solid.labels[n] >= 0; });
  return painted(solid, site);
}

}  // namespace libmap
