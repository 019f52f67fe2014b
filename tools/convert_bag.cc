// graspmap convert BAG, and ... -o BAG: reads and writes bags of ROS 1 and ROS 2, without ROS.
#include <variant>

#include "libgtd/shape/convexity.h"
#include "libgtd/shape/curvature.h"
#include "libmap/bag/bag_cloud.h"
#include "libmap/bag/bag_reader.h"
#include "libmap/bag/bag_rig.h"
#include "libmap/bag/bag_writer.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/score_color.h"
#include "libmap/io/cloud_io.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/rig_io.h"
#include "libmap/view/color_map.h"
#include "tools/support/command_line.h"
#include "tools/support/foothold_file.h"
#include "tools/support/map_frame.h"
#include "tools/support/option_values.h"
#include "tools/support/run.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libmap::Manifest;
using libmap::PointCloud;

struct BagCommandOptions {
  std::string input;
  std::string output;
  // Options for reading a bag.
  std::vector<std::string> topics;
  std::string rig;
  std::string stamp = "auto";
  bool strict = false;
  libmap::BagRigOptions depth;
  // Options for writing a bag.
  std::string terrain;
  std::string curvature;
  std::string footholds;
  std::string frame = "auto";
  double stamp_offset_s = 0.0;
  double arrow_m = libmap::BagTargets{}.arrow_m;
  double cell_size_m = 0.0;
  libmap::BagCompression compression = libmap::BagCompression::none;
};

void bind(libmap::ParameterTable& table, BagCommandOptions& options) {
  table.add("stamp_s", options.stamp,
            "when reading a bag: stamp of the image set or cloud to read, s (auto: all sets, or "
            "the cloud with most points); when writing a map: stamp of all messages, s (auto: "
            "stamp in the inputs' manifests)");
  table.add("strict", options.strict, "fail if an image cannot be used, instead of a warning");
  bind(table, options.depth);
  table.add("frame", options.frame,
            "when writing a map: frame_id of its points in the bag; auto: by the map's manifest");
  table.add("stamp_offset_s", options.stamp_offset_s, libmap::any_number,
            "when writing a rig's images: offset added to their stamps, s");
  table.add("arrow_m", options.arrow_m, libmap::positive,
            "length of the arrows that show the approach directions of footholds, m");
  table.add("cell_size_m", options.cell_size_m, libmap::not_negative,
            "cell size of the map's grids in a ROS 2 bag, m; 0: the map's voxel size");
  table.add("compression", options.compression,
            {{"none", libmap::BagCompression::none},
             {"bz2", libmap::BagCompression::bz2},
             {"lz4", libmap::BagCompression::lz4},
             {"zstd", libmap::BagCompression::zstd}},
            "compression of the written bag; bz2: only .bag; lz4: .bag and .mcap; zstd: only "
            ".mcap; none: no compression");
}

// Parses --stamp; returns nullopt for auto. Throws Error for another text.
std::optional<double> bag_stamp(const BagCommandOptions& options) {
  return parse_number_or("auto", options.stamp, "not a time", "--stamp",
                         "a number of seconds, or auto");
}

libmap::CameraRig read_named_rig(const std::string& name, Run& run) {
  const fs::path file = fs::exists(name) ? fs::path(name) : libmap::find_data_file("rigs", name);
  libmap::CameraRig rig = libmap::read_rig(file);
  run.add_input(file);
  return rig;
}

// ------------------------------------------------------------------------------------ reading bags

void add_bag_input(const BagCommandOptions& options, Run& run) {
  for (const fs::path& file : libmap::files_of_bag(options.input)) run.add_input(file);
}

