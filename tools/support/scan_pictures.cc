#include "tools/support/scan_pictures.h"

#include "libmap/core/parallel.h"
#include "libmap/image/color_image.h"
#include "libmap/image/image_codec.h"
#include "libmap/scan/picture_file.h"
#include "tools/support/placement.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

// So many frames are in memory at a time.
constexpr std::size_t batch_size = 8;

const std::vector<std::string> bundler_names = {"bundle.out", "images", "list.txt"};
const std::vector<std::string> colmap_names = {"images", "sparse"};

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

FrameResult find_pictures(const libmap::ScanSource& scan, const libmap::TrajectoryPose& pose,
                          const libmap::Pose& world_from_map, const PictureOptions& options) {
  FrameResult result;
  try {
    const std::vector<libmap::CameraView> views =
        libmap::read_pictures(scan, pose.node, {.color = true, .depth = false});
    for (std::size_t c = 0; c < views.size(); ++c) {
      // These throw where there is no such camera.
      if (!options.bundler.empty()) libmap::centered_pinhole(views[c].color_camera);
      if (!options.colmap.empty()) libmap::to_colmap(views[c].color_camera);
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
                                   const libmap::Pose& world_from_map,
                                   const PictureOptions& options, bool strict, Run& run) {
  std::vector<Picture> pictures;
  run.progress().begin("pictures", poses.size());
  for (std::size_t first = 0; first < poses.size(); first += batch_size) {
    std::vector<FrameResult> batch(std::min(batch_size, poses.size() - first));
    libmap::parallel_each(batch.size(), [&](std::size_t n) {
      batch[n] = find_pictures(scan, poses[first + n], world_from_map, options);
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
    throw libmap::Error("no frame has a pose, a calibration and a color image",
                        {.file = scan.path().string()});
  return pictures;
}

std::vector<Picture> selected(const std::vector<Picture>& pictures, const PictureOptions& options) {
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

// Writes the image, unless `folder` is empty.
libmap::BundlerView write_picture(const libmap::ScanSource& scan, const Picture& picture,
                                  const fs::path& folder) {
  const libmap::CameraView view =
      libmap::read_pictures(scan, picture.node, {.color = true, .depth = false})[picture.camera];
  libmap::BundlerView written{
      "images/" + libmap::picture_name(picture.node, picture.camera, ".jpg"),
      libmap::centered_pinhole(view.color_camera), picture.world_from_camera};
  if (!folder.empty())
    libmap::write_text(folder / written.image, libmap::encode_jpeg(libmap::resample_image(
                                                   view.color, view.color_camera, written.camera)));
  return written;
}

void write_bundler(const PictureOptions& options, const std::vector<Picture>& all,
                   const libmap::ScanSource& scan, Run& run) {
  const std::vector<Picture> kept = selected(all, options);
  run.say("{} of {} pictures kept", kept.size(), all.size());
  run.add_results({{"kept_pictures", kept.size()}});
  run.write_output_tree(options.bundler, bundler_names, [&](const fs::path& folder) {
    if (!folder.empty()) fs::create_directory(folder / "images");
    std::vector<libmap::BundlerView> views(kept.size());
    libmap::parallel_each(kept.size(),
                          [&](std::size_t n) { views[n] = write_picture(scan, kept[n], folder); });
    if (folder.empty()) return;
    libmap::write_text(folder / "bundle.out", libmap::to_bundle_text(views));
    libmap::write_text(folder / "list.txt", libmap::to_bundler_list(views));
  });
}

struct ColmapPicture {
  libmap::CameraView view{};
  std::string name{};
};

// Reads the picture with its depth; writes the image, unless `folder` is empty.
ColmapPicture copy_picture(const libmap::ScanSource& scan, const Picture& picture,
                           const fs::path& folder) {
  std::vector<libmap::CameraView> views = libmap::read_pictures(scan, picture.node, {});
  const libmap::PictureFile file = libmap::picture_file(scan, picture.node, views, picture.camera);
  if (!folder.empty()) libmap::write_text(folder / "images" / file.name, file.bytes);
  return {std::move(views[picture.camera]), file.name};
}

void write_colmap(const PictureOptions& options, const std::vector<Picture>& pictures,
                  const libmap::ScanSource& scan, Run& run) {
  run.write_output_tree(options.colmap, colmap_names, [&](const fs::path& folder) {
    if (!folder.empty()) {
      fs::create_directory(folder / "images");
      fs::create_directory(folder / "sparse");
    }
    libmap::ColmapBuilder builder(options.points);
    for (std::size_t first = 0; first < pictures.size(); first += batch_size) {
      std::vector<ColmapPicture> batch(std::min(batch_size, pictures.size() - first));
      libmap::parallel_each(batch.size(), [&](std::size_t n) {
        batch[n] = copy_picture(scan, pictures[first + n], folder);
      });
      for (std::size_t n = 0; n < batch.size(); ++n)
        builder.add_image(batch[n].name, batch[n].view, pictures[first + n].world_from_camera);
    }
    const libmap::ColmapModel& model = builder.model();
    std::size_t observations = 0;
    for (const auto& [id, image] : model.images) observations += image.observations.size();
    run.say("{} pictures of {} cameras, {} points, {} times observed", model.images.size(),
            model.cameras.size(), model.points.size(), observations);
    run.add_results({{"cameras", model.cameras.size()},
                     {"points", model.points.size()},
                     {"observations", observations}});
    if (!folder.empty()) libmap::write_colmap_model(folder / "sparse", model);
  });
}

}  // namespace

void add_options(Command& command, PictureOptions& options) {
  command.option("--bundler", "DIR", options.bundler,
                 "write cameras and pictures as Bundler v0.3 for MeshLab's registered rasters: "
                 "bundle.out, list.txt, images");
  command.option("--colmap", "DIR", options.colmap,
                 "write cameras, all pictures and points as a model of COLMAP: sparse/cameras.txt, "
                 "images.txt, points3D.txt; images");
  add_poses_option(command, options.poses);
  command.option("--transform", "X,Y,Z,ROLL,PITCH,YAW|FILE", options.transform,
                 "with --bundler, --colmap: carries the poses into the frame of a mesh, e.g. what "
                 "crop wrote as *.site_from_map.txt");
  bind(command.parameters(), options.selection);
  command.parameters().add(
      "keep", options.keep,
      {{"sharpest", PicturePreference::sharpest}, {"first", PicturePreference::first}},
      "with --bundler: which one of pictures that look the same way from one place is kept");
  bind(command.parameters(), options.points);
}

void claim_picture_folders(const PictureOptions& options, const std::string& scan, Run& run) {
  parse_transform(options.transform, "--transform");
  std::vector<std::string> inputs = scan_inputs(scan, options.poses);
  inputs.push_back(options.transform);
  if (!options.bundler.empty()) run.claim_output_tree(options.bundler, bundler_names, inputs);
  if (!options.colmap.empty()) run.claim_output_tree(options.colmap, colmap_names, inputs);
}

void write_picture_folders(PictureOptions& options, const libmap::ScanSource& scan, bool strict,
                           Run& run) {
  const libmap::Trajectory poses = find_poses(scan, options.poses, strict, run);
  const libmap::Pose world_from_map = parse_transform(options.transform, "--transform");
  const std::vector<Picture> pictures =
      find_pictures(scan, poses, world_from_map, options, strict, run);
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("transform", options.transform);
  manifest.frame = "poses";
  manifest.transforms.emplace_back("world_from_map", world_from_map);
  run.add_results({{"pictures", pictures.size()}});
  const libmap::Manifest start = manifest;
  // First: it needs the depth as well, so that what is broken shows before anything is written.
  if (!options.colmap.empty()) write_colmap(options, pictures, scan, run);
  manifest = start;
  if (!options.bundler.empty()) write_bundler(options, pictures, scan, run);
}

}  // namespace graspmap_tools
