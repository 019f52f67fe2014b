#include "tools/extract_bundler.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/parallel.h"
#include "libmap/scan/bundler_io.h"
#include "libmap/scan/image_codec.h"
#include "libmap/scan/image_sharpness.h"
#include "libmap/scan/pinhole_image.h"
#include "tools/placement.h"
#include "tools/scan_poses.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

// So many frames are in memory at a time.
constexpr std::size_t batch_size = 8;

const std::vector<std::string>& folder_names() {
  static const std::vector<std::string> names = {"bundle.out", "images", "list.txt"};
  return names;
}

// One camera of one frame.
struct Picture {
  int node = 0;
  std::size_t camera = 0;
  libmap::Pose world_from_camera = libmap::Pose::Identity();
  double sharpness = 0.0;
};

struct FrameResult {
  std::vector<Picture> pictures{};
  std::optional<libmap::Error> error{};
};

std::vector<libmap::CameraView> read_views(const libmap::ScanSource& scan, int node) {
  const libmap::RgbdFrame frame = scan.read_frame(node, {.color = true, .depth = false});
  const std::string name = "node " + std::to_string(node);
  if (frame.color.empty())
    throw libmap::Error("it has no colour image", {.file = scan.path().string(), .field = name});
  if (frame.cameras.empty())
    throw libmap::Error("it has no calibration", {.file = scan.path().string(), .field = name});
  return libmap::camera_views(frame);
}

FrameResult find_pictures(const libmap::ScanSource& scan, const libmap::TrajectoryPose& pose,
                          const libmap::Pose& world_from_map) {
  FrameResult result;
  try {
    const std::vector<libmap::CameraView> views = read_views(scan, pose.node);
    for (std::size_t c = 0; c < views.size(); ++c) {
      libmap::centered_pinhole(views[c].color_camera);  // throws where there is none
      result.pictures.push_back(
          {pose.node, c,
           world_from_map * pose.world_from_base * views[c].color_camera.base_from_camera,
           libmap::image_sharpness(views[c].color)});
    }
  } catch (const libmap::Error& error) {
    result.pictures.clear();
    result.error = error;
  }
  return result;
}

std::vector<Picture> find_pictures(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                                   const libmap::Pose& world_from_map, bool strict, Run& run) {
  std::vector<Picture> pictures;
  run.progress().begin("pictures", poses.size());
  for (std::size_t first = 0; first < poses.size(); first += batch_size) {
    std::vector<FrameResult> batch(std::min(batch_size, poses.size() - first));
    libmap::parallel_for(batch.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n)
        batch[n] = find_pictures(scan, poses[first + n], world_from_map);
    });
    for (const FrameResult& result : batch) {
      if (result.error && strict) throw libmap::Error(*result.error);
      if (result.error) run.warn(std::string(result.error->what()) + "; its picture is left out");
      pictures.insert(pictures.end(), result.pictures.begin(), result.pictures.end());
    }
    run.progress().advance(batch.size());
  }
  run.progress().end();
  if (pictures.empty())
    throw libmap::Error("no frame has a pose, a calibration and a colour image",
                        {.file = scan.path().string()});
  return pictures;
}

std::vector<Picture> selected(const std::vector<Picture>& pictures, const BundlerOptions& options) {
  std::vector<libmap::Pose> poses;
  std::vector<double> qualities;
  for (const Picture& picture : pictures) {
    poses.push_back(picture.world_from_camera);
    qualities.push_back(options.keep == PicturePreference::sharpest ? picture.sharpness : 0.0);
  }
  std::vector<Picture> kept;
  for (const std::size_t n : libmap::select_views(poses, qualities, options.selection))
    kept.push_back(pictures[n]);
  return kept;
}

std::string image_name(const Picture& picture) {
  return fmt::format("images/{:06}{}.jpg", picture.node,
                     picture.camera == 0 ? "" : "_" + std::to_string(picture.camera));
}

// Writes the image, unless `folder` is empty.
libmap::BundlerView write_picture(const libmap::ScanSource& scan, const Picture& picture,
                                  const fs::path& folder) {
  const libmap::CameraView view = read_views(scan, picture.node)[picture.camera];
  libmap::BundlerView written{image_name(picture), libmap::centered_pinhole(view.color_camera),
                              picture.world_from_camera};
  if (!folder.empty())
    libmap::write_text(folder / written.image, libmap::encode_jpeg(libmap::resample_image(
                                                   view.color, view.color_camera, written.camera)));
  return written;
}

}  // namespace

void add_options(Command& command, BundlerOptions& options) {
  command.option("--bundler", "DIR", options.folder,
                 "write cameras and pictures as Bundler v0.3 for MeshLab's registered rasters: "
                 "bundle.out, list.txt, images");
  add_poses_option(command, options.poses);
  command.option("--transform", "X,Y,Z,ROLL,PITCH,YAW|FILE", options.transform,
                 "with --bundler: carries the poses into the frame of a mesh, e.g. what crop wrote "
                 "as *.site_from_map.txt");
  bind(command.parameters(), options.selection);
  command.parameters().add(
      "keep", options.keep,
      {{"sharpest", PicturePreference::sharpest}, {"first", PicturePreference::first}},
      "which one of pictures that look the same way from one place is kept");
}

void claim_bundler_folder(const BundlerOptions& options, const std::string& scan, Run& run) {
  parse_transform(options.transform, "--transform");
  std::vector<std::string> inputs = scan_inputs(scan, options.poses);
  inputs.push_back(options.transform);
  run.claim_output_tree(options.folder, folder_names(), inputs);
}

void write_bundler_folder(BundlerOptions& options, const libmap::ScanSource& scan, bool strict,
                          Run& run) {
  const libmap::Trajectory poses = find_poses(scan, options.poses, strict, run);
  const libmap::Pose world_from_map = parse_transform(options.transform, "--transform");
  const std::vector<Picture> all = find_pictures(scan, poses, world_from_map, strict, run);
  const std::vector<Picture> kept = selected(all, options);
  run.say(fmt::format("{} of {} pictures kept", kept.size(), all.size()));
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("transform", options.transform);
  manifest.frame = "poses";
  manifest.transforms.emplace_back("world_from_map", world_from_map);
  manifest.results.emplace_back("pictures", static_cast<std::int64_t>(all.size()));
  manifest.results.emplace_back("kept_pictures", static_cast<std::int64_t>(kept.size()));
  run.write_output_tree(options.folder, folder_names(), [&](const fs::path& folder) {
    if (!folder.empty()) fs::create_directory(folder / "images");
    std::vector<libmap::BundlerView> views(kept.size());
    libmap::parallel_for(kept.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t n = begin; n < end; ++n) views[n] = write_picture(scan, kept[n], folder);
    });
    if (folder.empty()) return;
    libmap::write_text(folder / "bundle.out", libmap::to_bundle_text(views));
    libmap::write_text(folder / "list.txt", libmap::to_bundler_list(views));
  });
}

}  // namespace graspmap_tools
