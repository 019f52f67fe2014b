#include "libmap/view/layer_geometry.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <variant>

#include "libmap/core/error.h"
#include "libmap/geometry/spatial_index.h"

namespace libmap {
namespace {

constexpr std::size_t spacing_samples = 2000;
constexpr double min_width_px = 1.3;
// Gaps between Poisson-disk samples are up to twice their spacing.
constexpr double square_per_spacing = 1.8;
// Neighboring cubes overlap slightly, so that rounding causes no gaps.
constexpr double cube_per_spacing = 1.005;
constexpr double lone_point_size_m = 0.01;
// A filler closes gaps of two missing cells, and is behind neighbors up to two steps farther away.
constexpr double filler_per_spacing = 3.0;
constexpr double filler_depth_per_size = 2.75;

// Quantile of the values.
double quantile_of(std::vector<double> values, double fraction) {
  const auto rank = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

// Neighborhoods of a sample of a cloud's points, without coincident points.
struct Neighborhoods {
  std::vector<Eigen::Vector3d> nearest;  // offset to the nearest neighbor
  std::vector<double> eighth_m;  // distance to the eighth neighbor; infinite if there are fewer
};

Neighborhoods look_around(const std::vector<Eigen::Vector3d>& positions) {
  const PointTree tree(positions);
  Neighborhoods result;
  const std::size_t step = std::max<std::size_t>(1, positions.size() / spacing_samples);
  for (std::size_t i = 0; i < positions.size(); i += step) {
    std::vector<NeighborPoint> neighbors = tree.nearest(positions[i], 12);
    // Points may coincide.
    std::erase_if(neighbors, [](const NeighborPoint& near) { return !(near.square_m2 > 0.0); });
    if (neighbors.empty()) continue;
    result.nearest.push_back(positions[neighbors[0].index] - positions[i]);
    result.eighth_m.push_back(neighbors.size() > 7 ? std::sqrt(neighbors[7].square_m2)
                                                   : std::numeric_limits<double>::infinity());
  }
  return result;
}

PreparedLayer prepare_cloud(const PointCloud& cloud, const SceneLayer& layer,
                            const Pose& terrain_from_scene) {
  cloud.check();
  std::vector<std::size_t> finite;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (cloud.positions[i].allFinite()) finite.push_back(i);
  PointCloud in_terrain = transform_cloud(
      finite.size() == cloud.size() ? cloud : select_points(cloud, finite), terrain_from_scene);

  PreparedLayer result;
  ColoredPoints colored =
      color_points({in_terrain.positions, in_terrain.colors, in_terrain.fields}, layer.coloring);
  const PointSpacing spacing = estimate_spacing(in_terrain.positions);
  result.cubes = layer.point_shape == PointShape::cube ||
                 (layer.point_shape == PointShape::automatic && spacing.lattice);
  result.point_size_m = layer.point_size_m;
  if (!(result.point_size_m > 0.0)) {
    result.point_size_m =
        spacing.distance_m * (result.cubes ? cube_per_spacing : square_per_spacing);
    if (!(result.point_size_m > 0.0)) result.point_size_m = lone_point_size_m;
    if (spacing.gaps) result.filler_size_m = spacing.distance_m * filler_per_spacing;
  }
  result.positions = std::move(in_terrain.positions);
  result.colors = std::move(colored.colors);
  result.legend = std::move(colored.legend);
  result.normals = std::move(in_terrain.normals);
  for (Eigen::Vector3f& normal : result.normals)
    normal = normal.allFinite() ? normal.normalized().eval() : Eigen::Vector3f::Zero();
  const bool one_color = colored.mode == ColorMode::single && !result.normals.empty();
  result.shaded = layer.shading != Shading::none &&
                  (result.cubes || one_color || layer.shading == Shading::full);
  return result;
}

// Returns true if the mesh is colored by a face field, not by a vertex field.
bool colored_by_face(const TriangleMesh& mesh, const Coloring& coloring) {
  if (mesh.face_fields.empty()) return false;
  const auto only_faces = [&mesh](const std::string& name) {
    return find_field(mesh.face_fields, name) != nullptr &&
           find_field(mesh.vertex_fields, name) == nullptr;
  };
  switch (coloring.mode) {
    case ColorMode::automatic:
    case ColorMode::score:
      return only_faces(coloring.field.empty() ? "score" : coloring.field);
    case ColorMode::field:
      return only_faces(coloring.field) ||
             (mesh.vertex_fields.empty() && coloring.field.size() > 1);
    case ColorMode::flags:
      return only_faces("convex") || only_faces("graspable");
    case ColorMode::own:
    case ColorMode::height:
    case ColorMode::single:
    case ColorMode::texture:
      break;
  }
  return false;
}

// The mesh without triangles that have corners with non-finite coordinates.
TriangleMesh finite_part(const TriangleMesh& mesh) {
  std::vector<std::size_t> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& triangle = mesh.triangles[t];
    if (std::all_of(triangle.begin(), triangle.end(),
                    [&mesh](std::uint32_t corner) { return mesh.vertices[corner].allFinite(); }))
      kept.push_back(t);
  }
  if (kept.size() == mesh.triangles.size()) return mesh;
  TriangleMesh result = mesh;
  for (std::size_t k = 0; k < kept.size(); ++k) {
    result.triangles[k] = mesh.triangles[kept[k]];
    for (std::size_t f = 0; f < mesh.face_fields.size(); ++f)
      result.face_fields[f].values[k] = mesh.face_fields[f].values[kept[k]];
  }
  result.triangles.resize(kept.size());
  for (ScalarField& field : result.face_fields) field.values.resize(kept.size());
  return result;
}

// Positions, normals and colors of the vertices that a triangle uses.
void keep_used_vertices(const TriangleMesh& mesh, const std::vector<Color>& colors,
                        PreparedLayer& result) {
  constexpr std::uint32_t unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> new_index(mesh.vertices.size(), unused);
  for (Triangle triangle : mesh.triangles) {
    for (std::uint32_t& corner : triangle) {
      if (new_index[corner] == unused) {
        new_index[corner] = static_cast<std::uint32_t>(result.positions.size());
        result.positions.push_back(mesh.vertices[corner]);
        result.normals.push_back(mesh.vertex_normals[corner]);
        result.colors.push_back(colors[corner]);
      }
      corner = new_index[corner];
    }
    result.triangles.push_back(triangle);
  }
}

void give_each_triangle_its_corners(const TriangleMesh& mesh, const std::vector<Color>& face_colors,
                                    PreparedLayer& result) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto first = static_cast<std::uint32_t>(3 * t);
    for (const std::uint32_t corner : mesh.triangles[t]) {
      result.positions.push_back(mesh.vertices[corner]);
      result.normals.push_back(mesh.vertex_normals[corner]);
      result.colors.push_back(face_colors[t]);
    }
    result.triangles.push_back({first, first + 1, first + 2});
  }
}

