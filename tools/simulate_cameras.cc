// graspmap simulate cameras: depth images of a robot's cameras at one pose.
#include "libmap/camera/image_codec.h"
#include "libmap/camera/sensor_model.h"
#include "libmap/core/data_folder.h"
#include "libmap/io/mesh_io.h"
#include "libmap/scan/rig_io.h"
#include "libmap/simulate/robot_cameras.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct SimulateCamerasOptions {
  std::string mesh;
  std::string output;
  std::string rig = "scar-e";
  double depth_scale_m = 0.0;
  // Pose of the body in the mesh's frame.
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.25;
  bool absolute_z = false;
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double yaw_deg = 0.0;
  libmap::RobotCamerasOptions cameras;
};

void bind(libmap::ParameterTable& table, SimulateCamerasOptions& options) {
  using libmap::any_number;
  table.add("rig", options.rig, "camera rig: a robot of the toolkit, or a rig file (.yaml)");
  table.add("depth_scale_m", options.depth_scale_m, libmap::not_negative,
            "meters per unit of the written depth images; 0: as in the rig file");
  table.add("x_m", options.x_m, any_number, "x of the robot's body in the mesh's frame, m");
  table.add("y_m", options.y_m, any_number, "y of the robot's body in the mesh's frame, m");
  table.add("z_m", options.z_m, any_number, "height of the robot's body above the ground, m");
  table.add("absolute_z", options.absolute_z,
            "interpret the height of the robot's body as z in the mesh's frame");
  table.add("roll_deg", options.roll_deg, any_number, "rotation of the body about x, degrees");
  table.add("pitch_deg", options.pitch_deg, any_number,
            "rotation of the body about y, degrees; positive: nose down");
  table.add("yaw_deg", options.yaw_deg, any_number, "rotation of the body about z, degrees");
  bind(table, options.cameras);
}

libmap::CameraRig load_rig(const SimulateCamerasOptions& options, Run& run) {
  const fs::path file = libmap::find_data_file("rigs", options.rig);
  libmap::CameraRig rig = libmap::read_rig(file);
  run.add_input(file);
  if (options.depth_scale_m > 0)
    for (libmap::RigCamera& camera : rig.cameras) camera.depth_scale_m = options.depth_scale_m;
  for (const libmap::RigCamera& camera : rig.cameras) {
    // Maximum 16-bit value, because 65535 marks saturated pixels.
    constexpr double largest = 65534;
    if (std::round(camera.far_m / camera.depth_scale_m) > largest)
      throw libmap::Error("16-bit images cannot represent the range of camera " + camera.name,
                          {.file = options.depth_scale_m > 0 ? "" : file.string(),
                           .field = "depth_scale_m",
                           .value = libmap::to_text(camera.depth_scale_m),
                           .bound = ">= far_m / 65534 = " +
                                    libmap::to_text(static_cast<float>(camera.far_m / largest))});
  }
  return rig;
}

libmap::Pose body_pose(const libmap::TriangleMesh& mesh, const SimulateCamerasOptions& options) {
  const double ground =
      options.absolute_z ? 0.0 : libmap::ground_height(mesh, options.x_m, options.y_m);
  return libmap::make_pose_from_rpy({options.x_m, options.y_m, ground + options.z_m},
                                    {options.roll_deg, options.pitch_deg, options.yaw_deg});
}

// One file per camera, independent of the stamp, so that later runs replace all files.
std::string image_name(const libmap::RigCamera& camera) { return camera.name + ".png"; }

std::string images_table(const libmap::CameraRig& rig,
                         const std::vector<libmap::RobotCameraImage>& images) {
  std::string text = "camera,stamp_s,file\n";
  for (std::size_t i = 0; i < images.size(); ++i)
    text += fmt::format("{},{},{}\n", rig.cameras[i].name,
                        libmap::to_fixed_text(images[i].stamp_s, 6), image_name(rig.cameras[i]));
  return text;
}

Run::Files files_of(const libmap::CameraRig& rig,
                    const std::vector<libmap::RobotCameraImage>& images) {
  Run::Files files = {{libmap::rig_file_name, Run::text_writer(libmap::to_yaml(rig))},
                      {libmap::rig_images_file_name, Run::text_writer(images_table(rig, images))}};
  for (std::size_t i = 0; i < images.size(); ++i)
    files.emplace_back(image_name(rig.cameras[i]),
                       Run::text_writer(libmap::encode_png(images[i].depth)));
  return files;
}

void add_results(const libmap::CameraRig& rig, const std::vector<libmap::RobotCameraImage>& images,
                 Run& run) {
  std::size_t pixels = 0;
  std::size_t measured = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    pixels += images[i].depth.pixels.size();
    measured += images[i].measurement.measured;
    if (images[i].measurement.measured == 0)
      run.warn("{}: has no measurements within the depth range", rig.cameras[i].name);
  }
  run.add_results({{"cameras", images.size()}, {"pixels", pixels}, {"measured_pixels", measured}});
  run.info("{} cameras, {:.0f} % of the pixels measured", images.size(),
           100.0 * static_cast<double>(measured) / static_cast<double>(pixels));
}

void simulate(const SimulateCamerasOptions& options, Run& run) {
  run.claim_output_folder(options.output);
  if (options.cameras.sensor != "auto") run.add_input(libmap::sensor_file(options.cameras.sensor));
  const libmap::CameraRig rig = load_rig(options, run);
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  run.add_input(options.mesh);
  run.manifest().frame = "robot";
  in_file(options.mesh, [&] {
    const libmap::Pose mesh_from_robot = body_pose(mesh, options);
    run.manifest().transforms.emplace_back("mesh_from_robot", mesh_from_robot);
    // Allows looking up locations in the mesh's frame, or in that of the map before it was cropped,
    // on maps of these images.
    const libmap::Pose mesh_from_map =
        site_from_map_of(options.mesh).value_or(libmap::Pose::Identity());
    run.manifest().transforms.emplace_back(site_from_map_name,
                                           mesh_from_robot.inverse() * mesh_from_map);
    const std::vector<libmap::RobotCameraImage> images = run.timed("cameras", [&] {
      return libmap::simulate_robot_cameras(mesh, rig, mesh_from_robot, options.cameras);
    });
    add_results(rig, images, run);
    run.write_output_folder(options.output, files_of(rig, images));
  });
}

}  // namespace

int graspmap_tools::simulate_cameras(int argc, char** argv) {
  SimulateCamerasOptions options;
  Command command("simulate cameras", "Simulates a robot's depth images at one pose.");
  command.input("MESH", options.mesh, "mesh of the terrain (.ply, .obj, .stl, .off, .glb)");
  command.output(options.output, "folder of 16-bit depth images and their rig file");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { simulate(options, run); });
}