void report(const libmap::BagRigPlan& plan, const libmap::BagRigExport& result,
            const BagCommandOptions& options, Run& run) {
  for (const std::string& warning : result.warnings) {
    if (options.strict) throw libmap::Error(warning, {.file = options.input});
    run.warn(options.input + ": " + warning);
  }
  if (result.overflow_pixels > 0)
    run.warn("{}: {} pixels exceed the 16-bit depth range and are skipped (--depth-scale)",
             options.input, result.overflow_pixels);
  std::size_t fullest = 0;
  for (const libmap::SynchronizedSet& set : result.sets) fullest = std::max(fullest, set.seen());
  run.add_results({{"cameras", plan.rig.cameras.size()},
                   {"images", result.images},
                   {"images_broken", result.undecodable_images},
                   {"synchronized_sets", result.sets.size()},
                   {"synchronized_sets_in_bag", plan.sets_in_bag},
                   {"cameras_of_fullest_set", fullest},
                   {"pixels_beyond", result.overflow_pixels}});
  for (std::size_t n = 0; n < plan.rig.cameras.size(); ++n) {
    const libmap::RigCamera& camera = plan.rig.cameras[n];
    run.add_results({{camera.name + ".topic", plan.topics[n]}});
    run.manifest().transforms.emplace_back("robot_from_" + camera.name,
                                           camera.camera.base_from_camera);
    if (plan.topics[n].empty()) run.warn(camera.name + ": no topic contains images of this camera");
  }
  run.info("{} images of {} cameras in {} of {} image sets, at most {} cameras per set",
           result.images, plan.rig.cameras.size(), result.sets.size(), plan.sets_in_bag, fullest);
}

// Writes a rig's folder from a bag.
void read_bag_into_folder(const BagCommandOptions& options, Run& run) {
  libmap::BagRigOptions depth = options.depth;
  depth.topics = options.topics;
  if (!options.rig.empty()) depth.rig = read_named_rig(options.rig, run);
  const libmap::BagRigPlan plan = run.timed(
      "topics", [&] { return libmap::plan_bag_rig(options.input, depth, bag_stamp(options)); });
  const std::vector<std::string> names = libmap::names_in_rig_folder(plan);
  run.claim_output_tree(options.output, names, {options.input});
  for (const std::string& warning : plan.warnings) run.warn(options.input + ": " + warning);
  add_bag_input(options, run);
  run.manifest().frame = "robot";
  run.write_output_tree(options.output, names, [&](const fs::path& temporary) {
    report(plan, libmap::export_bag_rig(options.input, plan, temporary), options, run);
  });
}

void read_bag_into_cloud(const BagCommandOptions& options, Run& run) {
  if (options.topics.size() > 1)
    throw libmap::Error("a cloud is read from one topic only", {.field = "--topic"});
  run.claim_output(options.output, {options.input});
  const libmap::BagCloudResult result = run.timed("read", [&] {
    return libmap::read_bag_cloud(options.input,
                                  options.topics.empty() ? std::string() : options.topics.front(),
                                  bag_stamp(options));
  });
  add_bag_input(options, run);
  run.manifest().frame = result.frame;
  run.add_results({{"topic", result.topic},
                   {"stamp_s", result.stamp_s},
                   {"messages", result.messages},
                   {"points", result.cloud.size()},
                   {"dropped_points", result.dropped_points}});
  if (result.cloud.empty()) run.warn(options.input + ": " + result.topic + ": no finite points");
  run.info("{} points of {} at {} s, one of {} messages; {} not finite", result.cloud.size(),
           result.topic, libmap::to_fixed_text(result.stamp_s, 6), result.messages,
           result.dropped_points);
  run.write_output(options.output, [&](const fs::path& temporary) {
    libmap::write_cloud(temporary, result.cloud);
  });
}

// ------------------------------------------------------------------------------------ writing bags

// A cloud file with its manifest.
struct CloudFile {
  std::string path;
  PointCloud cloud;
  std::optional<Manifest> manifest;

  std::string frame() const { return manifest ? manifest->frame : std::string(); }
};

CloudFile read(const std::string& path, Run& run) {
  CloudFile file{path, libmap::read_cloud(path).cloud, libmap::read_manifest_of(path)};
  run.add_input(path);
  return file;
}