PreparedLayer prepare_mesh(const TriangleMesh& input, const SceneLayer& layer,
                           const Pose& terrain_from_scene) {
  input.check();
  TriangleMesh mesh = finite_part(input);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = terrain_from_scene * vertex;
  if (mesh.vertex_normals.empty()) {
    mesh.vertex_normals = estimate_vertex_normals(mesh);
  } else {
    const Eigen::Matrix3f rotation = terrain_from_scene.linear().cast<float>();
    for (Eigen::Vector3f& normal : mesh.vertex_normals) {
      normal = (rotation * normal).normalized().eval();
      if (!normal.allFinite()) normal.setZero();
    }
  }

  PreparedLayer result;
  result.is_mesh = true;
  result.shaded = layer.shading != Shading::none;
  if (colored_by_face(mesh, layer.coloring)) {
    std::vector<Eigen::Vector3d> centers;
    for (const Triangle& triangle : mesh.triangles)
      centers.push_back(
          (mesh.vertices[triangle[0]] + mesh.vertices[triangle[1]] + mesh.vertices[triangle[2]]) /
          3.0);
    ColoredPoints colored = color_points({centers, {}, mesh.face_fields}, layer.coloring);
    give_each_triangle_its_corners(mesh, colored.colors, result);
    result.legend = std::move(colored.legend);
  } else {
    ColoredPoints colored =
        color_points({mesh.vertices, mesh.vertex_colors, mesh.vertex_fields}, layer.coloring);
    keep_used_vertices(mesh, colored.colors, result);
    result.legend = std::move(colored.legend);
  }
  return result;
}

// Adds a triangle with its own vertices, because texture coordinates differ at chart borders.
void add_corners(const TexturedMesh& model, std::size_t t, const Pose& terrain_from_scene,
                 const std::vector<Eigen::Vector3f>& normals, PreparedLayer& layer) {
  const auto first = static_cast<std::uint32_t>(layer.positions.size());
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t corner = model.mesh.triangles[t][k];
    layer.positions.push_back(terrain_from_scene * model.mesh.vertices[corner]);
    if (!normals.empty())
      layer.normals.push_back(terrain_from_scene.linear().cast<float>() * normals[corner]);
    layer.colors.push_back(layer.texture == nullptr ? untextured_color : Color{255, 255, 255});
    if (layer.texture != nullptr) layer.coordinates.push_back(model.texture_coordinates[t][k]);
  }
  layer.triangles.push_back({first, first + 1, first + 2});
}

