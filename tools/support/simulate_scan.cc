// graspmap simulate scan: a scan of a mesh by a depth camera carried by hand.
#include "libmap/image/camera_io.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/simulate/scan_simulation.h"
#include "libmap/trajectory/trajectory_error.h"
#include "tools/support/command_line.h"
#include "tools/support/option_values.h"
#include "tools/support/usages.h"

using namespace graspmap_tools;

namespace {

struct SimulateScanOptions {
  std::string mesh;
  std::string output;
  std::string camera;
  std::string target = "auto";
  libmap::ScanSimulationOptions simulation;
  libmap::RtabmapWriterOptions writer;
};

void bind(libmap::ParameterTable& table, SimulateScanOptions& options) {
  libmap::ScanSimulationOptions& simulation = options.simulation;
  table.add("camera", options.camera,
            "calibration file of the camera (.yaml); empty: a Kinect v2, 512 x 424 pixels");
  bind(table, simulation.trajectory);
  table.add("target", options.target,
            "what is looked at, X,Y,Z in the mesh's frame; auto: the site's center");
  bind(table, simulation.depth);
  table.add("texture", simulation.texture, libmap::texture_source_names(),
            "the mesh's own colors, or rock; auto: rock where the mesh has but one color");
  bind(table, simulation.photo);
  bind(table, simulation.faults);
  bind(table, simulation.odometry);
  bind(table, simulation.closures);
  table.add("depth_format", options.writer.depth,
            {{"rvl", libmap::DepthFormat::rvl},
             {"png", libmap::DepthFormat::png16},
             {"float", libmap::DepthFormat::float_png}},
            "how depth is stored; float keeps fractions of a millimeter");
  table.add("color_format", options.writer.color,
            {{"jpeg", libmap::ImageFormat::jpeg}, {"png", libmap::ImageFormat::png}},
            "how color is stored");
  table.add("seed", simulation.seed, libmap::not_negative, "of all that is random");
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
  run.say("{} frames along {:.1f} m, {:.0f} % of the pixels measured, {} closures{}",
          result.graph.nodes.size(), result.path_length_m,
          100.0 * static_cast<double>(result.measured_pixels) / static_cast<double>(result.pixels),
          closures, drift);
  if (result.empty_frames > 0) run.warn("{} frames see nothing within range", result.empty_frames);
}

void write_scan(const libmap::TriangleMesh& mesh, const SimulateScanOptions& options,
                const std::filesystem::path& path, Run& run) {
  libmap::RtabmapWriter writer(path, options.writer);
  const libmap::ScanSimulationResult result = libmap::simulate_scan(
      mesh, options.simulation,
      [&](const libmap::GraphNode& node, const libmap::RgbdFrame& frame) {
        writer.add_node(node, frame);
      },
      run.progress());
  for (const libmap::PoseLink& link : result.graph.links) writer.add_link(link);
  writer.finish();
  add_results(result, run);
}

void simulate(SimulateScanOptions& options, Run& run) {
  libmap::ScanSimulationOptions& simulation = options.simulation;
  if (options.target != "auto")
    simulation.trajectory.target = parse_vector(options.target, "--target");
  simulation.depth.check();
  run.claim_output(options.output, {options.mesh, options.camera});
  if (!options.output.ends_with(".db"))
    throw libmap::Error("a scan is written as a database",
                        {.file = options.output, .bound = "a name.db"});
  if (!options.camera.empty()) simulation.camera = libmap::read_camera(options.camera).camera;
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  run.add_input(options.mesh);
  if (!options.camera.empty()) run.add_input(options.camera);
  run.manifest().frame = "mesh";
  in_file(options.mesh, [&] {
    run.write_output(options.output,
                     [&](const auto& temporary) { write_scan(mesh, options, temporary, run); });
  });
}

}  // namespace

int graspmap_tools::simulate_scan(int argc, char** argv) {
  SimulateScanOptions options;
  Command command("simulate scan", "A scan of a mesh by a depth camera carried by hand.");
  command.input("MESH", options.mesh, "what is scanned (.ply, .obj, .stl, .off, .glb)");
  command.output(options.output, "RTAB-Map database with true poses (.db)");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
