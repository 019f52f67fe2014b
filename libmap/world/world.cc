#include "libmap/world/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "libmap/core/bytes.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_repair.h"
#include "libmap/texture/textured_mesh_io.h"
#include "libmap/world/world_visuals.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Accelerations at the surface, m/s2.
constexpr std::array<std::pair<const char*, double>, 3> bodies{
    {{"earth", 9.81}, {"moon", 1.62}, {"mars", 3.71}}};
// Vertices within this fraction of the mesh's size are merged.
constexpr double weld_fraction = 1e-7;

struct CollisionMesh {
  TriangleMesh mesh;
  double deviation_m = 0.0;
};

// Decimation needs an oriented manifold. Cutting the mesh into one moves copies of vertices.
CollisionMesh make_collision_mesh(const TriangleMesh& visual, double max_error_m) {
  TriangleMesh mesh;
  mesh.vertices = visual.vertices;
  mesh.triangles = visual.triangles;
  const double weld_m = weld_fraction * size_of(visual);
  weld_vertices(mesh, weld_m);
  std::vector<bool> keep = repeated_triangles(mesh.triangles);
  for (std::size_t t = 0; t < keep.size(); ++t)
    keep[t] = !keep[t] && !has_repeated_vertex(mesh.triangles[t]);
  mesh = select_triangles(mesh, keep);
  const auto before = static_cast<std::ptrdiff_t>(mesh.vertices.size());
  make_manifold(mesh);
  double moved_m = 0.0;
  for (const double distance :
       distances_to_surface({mesh.vertices.begin() + before, mesh.vertices.end()}, visual))
    moved_m = std::max(moved_m, distance);
  moved_m += weld_m + 2 * mesh_unit_m;
  double deviation_m = moved_m;
  if (max_error_m > moved_m)
    deviation_m += decimate_triangles(mesh, max_error_m - moved_m).deviation_m;
  round_vertices(mesh);
  return {std::move(mesh), deviation_m};
}

// MuJoCo's own format, in the byte order of the machines that it runs on.
std::string field_bytes(const HeightField& field) {
  const std::array<std::int32_t, 2> sizes = {static_cast<std::int32_t>(field.rows),
                                             static_cast<std::int32_t>(field.columns)};
  std::string text(reinterpret_cast<const char*>(sizes.data()), sizeof(sizes));
  return text.append(reinterpret_cast<const char*>(field.heights_m.data()),
                     field.heights_m.size() * sizeof(float));
}

void write_model_files(const fs::path& path, const TexturedMesh& model) {
  if (model.has_texture())
    for (const ModelFile& file : textured_mesh_files(path, model)) file.write(file.path);
  else
    write_mesh(path, model.mesh);
}

// Appends one mesh for each page of the texture, and one for each color of the scores.
void write_visuals(const fs::path& folder, const WorldModelInput& input, const WorldScores& scores,
                   WorldReport& report, std::vector<WorldVisual>& visuals) {
  const TexturedMesh baked =
      input.visual.has_texture() ? input.visual : bake_vertex_colors(input.visual.mesh);
  for (const std::int32_t page :
       std::set<std::int32_t>(baked.page_of_triangle.begin(), baked.page_of_triangle.end())) {
    const std::string file = input.name + "_visual_" + std::to_string(visuals.size()) + ".obj";
    visuals.push_back({.file = file, .texture = ""});
    if (page != no_page)
      visuals.back().texture = texture_page_path(file, 0, ImageFormat::png).string();
    if (!folder.empty()) write_model_files(folder / file, page_of(baked, page));
  }
  if (scores.points.empty()) return;
  const ScoreSquares squares =
      score_squares(scores.points, scores.colors, scores.size_m, input.visual.mesh);
  report.score_points += squares.on_surface;
  for (std::size_t n = 0; n < squares.meshes.size(); ++n) {
    const std::string file = input.name + "_score_" + std::to_string(n) + ".obj";
    visuals.push_back({.file = file, .texture = "", .color = squares.meshes[n].color});
    if (!folder.empty()) write_mesh(folder / file, squares.meshes[n].mesh);
  }
}

std::vector<CollisionBall> balls_of(const WorldModelInput& input, const HeightField& field,
                                    const WorldOptions& options) {
  const TriangleMesh& mesh = input.visual.mesh;
  std::vector<bool> marks(mesh.triangles.size());
  for (std::size_t t = 0; t < marks.size(); ++t)
    marks[t] = may_be_left_out(field, mesh, mesh.triangles[t]);
  return cover_with_balls(
      mesh, marks, input.surface,
      {.max_radius_m = options.ball_radius_m, .max_deviation_m = options.field.max_deviation_m});
}

}  // namespace