// One layer per page, which refers to the page. Drops triangles with non-finite corners.
std::vector<PreparedLayer> prepare_textured(const TexturedMesh& model, const SceneLayer& layer,
                                            const Pose& terrain_from_scene) {
  model.check();
  const bool shaded = layer.shading == Shading::full;
  const std::vector<Eigen::Vector3f> normals =
      shaded ? estimate_vertex_normals(model.mesh) : std::vector<Eigen::Vector3f>();
  // The last part contains triangles without a page.
  std::vector<PreparedLayer> parts(model.pages.size() + 1);
  for (std::size_t page = 0; page < parts.size(); ++page) {
    parts[page].is_mesh = true;
    parts[page].shaded = shaded;
    parts[page].texture = page < model.pages.size() ? &model.pages[page] : nullptr;
  }
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t) {
    const Triangle& triangle = model.mesh.triangles[t];
    if (!std::all_of(triangle.begin(), triangle.end(), [&model](std::uint32_t corner) {
          return model.mesh.vertices[corner].allFinite();
        }))
      continue;
    const std::int32_t page = model.page_of_triangle[t];
    add_corners(model, t, terrain_from_scene, normals,
                page == no_page ? parts.back() : parts[static_cast<std::size_t>(page)]);
  }
  std::erase_if(parts, [](const PreparedLayer& part) { return part.positions.empty(); });
  return parts;
}

Color darkened(const Color& color, double fraction) {
  Color result{};
  for (std::size_t c = 0; c < 3; ++c)
    result[c] = static_cast<std::uint8_t>(std::lround(fraction * color[c]));
  return result;
}

// Lambertian shading with ambient light. The light is at the upper left behind the camera; both
// sides of a surface are lit. A point without a normal keeps its color.
double shade_of(const Eigen::Vector3f& normal, const SceneCamera& camera) {
  const Eigen::Vector3d n = normal.cast<double>();
  if (n.isZero()) return 1.0;
  static const double scale = 1.0 / std::sqrt(0.5 * 0.5 + 0.7 * 0.7 + 1.0);
  const Eigen::Vector3d light = scale * (-0.5 * camera.right + 0.7 * camera.up - camera.forward);
  const double toward_camera = n.dot(camera.forward) > 0.0 ? -1.0 : 1.0;
  return 0.3 + 0.7 * std::max(0.0, toward_camera * n.dot(light));
}

class TriangleBuilder {
 public:
  TriangleBuilder(const Eigen::Vector3d& origin, ColoredTriangles& target)
      : origin_(origin), target_(target) {}

  // Adds the parallelogram around `center` with half edges a and b.
  void add_quad(const Eigen::Vector3d& center, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                const Color& color) {
    const auto first = static_cast<std::uint32_t>(target_.vertices.size());
    const Eigen::Vector3d middle = center - origin_;
    for (const Eigen::Vector3d& corner : {Eigen::Vector3d(-a - b), Eigen::Vector3d(a - b),
                                          Eigen::Vector3d(a + b), Eigen::Vector3d(b - a)}) {
      target_.vertices.emplace_back((middle + corner).cast<float>());
      target_.colors.push_back(color);
    }
    target_.triangles.push_back({first, first + 1, first + 2});
    target_.triangles.push_back({first, first + 2, first + 3});
  }

  // Adds the sides of the cube around `center` that face the camera.
  void add_cube(const Eigen::Vector3d& center, double half, const Color& color, bool shaded,
                const SceneCamera& camera) {
    // Seen along an axis, a cube has one visible side, which is drawn in its exact color.
    constexpr std::array<double, 3> side_shades{0.70, 0.84, 1.0};
    const Eigen::Vector3d toward =
        camera.perspective ? (camera.position - center).eval() : (-camera.forward).eval();
    const double least = camera.perspective ? half : 1e-9;
    const bool single_side = (toward.array().abs() > least).count() == 1;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (!(std::abs(toward[axis]) > least)) continue;
      const Eigen::Vector3d out = std::copysign(half, toward[axis]) * Eigen::Vector3d::Unit(axis);
      const double shade = single_side ? 1.0
                           : axis == 2 && out.z() < 0.0
                               ? 0.6
                               : side_shades[static_cast<std::size_t>(axis)];
      add_quad(center + out, half * Eigen::Vector3d::Unit((axis + 1) % 3),
               half * Eigen::Vector3d::Unit((axis + 2) % 3),
               shaded ? darkened(color, shade) : color);
    }
  }

 private:
  const Eigen::Vector3d origin_;
  ColoredTriangles& target_;
};

// Distance of a filler behind its point, m.
double filler_depth_m(const PreparedLayer& layer, const SceneCamera& camera) {
  const double usual = filler_depth_per_size * layer.point_size_m;
  if (camera.perspective || camera.forward.z() > -0.999) return usual;
  const Bounds3d bounds = bounds_of(layer.positions);
  return bounds.max.z() - bounds.min.z() + usual;
}

