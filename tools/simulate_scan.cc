// graspmap simulate scan: simulates a handheld scan of a mesh or a large terrain.
#include "libmap/camera/camera_io.h"
#include "libmap/camera/sensor_model.h"
#include "libmap/core/data_folder.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/cloud_tiles.h"
#include "libmap/io/mesh_io.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/simulate/scan_simulation.h"
#include "tools/support/command_line.h"
#include "tools/support/option_values.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct SimulateScanOptions {
  std::string scene;  // mesh, cloud or folder of clouds
  std::string output;
  std::string camera;
  std::string target = "auto";
  std::string sensor = "auto";
  std::string trajectory;
  libmap::ScanSimulationOptions simulation;
  libmap::RtabmapWriterOptions writer;
};

constexpr std::size_t spool_buffer_bytes = std::size_t{32} << 20U;

void bind(libmap::ParameterTable& table, SimulateScanOptions& options) {
  libmap::ScanSimulationOptions& simulation = options.simulation;
  table.add("sensor", options.sensor,
            "depth camera: a name in data/sensors or a file, from which camera, noise, range, "
            "timing and faults are taken unless options set them; auto: defaults of the options");
  table.add("camera", options.camera,
            "calibration file of the camera (.yaml), or a camera of the toolkit: realsense-d435, "
            "ipad-lidar; empty: a Kinect v2, 512 x 424 pixels");
  table.add("trajectory", options.trajectory,
            "pose file of the camera's body (.tum, .kitti, .g2o, .toro) in the scene's frame, one "
            "pose per frame; empty: a generated path (--path)");
  bind(table, simulation.trajectory);
  table.add("target", options.target,
            "point X,Y,Z that the camera faces, in the mesh's frame, m; auto: the site's center");
  bind(table, simulation.depth);
  table.add("texture", simulation.texture,
            {{"auto", libmap::TextureSource::automatic},
             {"mesh", libmap::TextureSource::mesh},
             {"rock", libmap::TextureSource::rock}},
            "source of the colors; mesh: colors of the mesh; rock: generated rock texture; auto: "
            "rock if the mesh has a single color, else mesh");
  bind(table, simulation.photo);
  bind(table, simulation.faults);
  bind(table, simulation.events);
  bind(table, simulation.odometry);
  bind(table, simulation.closures);
  table.add("depth_format", options.writer.depth,
            {{"rvl", libmap::DepthFormat::rvl},
             {"png", libmap::DepthFormat::png16},
             {"float", libmap::DepthFormat::float_png}},
            "format of depth images; rvl: RVL of whole millimeters; png: 16-bit PNG of whole "
            "millimeters; float: PNG of 32-bit floats, m");
  table.add("color_format", options.writer.color,
            {{"jpeg", libmap::ImageFormat::jpeg}, {"png", libmap::ImageFormat::png}},
            "format of color images; jpeg: lossy; png: lossless");
  table.add("seed", simulation.seed, libmap::not_negative, "random seed of the scan");
  table.add("rock_seed", simulation.rock_seed, libmap::not_negative,
            "random seed of the rock texture, equal for all scans of one ground; 0: as --seed");
}

void add_results(const libmap::ScanSimulationResult& result, Run& run) {
  const std::size_t closures = result.graph.links.size() + 1 - result.graph.nodes.size();
  run.add_results({{"frames", result.graph.nodes.size()},
                   {"links", result.graph.links.size()},
                   {"closures", closures},
                   {"pixels", result.pixels},
                   {"measured_pixels", result.measured_pixels},
                   {"edge_pixels", result.edge_pixels},
                   {"flying_pixels", result.flying_pixels},
                   {"empty_frames", result.empty_frames},
                   {"path_length_m", result.path_length_m}});
  std::string drift;
  if (result.graph.nodes.size() >= 3) {
    const libmap::TrajectoryError error = libmap::absolute_trajectory_error(
        trajectory_of(result.graph, libmap::PoseSource::odometry),
        trajectory_of(result.graph, libmap::PoseSource::ground_truth));
    run.add_results({{"odometry_rmse_m", error.rmse_m},
                     {"odometry_rotation_error_deg", error.mean_rotation_deg}});
    drift = fmt::format(", odometry {:.1f} mm off", 1e3 * error.rmse_m);
  }
  run.info("{} frames along {:.1f} m, {:.0f} % of the pixels measured, {} closures{}",
           result.graph.nodes.size(), result.path_length_m,
           100.0 * static_cast<double>(result.measured_pixels) / static_cast<double>(result.pixels),
           closures, drift);
  if (result.empty_frames > 0) run.warn("{} frames have no depth in range", result.empty_frames);
}

libmap::Trajectory given_poses(const SimulateScanOptions& options) {
  if (options.trajectory.empty()) return {};
  const double frame_interval_s = options.simulation.trajectory.frame_interval_s;
  libmap::CameraTrajectoryOptions path = options.simulation.trajectory;
  path.frame_interval_s = libmap::CameraTrajectoryOptions{}.frame_interval_s;
  const std::string reason = "cannot be combined with --trajectory, which has the camera's poses";
  reject_changed(path, libmap::bind, reason);
  reject_given({{"--target", options.target != "auto"}}, reason);
  return in_file(options.trajectory, [&] {
    const libmap::TrajectoryFile file = libmap::read_trajectory(options.trajectory);
    if (file.of_cameras)
      throw libmap::Error("contains poses of cameras, but poses of the camera's body are required");
    return libmap::assign_nodes_and_stamps(file.poses, frame_interval_s);
  });
}

