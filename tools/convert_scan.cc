// graspmap convert SCAN -o FOLDER: writes a scan as plain files; --bundler and --colmap: writes its
// images and cameras for MeshLab and for COLMAP.
#include "libmap/bag/bag_reader.h"
#include "libmap/camera/color_image.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/parallel.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/colmap_builder.h"
#include "libmap/scan/frame_folder_writer.h"
#include "libmap/scan/image_export.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_source.h"
#include "tools/support/command_line.h"
#include "tools/support/map_tiles.h"
#include "tools/support/placement.h"
#include "tools/support/scan_poses.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

// Choice among similar images.
enum class ImagePreference { sharpest, first };

struct ImageOptions {
  std::string bundler;  // output folders; empty: not written
  std::string colmap;
  PosesOption poses;
  std::string transform;
  ImagePreference keep = ImagePreference::sharpest;
  libmap::ViewSelectionOptions selection;
  libmap::ColmapBuilderOptions points;

  bool wanted() const { return !bundler.empty() || !colmap.empty(); }
};

// Number of frames in memory at a time.
constexpr std::size_t batch_size = 8;

const std::vector<std::string> bundler_names = {"bundle.out", "images", "list.txt"};
const std::vector<std::string> colmap_names = {"images", "sparse"};

// One camera of one frame.
struct ScanImage {
  int node = 0;
  std::size_t camera = 0;
  libmap::Pose world_from_camera = libmap::Pose::Identity();
  double sharpness = 0.0;
};

struct FrameResult {
  std::vector<ScanImage> images{};
  std::optional<libmap::Error> error{};
};

FrameResult find_images(const libmap::ScanSource& scan, const libmap::TrajectoryPose& pose,
                        const libmap::Pose& world_from_map, const ImageOptions& options) {
  FrameResult result;
  try {
    const std::vector<libmap::CameraView> views =
        libmap::read_views(scan, pose.node, {.color = true, .depth = false});
    for (std::size_t c = 0; c < views.size(); ++c) {
      // Both throw for an unsupported camera.
      if (!options.bundler.empty()) libmap::centered_pinhole(views[c].color_camera);
      if (!options.colmap.empty()) libmap::to_colmap(views[c].color_camera);
      result.images.push_back(
          {pose.node, c,
           world_from_map * pose.world_from_base * views[c].color_camera.base_from_camera,
           libmap::image_sharpness(views[c].color)});
    }
  } catch (const libmap::Error& error) {
    result.images.clear();
    result.error = error;
  }
  return result;
}

std::vector<ScanImage> find_images(const libmap::ScanSource& scan, const libmap::Trajectory& poses,
                                   const libmap::Pose& world_from_map, const ImageOptions& options,
                                   bool strict, Run& run) {
  std::vector<ScanImage> images;
  run.progress().begin("images", poses.size());
  for (std::size_t first = 0; first < poses.size(); first += batch_size) {
    std::vector<FrameResult> batch(std::min(batch_size, poses.size() - first));
    libmap::parallel_each(batch.size(), [&](std::size_t n) {
      batch[n] = find_images(scan, poses[first + n], world_from_map, options);
    });
    for (const FrameResult& result : batch) {
      if (result.error && strict) throw libmap::Error(*result.error);
      if (result.error) run.warn(std::string(result.error->what()) + "; the image is skipped");
      images.insert(images.end(), result.images.begin(), result.images.end());
    }
    run.progress().advance(batch.size());
  }
  run.progress().end();
  if (images.empty())
    throw libmap::Error("no frame has a pose, a calibration and a color image",
                        {.file = scan.path().string()});
  return images;
}

std::vector<ScanImage> selected(const std::vector<ScanImage>& images, const ImageOptions& options) {
  std::vector<libmap::Pose> poses;
  std::vector<double> qualities;
  for (const ScanImage& image : images) {
    poses.push_back(image.world_from_camera);
    qualities.push_back(options.keep == ImagePreference::sharpest ? image.sharpness : 0.0);
  }
  std::vector<ScanImage> kept;
  for (const std::size_t n : libmap::select_views(poses, qualities, options.selection))
    kept.push_back(images[n]);
  return kept;
}

// Writes the image, unless `folder` is empty.
libmap::BundlerView write_bundler_image(const libmap::ScanSource& scan, const ScanImage& image,
                                        const fs::path& folder) {
  const libmap::CameraView view =
      libmap::read_views(scan, image.node, {.color = true, .depth = false})[image.camera];
  libmap::BundlerView written{"images/" + libmap::image_file_name(image.node, image.camera, ".jpg"),
                              libmap::centered_pinhole(view.color_camera), image.world_from_camera};
  if (!folder.empty())
    libmap::write_text(folder / written.image, libmap::encode_jpeg(libmap::resample_image(
                                                   view.color, view.color_camera, written.camera)));
  return written;
}