// ROS name (REP-105) of a frame; `input` for the frame of the scored cloud.
std::string frame_id(const std::string& frame, const std::string& input) {
  if (frame == "robot") return "base_link";
  if (frame == "input") return input;
  return frame.empty() ? "map" : frame;
}

double radius_of(const std::optional<Manifest>& manifest) {
  const double* radius =
      manifest ? std::get_if<double>(manifest->find_parameter("curvature_radius_m")) : nullptr;
  return radius && *radius > 0 ? *radius : libgtd::CurvatureOptions{}.radius_m;
}

// Returns the map with curvatures at its voxels, colored by convexity like `render --color flags`.
PointCloud curvature_map(const CloudFile& map) {
  const libgtd::CurvatureOptions options{.radius_m = radius_of(map.manifest),
                                         .up = up_of_map(map.manifest)};
  const libgtd::CurvatureResult curvature = libgtd::estimate_curvature(map.cloud, options);
  PointCloud cloud = map.cloud;
  std::vector<double> k1;
  std::vector<double> k2;
  for (const libgtd::Curvature& point : curvature.points) {
    k1.push_back(static_cast<double>(point.k1));
    k2.push_back(static_cast<double>(point.k2));
  }
  cloud.add_field("k1", libmap::ScalarType::float32).values = k1;
  cloud.add_field("k2", libmap::ScalarType::float32).values = k2;
  if (!cloud.find_field("convex")) {
    const std::vector<std::uint8_t> convex = libgtd::find_convex(curvature, cloud.positions);
    cloud.add_field("convex", libmap::ScalarType::uint8)
        .values.assign(convex.begin(), convex.end());
  }
  const std::vector<double>& convex = cloud.find_field("convex")->values;
  cloud.colors.clear();
  for (const double one : convex)
    cloud.colors.push_back(one > 0 ? libmap::convex_color : libmap::rest_color);
  return cloud;
}

libmap::BagTargets targets_of(const CloudFile& footholds, double arrow_m) {
  libmap::BagTargets targets;
  targets.marker_topic = "/footholds";
  targets.pose_topic = "/foothold_poses";
  targets.arrow_m = arrow_m;
  for (const FootholdMark& mark : foothold_marks(footholds.cloud, footholds.path))
    targets.targets.push_back({mark.position, mark.approach, libmap::score_color(mark.score),
                               fmt::format("{}: {:.2f}", targets.targets.size() + 1, mark.score)});
  return targets;
}

// Stamp of the messages: --stamp, else the panorama's stamp in the inputs' manifests.
double stamp_of(const BagCommandOptions& options, const std::vector<const CloudFile*>& files) {
  if (const std::optional<double> stamp = bag_stamp(options)) return *stamp;
  for (const CloudFile* file : files) {
    if (file == nullptr || !file->manifest) continue;
    const double* stamp = std::get_if<double>(file->manifest->find_result("stamp_s"));
    if (stamp && *stamp >= 1e-9) return *stamp;
  }
  return libmap::BagContent{}.stamp_s;
}

// Adds the transform between map and terrain, which RViz needs to show both frames together.
void add_transform(const CloudFile& map, const std::string& map_frame,
                   const std::string& terrain_frame, libmap::BagContent& content, Run& run) {
  if (map_frame == terrain_frame) return;
  const libmap::Pose* pose = terrain_from_input_of(map.manifest);
  if (pose && map.frame() == "terrain")
    content.transforms.push_back({map_frame, terrain_frame, *pose});
  else
    run.warn("the transform from {} to {} is unknown and not written", terrain_frame, map_frame);
}

