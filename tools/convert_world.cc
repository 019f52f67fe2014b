// graspmap convert SITE -o OUT.world: a site as a world for simulators.
#include "libmap/core/data_folder.h"
#include "libmap/core/score_color.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_tile_index.h"
#include "libmap/simulate/robot_cameras.h"
#include "libmap/texture/textured_mesh_io.h"
#include "libmap/world/world.h"
#include "tools/support/command_line.h"
#include "tools/support/foothold_file.h"
#include "tools/support/map_frame.h"
#include "tools/support/placement.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct WorldCommandOptions {
  std::string site;
  std::string output;
  std::string map;
  std::string footholds;
  std::string rig;
  std::string rig_pose = "auto";
  libmap::WorldOptions world;
};

// Points in the frame of the site.
libmap::PointCloud read_in_site(const std::string& file, Run& run) {
  libmap::PointCloud cloud = libmap::read_cloud(file).cloud;
  run.add_input(file);
  const auto manifest = libmap::read_manifest_of(file);
  return libmap::transform_cloud(cloud, map_from_input(manifest).inverse());
}

libmap::WorldScores read_scores(const std::string& file, Run& run) {
  libmap::WorldScores scores;
  if (file.empty()) return scores;
  const libmap::PointCloud map = read_in_site(file, run);
  const libmap::ScalarField* score = map.find_field("score");
  if (score == nullptr)
    throw libmap::Error("no such field; a map is required", {.file = file, .field = "score"});
  scores.points = map.positions;
  for (const double one : score->values) scores.colors.push_back(libmap::score_color(one));
  const auto manifest = libmap::read_manifest_of(file);
  scores.size_m = libmap::number_of(manifest ? manifest->find_parameter("voxel_size_m") : nullptr)
                      .value_or(libmap::median_spacing(map.positions));
  return scores;
}

std::vector<libmap::WorldFoothold> read_footholds(const std::string& file, Run& run) {
  std::vector<libmap::WorldFoothold> footholds;
  if (file.empty()) return footholds;
  for (const FootholdMark& mark : foothold_marks(read_in_site(file, run), file))
    footholds.push_back(
        {mark.position, mark.approach.normalized(), libmap::score_color(mark.score)});
  return footholds;
}

// Parses the pose. auto: above the middle of the site, at the default height of `simulate cameras`.
libmap::Pose rig_pose(const std::string& text, const std::string& site) {
  if (text != "auto") return parse_transform(text, "--rig-pose");
  constexpr double height_m = 0.25;
  const libmap::TriangleMesh mesh = libmap::read_mesh(site).mesh;
  const libmap::Bounds3d bounds = libmap::bounds_of(mesh.vertices);
  Eigen::Vector3d above = 0.5 * (bounds.min + bounds.max);
  above.z() = height_m + libmap::ground_height(mesh, above.x(), above.y());
  return libmap::make_pose(above, Eigen::Quaterniond::Identity());
}

libmap::WorldRig read_world_rig(const WorldCommandOptions& options, Run& run) {
  const fs::path file = libmap::find_data_file("rigs", options.rig);
  libmap::WorldRig rig{libmap::read_rig(file), rig_pose(options.rig_pose, options.site)};
  run.add_input(file);
  run.manifest().transforms.emplace_back("site_from_robot", rig.world_from_robot);
  for (const libmap::RigCamera& camera : rig.rig.cameras) {
    in_file(file, [&] { libmap::require_world_name(camera.name, "name of a camera"); });
    if (camera.camera.is_distorted())
      run.warn("camera {}: simulators do not support its lens distortion", camera.name);
  }
  return rig;
}

// Returns comments on the frame of the site, for the beginnings of the files.
std::vector<std::string> notes_of(const libmap::Manifest& manifest) {
  std::vector<std::string> notes = {
      "graspmap: units m, kg, s; x forward or east, y left or north, z up (REP-103); origin: that "
      "of the site"};
  if (const libmap::Pose* pose = manifest.find_transform(site_from_map_name))
    notes.push_back(std::string(site_from_map_name) +
                    " (x, y, z, roll, pitch, yaw; m, degrees): " + transform_text(*pose));
  if (const auto& geo = manifest.georeference)
    notes.push_back(fmt::format("georeference: offset {} m, CRS {}", fmt::join(geo->origin_m, " "),
                                geo->crs_wkt));
  return notes;
}