void write_bundler(const ImageOptions& options, const std::vector<ScanImage>& all,
                   const libmap::ScanSource& scan, Run& run) {
  const std::vector<ScanImage> kept = selected(all, options);
  run.info("{} of {} images kept", kept.size(), all.size());
  run.add_results({{"kept_images", kept.size()}});
  run.write_output_tree(options.bundler, bundler_names, [&](const fs::path& folder) {
    if (!folder.empty()) fs::create_directory(folder / "images");
    std::vector<libmap::BundlerView> views(kept.size());
    libmap::parallel_each(
        kept.size(), [&](std::size_t n) { views[n] = write_bundler_image(scan, kept[n], folder); });
    if (folder.empty()) return;
    libmap::write_text(folder / "bundle.out", libmap::to_bundle_text(views));
    libmap::write_text(folder / "list.txt", libmap::to_bundler_list(views));
  });
}

struct ColmapView {
  libmap::CameraView view{};
  std::string name{};
};

// Reads the image with its depth; writes the image, unless `folder` is empty.
ColmapView copy_image(const libmap::ScanSource& scan, const ScanImage& image,
                      const fs::path& folder) {
  std::vector<libmap::CameraView> views = libmap::read_views(scan, image.node, {});
  const libmap::ImageFile file = libmap::image_file_of(scan, image.node, views, image.camera);
  if (!folder.empty()) libmap::write_text(folder / "images" / file.name, file.bytes);
  return {std::move(views[image.camera]), file.name};
}

void write_colmap(const ImageOptions& options, const std::vector<ScanImage>& images,
                  const libmap::ScanSource& scan, Run& run) {
  run.write_output_tree(options.colmap, colmap_names, [&](const fs::path& folder) {
    if (!folder.empty()) {
      fs::create_directory(folder / "images");
      fs::create_directory(folder / "sparse");
    }
    libmap::ColmapBuilder builder(options.points);
    for (std::size_t first = 0; first < images.size(); first += batch_size) {
      std::vector<ColmapView> batch(std::min(batch_size, images.size() - first));
      libmap::parallel_each(batch.size(), [&](std::size_t n) {
        batch[n] = copy_image(scan, images[first + n], folder);
      });
      for (std::size_t n = 0; n < batch.size(); ++n)
        builder.add_image(batch[n].name, batch[n].view, images[first + n].world_from_camera);
    }
    const libmap::ColmapModel& model = builder.model();
    std::size_t observations = 0;
    for (const auto& [id, image] : model.images) observations += image.observations.size();
    run.info("{} images of {} cameras, {} points, {} observations", model.images.size(),
             model.cameras.size(), model.points.size(), observations);
    run.add_results({{"cameras", model.cameras.size()},
                     {"points", model.points.size()},
                     {"observations", observations}});
    if (!folder.empty()) libmap::write_colmap_model(folder / "sparse", model);
  });
}

void add_options(Command& command, ImageOptions& options) {
  command.option("--bundler", "DIR", options.bundler,
                 "output folder for cameras and images in Bundler v0.3 format (MeshLab's "
                 "registered rasters): bundle.out, list.txt, images");
  command.option("--colmap", "DIR", options.colmap,
                 "output folder for cameras, all images and points as a COLMAP model: "
                 "sparse/cameras.txt, images.txt, points3D.txt; images");
  add_poses_option(command, options.poses);
  command.option("--transform", "X,Y,Z,ROLL,PITCH,YAW|FILE", options.transform,
                 "with --bundler or --colmap: transform of the poses to the frame of a mesh, m and "
                 "degrees, or e.g. the file *.site_from_map.txt of crop");
  bind(command.parameters(), options.selection);
  command.parameters().add(
      "keep", options.keep,
      {{"sharpest", ImagePreference::sharpest}, {"first", ImagePreference::first}},
      "with --bundler: image to keep if several have similar poses; first: the first in the scan");
  bind(command.parameters(), options.points);
}

// Claims the folders before the work.
void claim_image_folders(const ImageOptions& options, const std::string& scan, Run& run) {
  parse_transform(options.transform, "--transform");
  std::vector<std::string> inputs = scan_inputs(scan, options.poses);
  inputs.push_back(options.transform);
  if (!options.bundler.empty()) run.claim_output_tree(options.bundler, bundler_names, inputs);
  if (!options.colmap.empty()) run.claim_output_tree(options.colmap, colmap_names, inputs);
}