void bind(ParameterTable& table, WorldOptions& options) {
  table.add("collision_error_m", options.collision_error_m, positive,
            "maximum distance between the collision mesh and the visual mesh, m");
  table.add("cell_size_m", options.field.cell_size_m, positive,
            "cell size of MuJoCo's height field, m");
  table.add("field_error_m", options.field.max_deviation_m, positive,
            "maximum distance of MuJoCo's height field and balls from the surface, m");
  table.add("ball_radius_m", options.ball_radius_m, positive,
            "maximum radius of the balls that replace cells of MuJoCo's height field, m");
  table.add("gravity", options.gravity, "downward gravity, m/s2: a number, or earth, moon or mars");
  table.add("friction", options.friction, not_negative, "coefficient of friction of the ground");
  table.add("restitution", options.restitution, zero_to_one,
            "coefficient of restitution of the ground");
  table.add("sensor_noise_m", options.sensor_noise_m, not_negative,
            "standard deviation of the depth noise of the rig's cameras in world.sdf, m");
}

void describe(ResultTable& table, const WorldReport& report) {
  table.add("visual_triangles", report.visual_triangles, Merge::sum, "triangles of visual meshes");
  table.add("collision_triangles", report.collision_triangles, Merge::sum,
            "number of triangles of the collision meshes");
  table.add("collision_deviation_m", report.collision_deviation_m, Merge::max,
            "maximum distance between collision and visual meshes, in both directions, m");
  table.add("field_nodes", report.field_nodes, Merge::sum, "number of height field nodes");
  table.add("field_deviation_m", report.field_deviation_m, Merge::max,
            "maximum distance between height fields and surface, in both directions, m");
  table.add("missing_cells", report.missing_cells, Merge::sum,
            "number of cells of the height fields that balls replace");
  table.add("balls", report.balls, Merge::sum, "balls that replace cells of the height fields");
  table.add("collision_bytes", report.collision_bytes, Merge::sum,
            "size of collision meshes and height fields, bytes");
  table.add("score_points", report.score_points, Merge::sum, "map points on the surface");
}

double gravity_of(const std::string& text) {
  for (const auto& [name, gravity] : bodies)
    if (text == name) return gravity;
  const std::optional<double> gravity = parse_double(text);
  if (gravity && *gravity >= 0 && *gravity < 1e6) return *gravity;
  throw Error("unknown gravity" + did_you_mean(text, {"earth", "moon", "mars"}),
              {.field = "--gravity", .value = text, .bound = "0 to 1e6 m/s2, earth, moon or mars"});
}

void require_world_name(const std::string& name, const std::string& field) {
  const bool reserved =
      name == "world" || (name.size() >= 4 && name.starts_with("__") && name.ends_with("__"));
  const bool control =
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (name.empty() || reserved || control || name.find("::") != std::string::npos)
    throw Error("SDF forbids this name",
                {.field = field,
                 .value = name,
                 .bound = "not empty, not 'world' or '__X__', without '::' or control characters"});
}

std::vector<std::string> world_file_names() {
  return {"world.sdf", "world.xml", "world.urdf", "meshes"};
}

WorldModel write_world_model(const fs::path& folder, const WorldModelInput& input,
                             const WorldScores& scores, const WorldOptions& options,
                             WorldReport& report) {
  check_parameters(options);
  const TriangleMesh& visual = input.visual.mesh;
  require_sound(visual);
  if (visual.triangles.empty()) throw no_elements("triangles");
  const fs::path meshes = folder.empty() ? fs::path() : folder / "meshes";
  if (!meshes.empty()) fs::create_directories(meshes);
  WorldModel model;
  model.name = input.name;
  model.field = make_height_field(input.surface, options.field);
  model.balls = balls_of(input, model.field, options);
  write_visuals(meshes, input, scores, report, model.visuals);
  const CollisionMesh collision = make_collision_mesh(visual, options.collision_error_m);
  if (!meshes.empty()) {
    const fs::path collision_file = meshes / (input.name + "_collision.obj");
    const fs::path field_file = meshes / (input.name + "_field.bin");
    write_model_files(meshes / (input.name + ".glb"), input.visual);
    write_mesh(collision_file, collision.mesh);
    write_text(field_file, field_bytes(model.field));
    report.collision_bytes += fs::file_size(collision_file) + fs::file_size(field_file);
  }
  report.visual_triangles += visual.triangles.size();
  report.collision_triangles += collision.mesh.triangles.size();
  report.collision_deviation_m = std::max(report.collision_deviation_m, collision.deviation_m);
  report.field_nodes += model.field.heights_m.size();
  report.field_deviation_m = std::max(report.field_deviation_m, model.field.deviation_m);
  report.missing_cells += count_of(model.field.is_missing);
  report.balls += model.balls.size();
  model.field.is_missing.clear();
  return model;
}

void write_world(const fs::path& folder, const WorldScene& scene) {
  require_world_name(scene.name, "name");
  std::set<std::string> names = {"rig", "footholds"};
  for (const WorldModel& model : scene.models) {
    require_world_name(model.name, "name");
    if (!names.insert(model.name).second)
      throw Error("is reserved or used twice", {.field = "name of a model", .value = model.name});
  }
  if (folder.empty()) return;
  for (const auto& [name, text] : world_texts(scene)) write_text(folder / name, text);
}

}  // namespace libmap