// Grid of the map from above: each cell has the values of its topmost voxel.
libmap::BagGrid grid_of(const CloudFile& map, double cell_m) {
  libmap::BagGrid grid;
  grid.grid_map_topic = "/graspability_grid";
  grid.occupancy_topic = "/graspability_occupancy";
  grid.cell_m = cell_m;
  const std::vector<Eigen::Vector3d>& points = map.cloud.positions;
  const libmap::Bounds3d bounds = libmap::bounds_of(points);
  // Cells are centered on voxels.
  grid.corner_m = bounds.min.head<2>().array() - cell_m / 2;
  const Eigen::Array2d cells = (bounds.max - bounds.min).head<2>().array() / cell_m + 1.5;
  constexpr double max_cells = 1 << 26;
  if (!(cells.prod() <= max_cells))
    throw libmap::Error(
        "the grid would have more than 2^26 cells; use a larger cell size",
        {.file = map.path, .field = "--cell-size", .value = libmap::to_text(cell_m)});
  grid.columns = static_cast<std::size_t>(cells.x());
  grid.rows = static_cast<std::size_t>(cells.y());
  std::vector<std::size_t> top(grid.columns * grid.rows, points.size());
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Eigen::Array2d cell = (points[n].head<2>() - grid.corner_m).array() / cell_m;
    std::size_t& held =
        top[static_cast<std::size_t>(cell.y()) * grid.columns + static_cast<std::size_t>(cell.x())];
    if (held == points.size() || points[n].z() > points[held].z()) held = n;
  }
  const auto layer = [&](const std::string& name, const auto& value) {
    grid.layers.push_back({name, std::vector<float>(top.size(), std::nanf(""))});
    for (std::size_t n = 0; n < top.size(); ++n)
      if (top[n] < points.size()) grid.layers.back().values[n] = static_cast<float>(value(top[n]));
  };
  layer("elevation", [&](std::size_t n) { return points[n].z(); });
  for (const libmap::ScalarField& field : map.cloud.fields)
    layer(field.name, [&](std::size_t n) { return field.values[n]; });
  const std::vector<double>& score = map.cloud.find_field("score")->values;
  layer("occupancy", [&](std::size_t n) { return 1.0 - std::clamp(score[n], 0.0, 1.0); });
  grid.occupancy = std::move(grid.layers.back().values);
  grid.layers.pop_back();
  return grid;
}

void add_grid(const CloudFile& map, const std::string& frame, const BagCommandOptions& options,
              libmap::BagContent& content, Run& run) {
  double cell_m = options.cell_size_m;
  if (cell_m == 0 && map.manifest) {
    const double* voxel = std::get_if<double>(map.manifest->find_parameter("voxel_size_m"));
    if (voxel) cell_m = *voxel;
  }
  if (!(cell_m > 0) || map.cloud.empty())
    return run.warn("{}: {}, so the bag contains no grids", map.path,
                    map.cloud.empty() ? "has no points" : "has no voxel size (--cell-size)");
  content.grids.push_back(grid_of(map, cell_m));
  content.grids.back().frame = frame;
}

void claim_bag(const BagCommandOptions& options, const std::vector<std::string>& inputs, Run& run) {
  if (libmap::bag_format_of(options.output) == libmap::BagFormat::sqlite)
    run.claim_output_tree(options.output, libmap::names_in_bag_folder(), inputs);
  else
    run.claim_output(options.output, inputs);
}

// Writes a claimed bag by write(path, format).
template <typename Write>
void write_claimed_bag(const BagCommandOptions& options, Run& run, const Write& write) {
  const libmap::BagFormat format = libmap::bag_format_of(options.output);
  const auto write_whole = [&](const fs::path& temporary) {
    if (!temporary.empty()) write(temporary, format);
  };
  if (format == libmap::BagFormat::sqlite)
    run.write_output_tree(options.output, libmap::names_in_bag_folder(), write_whole);
  else
    run.write_output(options.output, write_whole);
}

