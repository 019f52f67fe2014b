#include "libmap/world/world_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/texture/textured_mesh_io.h"
#include "libmap/world/world_layers.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Vertices this near to each other, of the mesh's size, are one.
constexpr double weld_fraction = 1e-7;
// Vertices of the collision mesh are multiples of this; so MJCF rounds, ten times as coarse.
constexpr double rounding_m = 1e-6;
constexpr double bulge_fraction = 0.7;

struct CollisionMesh {
  TriangleMesh mesh;
  double deviation_m = 0.0;
};

// Decimation needs an oriented manifold. Cutting the mesh into one moves copies of vertices.
CollisionMesh make_collision_mesh(const TriangleMesh& visual, double max_error_m) {
  CollisionMesh collision;
  collision.mesh.vertices = visual.vertices;
  collision.mesh.triangles = visual.triangles;
  const double weld_m = weld_fraction * size_of(visual);
  weld_vertices(collision.mesh, weld_m);
  const std::vector<bool> repeated = repeated_triangles(collision.mesh.triangles);
  std::vector<bool> keep(repeated.size());
  for (std::size_t t = 0; t < keep.size(); ++t)
    keep[t] = !repeated[t] && !has_repeated_vertex(collision.mesh.triangles[t]);
  collision.mesh = select_triangles(collision.mesh, keep);
  const std::vector<Eigen::Vector3d> before = collision.mesh.vertices;
  make_manifold(collision.mesh);
  const std::vector<Eigen::Vector3d> copies(
      collision.mesh.vertices.begin() + static_cast<std::ptrdiff_t>(before.size()),
      collision.mesh.vertices.end());
  double moved_m = weld_m;
  for (const double distance : distances_to_surface(copies, visual))
    moved_m = std::max(moved_m, weld_m + distance);
  moved_m += rounding_m;
  if (max_error_m > moved_m)
    collision.deviation_m = decimate_triangles(collision.mesh, max_error_m - moved_m).deviation_m;
  collision.deviation_m += moved_m;
  for (Eigen::Vector3d& vertex : collision.mesh.vertices)
    vertex = (vertex / rounding_m).array().round() / std::round(1 / rounding_m);
  return collision;
}

// MuJoCo's own format, in the byte order of the machines that it runs on.
std::string field_bytes(const HeightField& field) {
  const std::array<std::int32_t, 2> sizes = {static_cast<std::int32_t>(field.rows),
                                             static_cast<std::int32_t>(field.columns)};
  const std::size_t bytes = field.heights_m.size() * sizeof(float);
  std::string text(sizeof(sizes) + bytes, '\0');
  std::memcpy(text.data(), sizes.data(), sizeof(sizes));
  std::memcpy(text.data() + sizeof(sizes), field.heights_m.data(), bytes);
  return text;
}

Color mean_color(const TriangleMesh& mesh) {
  if (mesh.vertex_colors.empty()) return WorldVisual{}.color;
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (const Color& color : mesh.vertex_colors) sum += Eigen::Array3d(color[0], color[1], color[2]);
  const Eigen::Array3d mean = (sum / static_cast<double>(mesh.vertex_colors.size())).round();
  return {static_cast<std::uint8_t>(mean.x()), static_cast<std::uint8_t>(mean.y()),
          static_cast<std::uint8_t>(mean.z())};
}

void write_model_files(const fs::path& path, const TexturedMesh& model) {
  for (const ModelFile& file : textured_mesh_files(path, model)) file.write(file.path);
}

void write_glb(const fs::path& path, const TexturedMesh& visual) {
  if (visual.has_texture())
    write_model_files(path, visual);
  else
    write_mesh(path, visual.mesh);
}

std::vector<WorldVisual> write_visuals(const fs::path& folder, const std::string& name,
                                       const TexturedMesh& visual) {
  const TexturedMesh baked = visual.has_texture() ? visual : bake_vertex_colors(visual.mesh);
  std::vector<WorldVisual> visuals;
  const std::set<std::int32_t> pages(baked.page_of_triangle.begin(), baked.page_of_triangle.end());
  for (const std::int32_t page : pages) {
    const std::string stem = name + "_visual_" + std::to_string(visuals.size());
    WorldVisual shown{.file = stem + ".obj", .texture = {}, .color = mean_color(visual.mesh)};
    if (page != no_page)
      shown.texture = texture_page_path(shown.file, 0, ImageFormat::png).string();
    if (!folder.empty()) {
      const TexturedMesh part = page_of(baked, page);
      if (page == no_page)
        write_mesh(folder / shown.file, part.mesh);
      else
        write_model_files(folder / shown.file, part);
    }
    visuals.push_back(shown);
  }
  return visuals;
}