ColoredTriangles mesh_triangles(const PreparedLayer& layer, const SceneCamera& camera,
                                const Eigen::Vector3d& origin) {
  ColoredTriangles result;
  result.triangles = layer.triangles;
  result.colors = layer.colors;
  for (std::size_t i = 0; i < layer.positions.size(); ++i) {
    result.vertices.emplace_back((layer.positions[i] - origin).cast<float>());
    if (layer.shaded)
      result.colors[i] = darkened(layer.colors[i], shade_of(layer.normals[i], camera));
  }
  result.texture = layer.texture;
  result.coordinates = layer.coordinates;
  return result;
}

}  // namespace

std::vector<PreparedLayer> prepare_layers(const SceneLayer& layer, const Pose& terrain_from_scene) {
  const auto* textured = std::get_if<TexturedMesh>(&layer.shape);
  const bool has_texture = textured != nullptr && textured->has_texture();
  const ColorMode mode = layer.coloring.mode;
  if (mode == ColorMode::texture && !has_texture)
    throw Error("the data contain no texture", {.field = "color mode", .value = "texture"});
  if (has_texture && (mode == ColorMode::texture || mode == ColorMode::automatic))
    return prepare_textured(*textured, layer, terrain_from_scene);
  if (const auto* cloud = std::get_if<PointCloud>(&layer.shape))
    return {prepare_cloud(*cloud, layer, terrain_from_scene)};
  const TriangleMesh& mesh =
      textured != nullptr ? textured->mesh : std::get<TriangleMesh>(layer.shape);
  return {prepare_mesh(mesh, layer, terrain_from_scene)};
}

PointSpacing estimate_spacing(const std::vector<Eigen::Vector3d>& positions) {
  if (positions.size() < 2) return {};
  const Neighborhoods around = look_around(positions);
  if (around.nearest.empty()) return {};
  std::vector<double> distances;
  for (const Eigen::Vector3d& offset : around.nearest) distances.push_back(offset.norm());
  // On a lattice, some points have a neighbor at a distance of one pitch.
  const double pitch = quantile_of(distances, 0.1);
  const auto on_lattice = [pitch](const Eigen::Vector3d& offset) {
    const Eigen::Array3d steps = offset.array() / pitch;
    return ((steps - steps.round()).abs() < 0.02).all();
  };
  const auto count = static_cast<std::ptrdiff_t>(distances.size());
  if (std::count_if(around.nearest.begin(), around.nearest.end(), on_lattice) * 20 < 19 * count)
    return {.distance_m = quantile_of(distances, 0.5), .lattice = false, .gaps = true};
  // On a closed surface, the eight nearest cells share at least a corner with the center cell.
  const auto enclosed = [pitch](double eighth_m) { return eighth_m < 1.8 * pitch; };
  const auto closed = std::count_if(around.eighth_m.begin(), around.eighth_m.end(), enclosed);
  return {.distance_m = pitch, .lattice = true, .gaps = closed * 100 < 85 * count};
}

ColoredTriangles triangles_of(const PreparedLayer& layer, const SceneCamera& camera,
                              const Eigen::Vector3d& origin) {
  if (layer.is_mesh) return mesh_triangles(layer, camera, origin);
  ColoredTriangles result;
  result.vertices.reserve(4 * layer.positions.size());
  result.colors.reserve(4 * layer.positions.size());
  TriangleBuilder builder(origin, result);
  const bool shaded = layer.shaded && !layer.cubes && !layer.normals.empty();
  const double filler_depth = filler_depth_m(layer, camera);
  for (std::size_t i = 0; i < layer.positions.size(); ++i) {
    const Eigen::Vector3d& center = layer.positions[i];
    const double depth = camera.depth_of(center);
    if (!(depth > 0.0)) continue;
    const double half =
        0.5 * std::max(layer.point_size_m, min_width_px / camera.pixels_per_m(depth));
    const Color color =
        shaded ? darkened(layer.colors[i], shade_of(layer.normals[i], camera)) : layer.colors[i];
    if (layer.cubes)
      builder.add_cube(center, half, color, layer.shaded, camera);
    else
      builder.add_quad(center, half * camera.right, half * camera.up, color);
    if (layer.filler_size_m > 2.0 * half) {
      const Eigen::Vector3d away =
          camera.perspective ? (center - camera.position).normalized().eval() : camera.forward;
      const double filler = layer.filler_size_m / 2.0;
      builder.add_quad(center + filler_depth * away, filler * camera.right, filler * camera.up,
                       color);
    }
  }
  return result;
}

}  // namespace libmap
