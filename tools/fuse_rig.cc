// graspmap fuse RIG_FOLDER: fuses the images of a camera rig into one cloud in the robot's frame.
#include "libmap/core/data_folder.h"
#include "libmap/fusion/panorama.h"
#include "libmap/io/cloud_io.h"
#include "libmap/scan/rig_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/option_values.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libmap::SynchronizedSet;
using State = libmap::SynchronizedSet::Camera::State;

struct PanoramaCommandOptions {
  std::string folder;
  std::string output;
  std::string rig;
  std::string stamp = "fullest";
  double tolerance_s = 0.02;
  bool strict = false;
  libmap::PanoramaOptions panorama;
};

void bind(libmap::ParameterTable& table, PanoramaCommandOptions& options) {
  table.add("stamp_s", options.stamp,
            "time stamp of the image set to fuse, s; fullest: set with images of most cameras");
  table.add("tolerance_s", options.tolerance_s, libmap::not_negative,
            "maximum difference between the time stamps of an image and its image set, s");
  table.add("strict", options.strict, "fail if a camera has no usable image, instead of a warning");
  bind(table, options.panorama);
}

// Message about a camera without an image in the set.
std::string absence(const std::string& name, const SynchronizedSet::Camera& camera) {
  if (camera.state == State::missing) return name + ": has no image";
  return fmt::format("{}: the nearest image is {:.1f} ms {}", name, std::abs(camera.offset_s) * 1e3,
                     camera.offset_s > 0 ? "late" : "early");
}

void report_absent(const libmap::CameraRig& rig, const SynchronizedSet& set,
                   const PanoramaCommandOptions& options, Run& run) {
  if (set.seen() == 0)
    throw libmap::Error("no camera has an image near this time",
                        {.file = options.folder,
                         .field = "--stamp",
                         .value = libmap::to_text(set.stamp_s),
                         .bound = "within --tolerance of an image"});
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    if (set.cameras[n].state == State::seen) continue;
    const std::string line = absence(rig.cameras[n].name, set.cameras[n]);
    if (options.strict) throw libmap::Error(line, {.file = options.folder});
    run.warn(line);
  }
}

void add_rig_results(const libmap::CameraRig& rig, const SynchronizedSet& set,
                     const libmap::PanoramaResult& result,
                     const std::vector<libmap::PanoramaView>& views, Run& run) {
  run.manifest().frame = "robot";
  run.add_results({{"stamp_s", set.stamp_s},
                   {"cameras", rig.cameras.size()},
                   {"cameras_seen", views.size()},
                   {"points", result.cloud.size()}});
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    const SynchronizedSet::Camera& camera = set.cameras[n];
    const std::string& name = rig.cameras[n].name;
    const char* state = camera.state == State::seen   ? "seen"
                        : camera.state == State::late ? "outside the tolerance"
                                                      : "missing";
    run.add_results({{name + ".state", state}});
    if (camera.state != State::missing) run.add_results({{name + ".offset_s", camera.offset_s}});
  }
  for (std::size_t n = 0; n < views.size(); ++n) {
    const std::string& name = views[n].name;
    run.manifest().transforms.emplace_back("robot_from_" + name, views[n].camera.base_from_camera);
    libmap::ResultTable table;
    table.append(name + ".", libmap::described(result.views[n]));
    run.add_results(table);
  }
}

std::vector<libmap::PanoramaView> read_views(const libmap::CameraRig& rig,
                                             const std::vector<libmap::RigImage>& images,
                                             const SynchronizedSet& set, bool strict, Run& run) {
  std::vector<libmap::PanoramaView> views;
  for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
    if (set.cameras[n].state != State::seen) continue;
    const libmap::RigCamera& camera = rig.cameras[n];
    const libmap::RigImage& image = images[set.cameras[n].image];
    libmap::DepthImage depth;
    try {
      depth = libmap::read_rig_depth(image, camera);
    } catch (const libmap::Error& error) {
      // Only the camera of a broken image is skipped.
      if (strict) throw;
      run.warn(std::string(error.what()) + "; camera " + camera.name + " is skipped");
      continue;
    }
    run.add_input(image.file);
    views.push_back({camera.name, static_cast<int>(n), camera.camera, std::move(depth),
                     camera.near_m, camera.far_m});
  }
  return views;
}

void panorama(PanoramaCommandOptions& options, Run& run) {
  const std::optional<double> stamp = parse_number_or("fullest", options.stamp, "not a time",
                                                      "--stamp", "a number of seconds, or fullest");
  libmap::require_cloud_format(options.output);
  run.claim_output(options.output);
  const fs::path rig_file = options.rig.empty() ? fs::path(options.folder) / libmap::rig_file_name
                            : fs::exists(options.rig) ? fs::path(options.rig)
                                                      : libmap::find_data_file("rigs", options.rig);
  if (!fs::is_directory(options.folder))
    throw libmap::Error(fs::exists(options.folder) ? "is not a folder" : "no such folder",
                        {.file = options.folder});
  const libmap::CameraRig rig = libmap::read_rig(rig_file);
  run.add_input(rig_file);
  const std::vector<libmap::RigImage> images = libmap::list_rig_images(options.folder, rig);
  const std::size_t cameras = rig.cameras.size();
  const SynchronizedSet set =
      stamp ? libmap::synchronized_set_at(images, cameras, *stamp, options.tolerance_s)
            : libmap::fullest_synchronized_set(images, cameras, options.tolerance_s);
  report_absent(rig, set, options, run);
  const std::vector<libmap::PanoramaView> views =
      run.timed("read", [&] { return read_views(rig, images, set, options.strict, run); });
  const libmap::PanoramaResult result =
      run.timed("project", [&] { return libmap::make_panorama(views, options.panorama); });
  if (views.empty())
    throw libmap::Error("no image of the set can be read", {.file = options.folder});
  if (result.cloud.empty()) run.warn("no camera has measurements within the depth limits");
  add_rig_results(rig, set, result, views, run);
  copy_transforms(options.folder, run);
  run.info("{} points from {} of {} cameras at {} s", result.cloud.size(), views.size(), cameras,
           libmap::to_text(set.stamp_s));
  run.write_output(options.output, [&](const fs::path& temporary) {
    libmap::write_cloud(temporary, result.cloud);
  });
}

}  // namespace

int graspmap_tools::fuse_rig(int argc, char** argv) {
  PanoramaCommandOptions options;
  Command command("fuse",
                  "With the folder of a camera rig: fuses depth images of the same time into one "
                  "cloud in the robot's frame.");
  command.input("RIG_FOLDER", options.folder,
                "folder of rig.yaml and depth images: CAMERA/STAMP.png, or as in images.csv");
  command.output(options.output, "cloud (.pcd, .ply, .vtp, .csv)");
  command.option("--rig", "FILE|NAME", options.rig,
                 "rig file, or a rig of the toolkit, e.g. scar-e; default: RIG_FOLDER/rig.yaml");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { panorama(options, run); });
}