void add_results(const libmap::BagContent& content, Run& run) {
  for (const libmap::BagCloud& cloud : content.clouds)
    run.add_results({{cloud.topic + ".points", cloud.cloud.size()}});
  for (const libmap::BagTargets& targets : content.targets)
    run.add_results({{"footholds", targets.targets.size()}});
  for (const libmap::BagGrid& grid : content.grids)
    run.add_results(
        {{"cells_x", grid.columns}, {"cells_y", grid.rows}, {"cell_size_m", grid.cell_m}});
  run.add_results({{"stamp_s", content.stamp_s}});
}

void write_map_bag(const BagCommandOptions& options, Run& run) {
  claim_bag(options, {options.input, options.terrain, options.curvature, options.footholds}, run);
  const CloudFile map = read(options.input, run);
  if (!map.cloud.find_field("score"))
    throw libmap::Error(fs::path(options.output).has_extension()
                            ? "is missing: the input is not a map"
                            : "is missing: an output without an extension is a bag of ROS 2, "
                              "which requires a map",
                        {.file = options.input, .field = "score"});
  std::optional<CloudFile> terrain;
  if (!options.terrain.empty()) terrain = read(options.terrain, run);
  std::optional<CloudFile> footholds;
  if (!options.footholds.empty()) footholds = read(options.footholds, run);

  libmap::BagContent content;
  content.stamp_s = stamp_of(options, {&map, terrain ? &*terrain : nullptr});
  const std::string terrain_frame = terrain ? frame_id(terrain->frame(), "map") : "map";
  const std::string map_frame =
      options.frame == "auto" ? frame_id(map.frame(), terrain_frame) : options.frame;
  if (terrain) {
    add_transform(map, map_frame, terrain_frame, content, run);
    content.clouds.push_back({"/merged_pcd", terrain_frame, terrain->cloud});
  }
  content.clouds.push_back({"/graspability_map", map_frame, map.cloud});
  content.clouds.push_back({"/curvature_map", map_frame,
                            options.curvature.empty()
                                ? run.timed("curvature", [&] { return curvature_map(map); })
                                : read(options.curvature, run).cloud});
  if (footholds) {
    content.targets.push_back(targets_of(*footholds, options.arrow_m));
    content.targets.back().frame = frame_id(footholds->frame(), terrain_frame);
  }
  if (libmap::bag_format_of(options.output) != libmap::BagFormat::ros1)
    add_grid(map, map_frame, options, content, run);
  run.manifest().frame = map_frame;
  add_results(content, run);
  write_claimed_bag(options, run, [&](const fs::path& path, libmap::BagFormat format) {
    libmap::write_bag(path, format, content, options.compression);
  });
  run.info("{} clouds and {} footholds at {} s", content.clouds.size(),
           footholds ? footholds->cloud.size() : 0, libmap::to_fixed_text(content.stamp_s, 6));
}

void write_rig_folder_bag(const BagCommandOptions& options, Run& run) {
  claim_bag(options, {}, run);
  const fs::path own = fs::path(options.input) / libmap::rig_file_name;
  const libmap::CameraRig rig =
      read_named_rig(options.rig.empty() ? own.string() : options.rig, run);
  const std::vector<libmap::RigImage> images = libmap::list_rig_images(options.input, rig);
  for (const libmap::RigImage& image : images) run.add_input(image.file);
  const libmap::RigBagOptions bag{.base_frame = options.depth.base_frame == "auto"
                                                    ? libmap::RigBagOptions{}.base_frame
                                                    : options.depth.base_frame,
                                  .stamp_offset_s = options.stamp_offset_s,
                                  .compression = options.compression};
  run.manifest().frame = bag.base_frame;
  run.add_results({{"cameras", rig.cameras.size()}, {"images", images.size()}});
  write_claimed_bag(options, run, [&](const fs::path& path, libmap::BagFormat format) {
    libmap::write_rig_bag(path, format, rig, images, bag);
  });
  run.info("{} images of {} cameras", images.size(), rig.cameras.size());
}