// Writes, for Bundler, bundle.out, list.txt and resampled images of selected views; for COLMAP,
// sparse/cameras.txt, images.txt, points3D.txt and all images as stored. Broken frames are skipped
// with a warning. Throws Error for them if `strict`.
void write_image_folders(ImageOptions& options, const libmap::ScanSource& scan, bool strict,
                         Run& run) {
  const libmap::Trajectory poses = find_poses(scan, options.poses, strict, run);
  const libmap::Pose world_from_map = parse_transform(options.transform, "--transform");
  const std::vector<ScanImage> images =
      find_images(scan, poses, world_from_map, options, strict, run);
  libmap::Manifest& manifest = run.manifest();
  manifest.parameters.emplace_back("transform", options.transform);
  manifest.frame = "poses";
  manifest.transforms.emplace_back("world_from_map", world_from_map);
  run.add_results({{"images", images.size()}});
  const libmap::Manifest start = manifest;
  // COLMAP is first, because it also reads the depth and so finds all broken frames.
  if (!options.colmap.empty()) write_colmap(options, images, scan, run);
  manifest = start;
  if (!options.bundler.empty()) write_bundler(options, images, scan, run);
}

struct ExtractOptions {
  std::string scan;
  std::string output;
  CalibrationOption calibration;
  bool strict = false;
  ImageOptions images;
};

struct Counts {
  std::size_t broken_frames = 0;
  std::size_t rounded_depth_images = 0;
  std::size_t lost_depth_pixels = 0;
};

struct NodeImages {
  libmap::RgbdFrame frame;
  libmap::StoredImages stored;
  bool is_rounded = false;            // depth is rounded to millimeters
  std::size_t lost_depth_pixels = 0;  // depth beyond the range of 16-bit millimeters
  std::optional<libmap::Error> error{};
};

// Copies the image files of a database as stored.
void keep_files(const libmap::RtabmapDatabase& database, NodeImages& images) {
  libmap::FrameBlobs blobs = database.read_blobs(images.frame.node);
  images.stored.color = std::move(blobs.image);
  if (!images.frame.right.empty()) {
    images.stored.right = std::move(blobs.depth);
    return;
  }
  if (images.frame.depth.empty()) return;
  const auto info = libmap::read_depth_info(blobs.depth);
  if (info && info->format == libmap::DepthFormat::png16)
    images.stored.depth = std::move(blobs.depth);
}

// Rounds depth in floats or in another 16-bit unit to millimeters.
void round_depth(NodeImages& images) {
  constexpr double told_m = 1e-5;
  const libmap::MillimeterImage rounded = libmap::to_millimeters(images.frame.depth);
  for (std::size_t n = 0; n < rounded.pixels.size(); ++n) {
    const double depth_m = static_cast<double>(images.frame.depth.pixels[n]);
    if (!(depth_m > 0.0)) continue;
    const bool is_lost = rounded.pixels[n] == 0 && depth_m > 1.0;
    if (is_lost) ++images.lost_depth_pixels;
    if (std::abs(rounded.pixels[n] * 1e-3 - depth_m) > told_m) images.is_rounded = true;
  }
  images.stored.depth = libmap::encode_png(rounded);
}

NodeImages read_images(const libmap::ScanSource& scan, int node) {
  NodeImages images;
  try {
    // Copied files are decoded too, so that broken images are not copied.
    images.frame = scan.read_frame(node);
    if (const auto* database = dynamic_cast<const libmap::RtabmapDatabase*>(&scan))
      keep_files(*database, images);
    if (!images.frame.depth.empty() && images.stored.depth.empty()) round_depth(images);
  } catch (const libmap::Error& error) {
    images.error = error;
  }
  return images;
}

// Extracts all frames; nothing is written without a writer.
Counts extract_frames(const libmap::ScanSource& scan, libmap::FrameFolderWriter* writer,
                      const ExtractOptions& options, Run& run) {
  const std::vector<libmap::GraphNode>& nodes = scan.graph().nodes;
  Counts counts;
  run.progress().begin("frames", nodes.size());
  std::vector<NodeImages> batch(1);
  std::size_t max_pixels = 0;
  for (std::size_t first = 0; first < nodes.size(); first += batch.size()) {
    // The first frame is read alone to determine the size of images.
    const std::size_t count = first == 0 ? 1 : libmap::frames_in_batch(max_pixels);
    batch = std::vector<NodeImages>(std::min(count, nodes.size() - first));
    libmap::parallel_each(
        batch.size(), [&](std::size_t i) { batch[i] = read_images(scan, nodes[first + i].id); });
    for (const NodeImages& images : batch) {
      max_pixels = std::max(max_pixels, libmap::image_pixels(images.frame));
      if (images.error && options.strict) throw libmap::Error(*images.error);
      if (images.error) {
        run.warn(std::string(images.error->what()) + "; images of this node are skipped");
        ++counts.broken_frames;
      } else {
        if (images.is_rounded) ++counts.rounded_depth_images;
        counts.lost_depth_pixels += images.lost_depth_pixels;
        if (writer != nullptr) writer->add_frame(images.frame, images.stored);
      }
    }
    run.progress().advance(batch.size());
  }
  run.progress().end();
  return counts;
}

