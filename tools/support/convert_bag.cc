// graspmap convert BAG, and ... -o BAG: bags of ROS 1 and ROS 2 in and out, offline.
#include "tools/support/convert_bag.h"

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/rig_io.h"
#include "tools/support/command_line.h"
#include "tools/support/option_values.h"
#include "tools/support/usages.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

void bind(libmap::ParameterTable& table, BagCommandOptions& options) {
  table.add("stamp_s", options.stamp,
            "out of a bag: the moment, or the cloud, nearest to it alone (auto: all moments; the "
            "cloud of most points); a map into a bag: of all messages (auto: the inputs' own)");
  table.add("strict", options.strict, "end with an error if an image cannot be used");
  bind(table, options.depth);
  table.add("frame", options.frame,
            "frame_id of the map's points in the bag; auto: as their manifest says");
  table.add("stamp_offset_s", options.stamp_offset_s, libmap::any_number,
            "added to the stamps of a rig's images, s");
  table.add("arrow_m", options.arrow_m, libmap::positive, "length of the footholds' arrows, m");
  table.add("cell_size_m", options.cell_size_m, libmap::not_negative,
            "cells of the map's grids in a bag of ROS 2, m (0: the map's voxel size)");
  table.add("compression", options.compression, libmap::bag_compression_names(),
            "of the bag written: bz2 or lz4 in .bag, lz4 or zstd in .mcap");
}

void refuse_map_options(const BagCommandOptions& options, const std::string& reason) {
  refuse_given({{"--terrain", !options.terrain.empty()},
                {"--curvature", !options.curvature.empty()},
                {"--footholds", !options.footholds.empty()}},
               reason);
}

void write_bag(const BagCommandOptions& options, Run& run) {
  const bool rig = fs::is_directory(options.input);
  refuse_given({{"--topic", !options.topics.empty()}},
               rig ? "is not for a rig's folder" : "is not for a map");
  if (rig) {
    refuse_map_options(options, "is not for a rig's folder");
    refuse_given({{"--stamp", options.stamp != "auto"}},
                 "is not for a rig's folder: --stamp-offset moves its stamps");
    if (options.rig.empty() && !fs::exists(fs::path(options.input) / libmap::rig_file_name))
      throw libmap::Error("a bag is made of a map's file, or of a folder with rig.yaml (--rig)",
                          {.file = options.input});
  } else {
    refuse_given({{"--rig", !options.rig.empty()}}, "is not for a map");
    libmap::require_readable_file(options.input);
  }
  libmap::bag_format_of(options.output);  // throws Error
  try {
    return rig ? write_rig_folder_bag(options, run) : write_map_bag(options, run);
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(options.input) : error;
  }
}

// A folder may be a bag or a rig and a scan at once, such as a data set beside its recording.
void require_no_scan(const fs::path& input) {
  namespace files = libmap::frame_folder_files;
  for (const char* name : {files::nodes, files::associations, files::depth_list})
    if (fs::exists(input / name))
      throw libmap::Error(
          fmt::format("is a scan by its {}, but also the folder of a rig or a bag", name),
          {.file = input.string()});
}

void run_bag(const BagCommandOptions& options, Run& run) {
  require_no_scan(options.input);
  if (!libmap::is_bag_path(options.input)) return write_bag(options, run);
  if (libmap::has_bag_extension(options.output))
    throw libmap::Error("one of the two must be something else than a bag",
                        {.file = options.input});
  refuse_map_options(options, "is for a bag that is written");
  if (fs::path(options.output).has_extension()) {
    libmap::require_cloud_format(options.output);
    refuse_given({{"--rig", !options.rig.empty()}}, "is not for a cloud");
    return read_bag_into_cloud(options, run);
  }
  read_bag_into_folder(options, run);
}

}  // namespace

std::optional<double> graspmap_tools::bag_stamp(const BagCommandOptions& options) {
  return parse_number_or("auto", options.stamp, "no such time", "--stamp",
                         "a number of seconds, or auto");
}

libmap::CameraRig graspmap_tools::read_named_rig(const std::string& name, Run& run) {
  const fs::path file = fs::exists(name) ? fs::path(name) : libmap::find_data_file("rigs", name);
  libmap::CameraRig rig = libmap::read_rig(file);
  run.add_input(file);
  return rig;
}

int graspmap_tools::convert_bag(int argc, char** argv) {
  BagCommandOptions options;
  Command command("convert",
                  "With a ROS bag: depth images or a cloud out of it, or a map or a rig's images "
                  "into it.");
  command.input(
      "IN", options.input,
      "out of a bag: .bag (ROS 1), .mcap, .db3 or its folder (ROS 2); into one: a map (.pcd, "
      ".ply, .csv, .tif), or a rig's folder as `fuse` reads it");
  command.output(
      options.output,
      "out of a bag: a rig's folder (no extension) of its depth images, or one of its "
      "clouds (.pcd, .ply, .vtp, .csv); into one: OUT.bag (ROS 1), OUT.mcap, or a folder (no "
      "extension) of .db3 (ROS 2)");
  command.option("--topic", "[NAME=]TOPIC", options.topics,
                 "topics of depth images, or of the cloud (repeatable); else all that are found");
  command.option("--rig", "FILE|NAME", options.rig,
                 "the rig, instead of the bag's camera infos and transforms, or of DIR/rig.yaml");
  command.option("--terrain", "CLOUD", options.terrain, "cloud for /merged_pcd");
  command.option("--curvature", "CLOUD", options.curvature,
                 "cloud for /curvature_map, instead of the map with its own curvatures");
  command.option("--footholds", "FOOTHOLDS", options.footholds,
                 "footholds of the map for /footholds and /foothold_poses");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { run_bag(options, run); });
}