void add_inputs(const std::vector<fs::path>& scene, const SimulateScanOptions& options, Run& run) {
  for (const fs::path& input : scene) run.add_input(input);
  for (const std::string& input : {options.camera, options.trajectory})
    if (!input.empty()) run.add_input(input);
}

void write_scan(const libmap::ScanScene& scene, const SimulateScanOptions& options,
                const fs::path& path, Run& run) {
  libmap::RtabmapWriter writer(path, options.writer);
  const libmap::ScanSimulationResult result = run.timed("frames", [&] {
    return libmap::simulate_scan(
        scene, options.simulation,
        [&](const libmap::GraphNode& node, const libmap::RgbdFrame& frame) {
          writer.add_node(node, frame);
        },
        run.progress());
  });
  for (const libmap::PoseLink& link : result.graph.links) writer.add_link(link);
  writer.finish();
  add_results(result, run);
}

void scan_mesh(const SimulateScanOptions& options, const libmap::Trajectory& poses, Run& run) {
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.scene).mesh; });
  add_inputs({options.scene}, options, run);
  run.manifest().frame = "mesh";
  in_file(options.scene, [&] {
    const libmap::ScanScene scene = libmap::scene_of(mesh, options.simulation, poses);
    run.write_output(options.output,
                     [&](const auto& temporary) { write_scan(scene, options, temporary, run); });
  });
}

// Scans a terrain. Its points are in an unnamed file in the output's folder, so that memory does
// not depend on the size of the terrain.
void scan_terrain(const SimulateScanOptions& options, const libmap::Trajectory& poses, Run& run) {
  if (options.simulation.texture == libmap::TextureSource::mesh)
    throw libmap::Error("requires a mesh as scene, because clouds have no surface colors",
                        {.field = "--texture", .value = "mesh", .bound = "auto or rock"});
  if (poses.empty() && options.simulation.trajectory.path == libmap::CameraPath::loops)
    throw libmap::Error("requires a mesh as scene",
                        {.field = "--path", .value = "loops", .bound = "auto or serpentine"});
  const libmap::ScanEvents& events = options.simulation.events;
  reject_given({{"--walker-first-frame", events.walker_first_frame > 0},
                {"--stone-moved-frame", events.stone_moved_frame > 0},
                {"--ceiling-first-frame", events.ceiling_first_frame > 0},
                {"--multipath", options.simulation.faults.depth.multipath > 0.0}},
               "requires a mesh as scene");
  const libmap::TileStream stream(libmap::cloud_tiles(options.scene));
  add_inputs(stream.tiles(), options, run);
  run.manifest().frame = "terrain";
  run.write_output(options.output, [&](const fs::path& temporary) {
    libmap::GroundHeights ground;
    libmap::PointTileStore points(
        temporary.has_parent_path() ? temporary.parent_path() : fs::path("."),
        {.tile_m = libmap::GroundHeights::cell_m, .buffer_bytes = spool_buffer_bytes});
    std::size_t count = 0;
    for (const fs::path& tile : stream.tiles()) count += libmap::read_cloud_info(tile).points;
    run.progress().begin("points", count);
    run.timed("read", [&] {
      stream.for_each_block(libmap::PointStream::Need::positions,
                            [&](const libmap::PointCloud& block) {
                              ground.add(block.positions);
                              points.add(block);
                              run.progress().advance(block.size());
                            });
      points.finish();
    });
    run.progress().end();
    libmap::TerrainSurface terrain(points, ground,
                                   {.texture_seed = options.simulation.texture_seed()});
    in_file(options.scene, [&] {
      write_scan(libmap::scene_of(terrain, ground, options.simulation, poses), options, temporary,
                 run);
    });
    run.detail("{} tiles of the terrain were triangulated", terrain.tiles_made());
  });
}

void simulate(SimulateScanOptions& options, Run& run) {
  libmap::ScanSimulationOptions& simulation = options.simulation;
  if (options.target != "auto")
    simulation.trajectory.target = parse_vector(options.target, "--target");
  simulation.depth.check();
  run.claim_output(options.output, {options.scene, options.camera, options.trajectory});
  if (!options.output.ends_with(".db"))
    throw libmap::Error("scans are written as a database (.db)", {.file = options.output});
  if (!options.camera.empty()) {
    options.camera = libmap::find_data_file("cameras", options.camera).string();
    simulation.camera = libmap::read_camera(options.camera).camera;
  }
  const libmap::Trajectory poses = given_poses(options);
  if (fs::is_directory(options.scene) ||
      libmap::file_kind(options.scene) == libmap::FileKind::cloud)
    scan_terrain(options, poses, run);
  else
    scan_mesh(options, poses, run);
}

}  // namespace

int graspmap_tools::simulate_scan(int argc, char** argv) {
  SimulateScanOptions options;
  Command command("simulate scan", "Simulates a handheld depth camera on a mesh or terrain.");
  command.input("SCENE", options.scene,
                "scene to scan: a mesh (.ply, .obj, .stl, .off, .glb), or a height field as a "
                "cloud or a folder of clouds of any size (.pcd, .ply, .csv)");
  command.output(options.output, "RTAB-Map database with true poses (.db)");
  bind(command.parameters(), options);
  std::vector<std::pair<std::string, std::string>> for_refine;  // of libmap::SensorModel
  command.parameters().add_overrides("refine", for_refine);
  command.config_resolver(
      [](const std::string& name) { return libmap::find_data_file("sensors", name); });
  command.preset("sensor", libmap::sensor_file);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