void add_results(const libmap::PoseGraph& graph, const Counts& counts,
                 const libmap::FrameFolderCounts& written, Run& run) {
  run.manifest().frame = "base";
  const auto poses = [&](libmap::PoseSource source) {
    return libmap::trajectory_of(graph, source).size();
  };
  run.add_results({{"nodes", graph.nodes.size()},
                   {"links", graph.links.size()},
                   {"odometry_poses", poses(libmap::PoseSource::odometry)},
                   {"stored_poses", poses(libmap::PoseSource::optimized)},
                   {"ground_truth_poses", poses(libmap::PoseSource::ground_truth)},
                   {"color_images", written.color_images},
                   {"depth_images", written.depth_images},
                   {"right_images", written.right_images},
                   {"calibrations", written.calibrations},
                   {"associations", written.associations},
                   {"broken_frames", counts.broken_frames},
                   {"depth_images_rounded", counts.rounded_depth_images},
                   {"depth_unit_m", 0.001}});
}

void write_folder(const ExtractOptions& options, const libmap::ScanSource& scan, Run& run) {
  const auto work = [&](const fs::path& folder) {
    std::optional<libmap::FrameFolderWriter> writer;
    if (!run.options().dry_run) writer.emplace(folder);
    const Counts counts = extract_frames(scan, writer ? &*writer : nullptr, options, run);
    if (!writer) return;
    const libmap::FrameFolderCounts written = writer->finish(scan.graph());
    add_results(scan.graph(), counts, written, run);
    run.info("{} nodes: {} color, {} depth images, {} calibrations, {} links",
             scan.graph().nodes.size(), written.color_images, written.depth_images,
             written.calibrations, scan.graph().links.size());
    if (written.right_images > 0) run.info("{} right images of stereo pairs", written.right_images);
    if (counts.rounded_depth_images > 0)
      run.info("{} depth images were rounded to millimeters", counts.rounded_depth_images);
    if (counts.lost_depth_pixels > 0)
      run.warn("{} depth pixels beyond 65.5 m are skipped", counts.lost_depth_pixels);
  };
  run.write_output_tree(options.output, libmap::frame_folder_names(), work);
}

void extract(ExtractOptions& options, Run& run) {
  if (libmap::has_bag_extension(options.output))
    throw libmap::Error(
        "a scan cannot be written as a bag; the input must be a map or the folder of a camera rig",
        {.file = options.output});
  const bool images = options.images.wanted();
  const ImageOptions unset;
  if (!images)
    reject_given({{"--poses", options.images.poses.source != unset.poses.source},
                  {"--transform", options.images.transform != unset.transform},
                  {"--keep", options.images.keep != unset.keep}},
                 "requires --bundler or --colmap; -o FOLDER contains the scan's stored poses");
  if (options.output.empty() && !images)
    throw UsageError("no output: -o, --bundler or --colmap is required");
  if (!options.output.empty())
    run.claim_output_tree(options.output, libmap::frame_folder_names(),
                          {options.scan, options.calibration.source});
  if (images) claim_image_folders(options.images, options.scan, run);
  const auto scan =
      open_scan(options.scan, options.strict, run,
                known_camera(options.calibration, options.scan, options.images.poses, run));
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  // Each folder has its own manifest.
  const libmap::Manifest start = run.manifest();
  // Images are first, because missing poses are found before anything is written.
  if (images) write_image_folders(options.images, *scan, options.strict, run);
  run.manifest() = start;
  if (!options.output.empty()) write_folder(options, *scan, run);
}

}  // namespace

bool graspmap_tools::is_scan_path(const std::string& path) {
  std::error_code code;
  if (!fs::is_directory(path, code)) return fs::path(path).extension() == ".db";
  return !is_tile_store(path) && !libmap::is_trajectory_path(path);
}

int graspmap_tools::convert_scan(int argc, char** argv) {
  ExtractOptions options;
  Command command("convert",
                  "With a scan: writes the scan as plain files, also for MeshLab or COLMAP.");
  command.input("SCAN", options.scan, "RTAB-Map database, or a folder of frames");
  command.output(options.output, "output folder for the whole scan; an earlier output is replaced",
                 false);
  command.flag("--strict", options.strict,
               "fail if a frame is broken, instead of skipping the frame");
  add_calibration_option(command, options.calibration);
  add_options(command, options.images);
  return command.run(argc, argv, [&](Run& run) { extract(options, run); });
}