libmap::TexturedMesh read_visual(const fs::path& file) {
  libmap::TexturedMesh model;
  if (libmap::is_textured_format(file)) model = libmap::read_textured_mesh(file);
  if (!model.has_texture()) model.mesh = libmap::read_mesh(file).mesh;
  return model;
}

// One model for the site, or one for each of its tiles.
std::vector<libmap::WorldModel> write_models(const fs::path& folder,
                                             const WorldCommandOptions& options,
                                             const libmap::WorldScores& scores,
                                             libmap::WorldReport& report) {
  const std::vector<fs::path> files = libmap::mesh_tiles(options.site);
  std::optional<libmap::MeshTileIndex> tiles;
  if (fs::is_directory(options.site)) tiles.emplace(files);
  const double margin_m = 2 * options.world.ball_radius_m + 4 * options.world.field.cell_size_m;
  std::vector<libmap::WorldModel> models;
  for (std::size_t n = 0; n < files.size(); ++n) {
    libmap::WorldModelInput input{.name = tiles ? files[n].stem().string() : "site",
                                  .visual = read_visual(files[n]),
                                  .surface = {}};
    input.surface = tiles ? tiles->with_margin(n, margin_m).mesh : input.visual.mesh;
    models.push_back(libmap::write_world_model(folder, input, scores, options.world, report));
  }
  return models;
}

void write_world(const WorldCommandOptions& options, Run& run) {
  libmap::WorldScene scene;
  scene.name = fs::path(without_trailing_slash(options.output)).stem().string();
  in_file(options.output, [&] { libmap::require_world_name(scene.name, "name"); });
  libmap::gravity_of(options.world.gravity);
  const auto names = libmap::world_file_names();
  run.claim_output_tree(options.output, names, {options.site, options.map, options.footholds});
  scene.options = options.world;
  copy_frame(options.site, run);
  const libmap::WorldScores scores = read_scores(options.map, run);
  scene.footholds = read_footholds(options.footholds, run);
  if (!options.rig.empty()) scene.rig = read_world_rig(options, run);
  scene.notes = notes_of(run.manifest());
  run.add_input(options.site);
  run.write_output_tree(options.output, names, [&](const fs::path& folder) {
    libmap::WorldReport report;
    in_file(options.site, [&] {
      scene.models = write_models(folder, options, scores, report);
      libmap::write_world(folder, scene);
    });
    if (2 * report.score_points < scores.points.size())
      throw libmap::Error("the map and the mesh are not of one site, or their frames differ",
                          {.file = options.map,
                           .field = "points on the surface",
                           .value = std::to_string(report.score_points),
                           .bound = fmt::format(">= half of {}", scores.points.size())});
    run.add_results({{"models", scene.models.size()}, {"footholds", scene.footholds.size()}});
    run.add_results(libmap::described(report));
    run.info(
        "{} of {} triangles for collision, deviation {:.3g} mm; height field: deviation {:.3g} mm, "
        "{} balls in place of missing cells",
        report.collision_triangles, report.visual_triangles, 1e3 * report.collision_deviation_m,
        1e3 * report.field_deviation_m, report.balls);
  });
}

}  // namespace

bool graspmap_tools::is_world_path(const std::string& path) {
  return fs::path(without_trailing_slash(path)).extension() == ".world";
}

int graspmap_tools::convert_world(int argc, char** argv) {
  WorldCommandOptions options;
  Command command("convert", "With -o OUT.world: writes a site as a world for robot simulators.");
  command.input("SITE", options.site, "mesh of the site (.ply .obj .glb ...), or folder of tiles");
  command.output(options.output,
                 "folder OUT.world with SDF (Gazebo, CoppeliaSim), MJCF (MuJoCo), URDF (Bullet)");
  command.option("--map", "MAP", options.map, "graspability map of the site, displayed on it");
  command.option("--footholds", "FOOTHOLDS", options.footholds, "footholds, displayed as markers");
  command.option("--rig", "FILE|NAME", options.rig, "camera rig of a robot, added as sensors");
  command.parameters().add(
      "rig_pose", options.rig_pose,
      "pose of the robot's body in the site's frame: X,Y,Z,ROLL,PITCH,YAW in m "
      "and degrees; auto: 0.25 m above the middle of the site");
  bind(command.parameters(), options.world);
  return command.run(argc, argv, [&](Run& run) { write_world(options, run); });
}