std::vector<WorldVisual> write_scores(const fs::path& folder, const std::string& name,
                                      const TriangleMesh& surface, const WorldScores& scores,
                                      WorldReport& report) {
  std::vector<WorldVisual> visuals;
  if (scores.points.empty()) return visuals;
  const ScoreSquares squares = score_squares(scores.points, scores.colors, scores.size_m, surface);
  report.score_points += squares.on_surface;
  for (const ColoredMesh& colored : squares.meshes) {
    visuals.push_back({.file = name + "_score_" + std::to_string(visuals.size()) + ".obj",
                       .texture = {},
                       .color = colored.color});
    if (!folder.empty()) write_mesh(folder / visuals.back().file, colored.mesh);
  }
  return visuals;
}

ConvexPieces pieces_of(const TriangleMesh& collision, const TriangleMesh& visual,
                       const HeightField& field, const WorldOptions& options) {
  std::vector<bool> marks(collision.triangles.size());
  for (std::size_t t = 0; t < marks.size(); ++t)
    marks[t] = is_above_missing(field, collision, collision.triangles[t]);
  return make_convex_pieces(collision, marks, visual, options.collision_error_m,
                            bulge_fraction * options.collision_error_m, options.piece_depth_m);
}

}  // namespace

std::vector<std::string> world_file_names() {
  return {"world.sdf", "world.xml", "world.urdf", world_mesh_folder};
}

void describe(ResultTable& table, const WorldReport& report) {
  table.add("visual_triangles", report.visual_triangles, Merge::sum, "triangles of the visuals");
  table.add("collision_triangles", report.collision_triangles, Merge::sum,
            "triangles of the collision meshes");
  table.add("collision_deviation_m", report.collision_deviation_m, Merge::max,
            "maximum distance between collision and visual meshes, in both directions, m");
  table.add("field_nodes", report.field_nodes, Merge::sum, "nodes of the height fields");
  table.add("field_deviation_m", report.field_deviation_m, Merge::max,
            "maximum distance between height fields and surface, in both directions, m");
  table.add("missing_cells", report.missing_cells, Merge::sum,
            "cells of the height fields that convex pieces replace");
  table.add("convex_pieces", report.convex_pieces, Merge::sum, "convex pieces");
  table.add("piece_deviation_m", report.piece_deviation_m, Merge::max,
            "maximum distance of the pieces' outer faces from the visual meshes, m");
  table.add("collision_bytes", report.collision_bytes, Merge::sum,
            "size of collision meshes and height fields, bytes");
  table.add("score_points", report.score_points, Merge::sum, "map points on the surface");
}

WorldModel write_world_model(const fs::path& folder, const WorldModelInput& input,
                             const WorldScores& scores, const WorldOptions& options,
                             WorldReport& report) {
  check_parameters(options);
  require_sound(input.visual.mesh);
  if (input.visual.mesh.triangles.empty()) throw Error("contains no triangle");
  const fs::path meshes = folder.empty() ? fs::path() : folder / world_mesh_folder;
  if (!meshes.empty()) fs::create_directories(meshes);
  WorldModel model{.name = input.name,
                   .visuals = {},
                   .graspability = {},
                   .collision = input.name + "_collision.obj",
                   .field_file = input.name + "_field.bin",
                   .field = make_height_field(input.surface, options.field),
                   .pieces = {}};
  const CollisionMesh collision = make_collision_mesh(input.visual.mesh, options.collision_error_m);
  ConvexPieces pieces = pieces_of(collision.mesh, input.visual.mesh, model.field, options);
  model.pieces = std::move(pieces.pieces);
  model.visuals = write_visuals(meshes, input.name, input.visual);
  model.graspability = write_scores(meshes, input.name, input.visual.mesh, scores, report);
  if (!meshes.empty()) {
    write_glb(meshes / (input.name + ".glb"), input.visual);
    write_mesh(meshes / model.collision, collision.mesh);
    write_text(meshes / model.field_file, field_bytes(model.field));
    report.collision_bytes +=
        fs::file_size(meshes / model.collision) + fs::file_size(meshes / model.field_file);
  }
  report.visual_triangles += input.visual.mesh.triangles.size();
  report.collision_triangles += collision.mesh.triangles.size();
  report.collision_deviation_m = std::max(report.collision_deviation_m, collision.deviation_m);
  report.field_nodes += model.field.heights_m.size();
  report.field_deviation_m = std::max(report.field_deviation_m, model.field.deviation_m);
  report.missing_cells += model.field.missing_cells;
  report.convex_pieces += model.pieces.size();
  report.piece_deviation_m = std::max(report.piece_deviation_m,
                                      collision.deviation_m + pieces.deviation_m + 10 * rounding_m);
  model.field.is_missing = {};
  return model;
}

void write_world(const fs::path& folder, const WorldScene& scene) {
  require_world_name(scene.name, "name");
  std::set<std::string> names = {"rig", "footholds"};
  for (const WorldModel& model : scene.models) {
    require_world_name(model.name, "name");
    if (!names.insert(model.name).second)
      throw Error("two models have this name", {.field = "name", .value = model.name});
  }
  if (folder.empty()) return;
  write_text(folder / "world.sdf", to_sdf(scene));
  write_text(folder / "world.xml", to_mjcf(scene));
  write_text(folder / "world.urdf", to_urdf(scene));
}

}  // namespace libmap