void refuse_map_options(const BagCommandOptions& options, const std::string& reason) {
  reject_given({{"--terrain", !options.terrain.empty()},
                {"--curvature", !options.curvature.empty()},
                {"--footholds", !options.footholds.empty()}},
               reason);
}

void write_bag(const BagCommandOptions& options, Run& run) {
  const bool rig = fs::is_directory(options.input);
  reject_given({{"--topic", !options.topics.empty()}},
               rig ? "cannot be used with a rig's folder" : "cannot be used with a map");
  if (rig) {
    refuse_map_options(options, "cannot be used with a rig's folder");
    reject_given({{"--stamp", options.stamp != "auto"}},
                 "cannot be used with a rig's folder; use --stamp-offset");
    if (options.rig.empty() && !fs::exists(fs::path(options.input) / libmap::rig_file_name))
      throw libmap::Error("is a folder without rig.yaml; give the rig with --rig",
                          {.file = options.input});
  } else {
    reject_given({{"--rig", !options.rig.empty()}}, "cannot be used with a map");
    libmap::require_readable_file(options.input);
  }
  libmap::bag_format_of(options.output);  // throws Error
  try {
    return rig ? write_rig_folder_bag(options, run) : write_map_bag(options, run);
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(options.input) : error;
  }
}

// Throws Error for a folder that is both a scan and a bag or rig, such as a recorded data set.
void require_no_scan(const fs::path& input) {
  namespace files = libmap::frame_folder_files;
  for (const char* name : {files::nodes, files::associations, files::depth_list})
    if (fs::exists(input / name))
      throw libmap::Error(
          fmt::format("is ambiguous: contains {} of a scan and files of a rig or bag", name),
          {.file = input.string()});
}

void run_bag(const BagCommandOptions& options, Run& run) {
  require_no_scan(options.input);
  if (!libmap::is_bag_path(options.input)) return write_bag(options, run);
  if (libmap::has_bag_extension(options.output))
    throw libmap::Error("input and output cannot both be bags", {.file = options.input});
  refuse_map_options(options, "requires a bag as output");
  if (fs::path(options.output).has_extension()) {
    libmap::require_cloud_format(options.output);
    reject_given({{"--rig", !options.rig.empty()}}, "cannot be used with a cloud output");
    return read_bag_into_cloud(options, run);
  }
  read_bag_into_folder(options, run);
}

}  // namespace

int graspmap_tools::convert_bag(int argc, char** argv) {
  BagCommandOptions options;
  Command command("convert",
                  "With a ROS bag: reads depth images or a cloud from a bag, or writes a map or a "
                  "rig's images to one.");
  command.input(
      "IN", options.input,
      "bag to read: .bag (ROS 1), .mcap, .db3 or its folder (ROS 2); for writing a bag: a map "
      "(.pcd, .ply, .csv, .tif), or a rig's folder in the format of `fuse`");
  command.output(
      options.output,
      "when reading a bag: folder of a rig (no extension) with its depth images, or a file for one "
      "of its clouds (.pcd, .ply, .vtp, .csv); bag to write: OUT.bag (ROS 1), OUT.mcap, or a "
      "folder (no extension) of .db3 (ROS 2)");
  command.option("--topic", "[NAME=]TOPIC", options.topics,
                 "topic to read: depth images of the camera NAME (repeatable; default: all "
                 "cameras), or a cloud (default: the only topic of clouds)");
  command.option(
      "--rig", "FILE|NAME", options.rig,
      "rig file, or rig of the toolkit; default: the bag's camera infos and transforms, or the "
      "rig.yaml in the rig's folder");
  command.option("--terrain", "CLOUD", options.terrain, "terrain cloud, for the topic /merged_pcd");
  command.option("--curvature", "CLOUD", options.curvature,
                 "cloud for the topic /curvature_map; default: the map with computed curvatures");
  command.option("--footholds", "FOOTHOLDS", options.footholds,
                 "footholds of the map, written to the topics /footholds and /foothold_poses");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { run_bag(options, run); });
}
