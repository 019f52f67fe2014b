// graspmap convert SCAN -o FOLDER: a scan as plain files, for MeshLab (Bundler) or for COLMAP.
#include "libmap/core/parallel.h"
#include "libmap/image/depth_codec.h"
#include "libmap/image/image_codec.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/scan/frame_folder_writer.h"
#include "libmap/scan/rgbd_frame.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_source.h"
#include "libmap/trajectory/trajectory_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_tiles.h"
#include "tools/support/scan_pictures.h"
#include "tools/support/scan_poses.h"
#include "tools/support/usages.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

struct ExtractOptions {
  std::string scan;
  std::string output;
  CalibrationOption calibration;
  bool strict = false;
  PictureOptions pictures;
};

struct Counts {
  std::size_t broken_frames = 0;
  std::size_t rounded_depth_images = 0;
  std::size_t lost_depth_pixels = 0;
};

struct NodeImages {
  libmap::RgbdFrame frame;
  libmap::StoredImages stored;
  bool is_rounded = false;            // depth, to millimeters
  std::size_t lost_depth_pixels = 0;  // beyond what millimeters of 16 bits hold
  std::optional<libmap::Error> error{};
};

// The image files of a database as they are stored.
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

// Floats, or 16 bits of another unit.
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
    // Decoded even where it is copied as it is: what cannot be decoded is not handed on.
    images.frame = scan.read_frame(node);
    if (const auto* database = dynamic_cast<const libmap::RtabmapDatabase*>(&scan))
      keep_files(*database, images);
    if (!images.frame.depth.empty() && images.stored.depth.empty()) round_depth(images);
  } catch (const libmap::Error& error) {
    images.error = error;
  }
  return images;
}

// Nothing is written without a writer.
Counts extract_frames(const libmap::ScanSource& scan, libmap::FrameFolderWriter* writer,
                      const ExtractOptions& options, Run& run) {
  const std::vector<libmap::GraphNode>& nodes = scan.graph().nodes;
  Counts counts;
  run.progress().begin("frames", nodes.size());
  std::vector<NodeImages> batch(1);
  std::size_t max_pixels = 0;
  for (std::size_t first = 0; first < nodes.size(); first += batch.size()) {
    // The first by itself: it tells how large they are.
    const std::size_t count = first == 0 ? 1 : libmap::frames_in_batch(max_pixels);
    batch = std::vector<NodeImages>(std::min(count, nodes.size() - first));
    libmap::parallel_each(
        batch.size(), [&](std::size_t i) { batch[i] = read_images(scan, nodes[first + i].id); });
    for (const NodeImages& images : batch) {
      max_pixels = std::max(max_pixels, libmap::image_pixels(images.frame));
      if (images.error && options.strict) throw libmap::Error(*images.error);
      if (images.error) {
        run.warn(std::string(images.error->what()) + "; its images are left out");
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
    run.say("{} nodes: {} color, {} depth images, {} calibrations, {} links",
            scan.graph().nodes.size(), written.color_images, written.depth_images,
            written.calibrations, scan.graph().links.size());
    if (written.right_images > 0) run.say("{} right images of stereo pairs", written.right_images);
    if (counts.rounded_depth_images > 0)
      run.say("{} depth images were rounded to millimeters", counts.rounded_depth_images);
    if (counts.lost_depth_pixels > 0)
      run.warn("{} depth pixels beyond 65.5 m are left out", counts.lost_depth_pixels);
  };
  run.write_output_tree(options.output, libmap::frame_folder_names(), work);
}

void extract(ExtractOptions& options, Run& run) {
  if (libmap::has_bag_extension(options.output))
    throw libmap::Error("a bag is made of a map or of the folder of a camera rig, not of a scan",
                        {.file = options.output});
  const bool pictures = options.pictures.wanted();
  const PictureOptions unset;
  if (!pictures)
    refuse_given({{"--poses", options.pictures.poses.source != unset.poses.source},
                  {"--transform", options.pictures.transform != unset.transform},
                  {"--keep", options.pictures.keep != unset.keep}},
                 "is for --bundler and --colmap: a folder keeps the scan's own poses");
  if (options.output.empty() && !pictures)
    throw UsageError("nothing to write: -o, --bundler or --colmap names a folder");
  if (!options.output.empty())
    run.claim_output_tree(options.output, libmap::frame_folder_names(),
                          {options.scan, options.calibration.source});
  if (pictures) claim_picture_folders(options.pictures, options.scan, run);
  const auto scan =
      open_scan(options.scan, options.strict, run,
                known_camera(options.calibration, options.scan, options.pictures.poses, run));
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
  // Each folder's manifest holds what was done for it alone.
  const libmap::Manifest start = run.manifest();
  // First: whether there are poses for them shows before anything is written.
  if (pictures) write_picture_folders(options.pictures, *scan, options.strict, run);
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
  Command command(
      "convert",
      "With a scan: the scan as plain files, for MeshLab (--bundler) or COLMAP (--colmap).");
  command.input("SCAN", options.scan, "RTAB-Map database, or a folder of frames");
  command.output(options.output, "folder of the whole scan, replaced as a whole", false);
  command.flag("--strict", options.strict, "end at a frame that is broken");
  add_calibration_option(command, options.calibration);
  add_options(command, options.pictures);
  return command.run(argc, argv, [&](Run& run) { extract(options, run); });
}
