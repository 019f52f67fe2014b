// graspmap convert: conversion of clouds, meshes, poses, maps and DEMs between formats.
#include <algorithm>
#include <set>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/single_precision.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/raster/dem_reader.h"
#include "libmap/scan/rig_io.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"
#include "tools/support/subcommands.h"

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;
using libmap::FileEncoding;
using libmap::TrajectoryFormat;

struct ConvertOptions {
  std::vector<std::string> inputs;
  std::string input;  // the single input
  std::string output;
  libmap::GeometryWriteOptions writing;
  double pixel_size_m = 0.0;
  TrajectoryFormat poses_format = TrajectoryFormat::automatic;
  TrajectoryFormat output_poses_format = TrajectoryFormat::automatic;
};

bool holds_poses(const ConvertOptions& options) {
  return libmap::is_trajectory_path(options.input) || libmap::is_trajectory_path(options.output) ||
         options.poses_format != TrajectoryFormat::automatic ||
         options.output_poses_format != TrajectoryFormat::automatic;
}

bool holds_meshes_alone(const std::string& path) {
  const std::string format = libmap::format_of(path);
  return format == ".obj" || format == ".stl" || format == ".off" || format == ".glb";
}

libmap::PointCloud vertices_of(const libmap::TriangleMesh& mesh) {
  libmap::PointCloud cloud;
  cloud.positions = mesh.vertices;
  cloud.normals = mesh.vertex_normals;
  cloud.colors = mesh.vertex_colors;
  cloud.fields = mesh.vertex_fields;
  return cloud;
}

// Adds the input and copies its manifest's data on frame, zero plane, lattice and method. Called
// after reading, so that unreadable files are not hashed.
void add_input(const ConvertOptions& options, Run& run) {
  run.add_input(options.input);
  if (const auto source = libmap::read_manifest_of(options.input))
    copy_missing_entries(*source, run);
  copy_georeference(options.input, run);
}

// Throws Error for options that the output's format does not have.
void refuse_ignored(const ConvertOptions& options) {
  const std::string format = libmap::format_of(options.output);
  if (options.writing.encoding == FileEncoding::binary_compressed && format != ".pcd")
    throw libmap::Error(
        "can be written only to .pcd",
        {.file = options.output, .field = "--encoding", .value = "binary_compressed"});
  if (options.pixel_size_m > 0.0 && !libmap::is_dem_path(options.output))
    throw libmap::Error("requires .tif output", {.file = options.output, .field = "--pixel-size"});
  if (options.writing.big_endian && format != ".ply")
    throw libmap::Error("requires .ply output", {.file = options.output, .field = "--big-endian"});
}

// Maximum rounding error of the coordinates in single precision, m.
double rounding_of(const std::vector<Eigen::Vector3d>& positions) {
  double most = 0.0;
  for (const Eigen::Vector3d& position : positions)
    most = std::max(most, (libmap::rounded_to_single(position) - position).cwiseAbs().maxCoeff());
  return most;
}

// Warns about data of the mesh that the output's format cannot store.
void tell_losses(const libmap::TriangleMesh& mesh, const std::string& format, Run& run) {
  const bool geometry_alone = format == ".stl" || format == ".off";
  const bool no_fields = geometry_alone || format == ".obj" || format == ".glb";
  std::vector<std::string> lost;
  if (geometry_alone && !mesh.vertex_colors.empty()) lost.emplace_back("colors");
  if (no_fields)
    for (const auto* fields : {&mesh.vertex_fields, &mesh.face_fields})
      for (const libmap::ScalarField& field : *fields) lost.push_back(field.name);
  if (!lost.empty()) run.warn("{} cannot store: {}", format, fmt::join(lost, ", "));
  constexpr double told_m = 1e-5;
  if (const double moved_m = rounding_of(mesh.vertices);
      (format == ".stl" || format == ".glb") && moved_m > told_m)
    run.warn("{} stores single precision: coordinates change by up to {:.3g} mm", format,
             1e3 * moved_m);
}

void convert_cloud(const ConvertOptions& options, Run& run) {
  const libmap::CloudReadResult read = libmap::read_cloud(options.input);
  if (read.dropped_points > 0)
    run.warn("{} points without a position were dropped", read.dropped_points);
  if (holds_meshes_alone(options.output))
    throw libmap::Error("this format stores meshes only, and a cloud has no faces",
                        {.file = options.output});
  run.add_results({{"points", read.cloud.size()}});
  add_input(options, run);
  if (libmap::is_dem_path(options.output)) {
    const auto visit_cloud = [&](const auto& visit) { visit(read.cloud); };
    return write_raster(
        options.output,
        in_file(options.input,
                [&] { return raster_of(visit_cloud, run.manifest(), options.pixel_size_m); }),
        run);
  }
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_cloud(temporary, read.cloud, options.writing);
  });
}

// Reads a model; if its texture cannot be read, only its mesh.
libmap::TexturedMesh read_model(const std::string& file, Run& run) {
  try {
    return libmap::read_textured_mesh(file);
  } catch (const libmap::Error& error) {
    libmap::TexturedMesh model;
    model.mesh = libmap::read_mesh(file).mesh;
    run.warn("the texture is not written: {}", error.what());
    return model;
  }
}

// Converts with textures if both formats have them. Returns true if it did.
bool convert_textured(const ConvertOptions& options, Run& run) {
  if (!libmap::is_textured_format(options.input)) return false;
  const libmap::TexturedMesh model = read_model(options.input, run);
  if (model.pages.empty()) return false;
  if (!libmap::is_textured_format(options.output)) {
    run.warn("the texture is not written; only .obj and .glb can store it");
    return false;
  }
  const libmap::TexturedMeshWriteOptions writing;
  run.require_own_companions(options.output,
                             libmap::additional_model_files(options.output, writing));
  run.add_results({{"pages", model.pages.size()}});
  add_input(options, run);
  Run::Files writers;
  for (const libmap::ModelFile& file : libmap::textured_mesh_files(options.output, model, writing))
    writers.emplace_back(file.path, file.write);
  run.write_outputs(options.output, writers);
  return true;
}

void convert_mesh(const ConvertOptions& options, Run& run) {
  if (libmap::is_dem_path(options.output))
    throw libmap::Error(
        "a mesh is not a raster; resample it first (graspmap resample), or copy a DEM "
        "(gdal_translate)",
        {.file = options.input});
  if (convert_textured(options, run)) return;
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.input).mesh;
  const std::string format = libmap::format_of(options.output);
  tell_losses(mesh, format, run);
  const bool to_cloud = format == ".pcd" || format == ".csv";
  if (to_cloud) run.info("the output contains only the mesh's vertices");
  run.add_results({{"vertices", mesh.vertices.size()}, {"triangles", mesh.triangles.size()}});
  add_input(options, run);
  run.write_output(options.output, [&](const auto& temporary) {
    if (to_cloud)
      libmap::write_cloud(temporary, vertices_of(mesh), options.writing);
    else
      libmap::write_mesh(temporary, mesh, options.writing);
  });
}

void convert_poses(const ConvertOptions& options, Run& run) {
  const bool named = options.output_poses_format != TrajectoryFormat::automatic;
  if (!named) libmap::require_trajectory_format(options.output);
  const libmap::TrajectoryFile read = libmap::read_trajectory(options.input, options.poses_format);
  if (!read.images.empty() || read.of_cameras)
    throw libmap::Error("contains poses of cameras; base poses require the scan (fuse --poses)",
                        {.file = options.input});
  run.add_results({{"poses", read.poses.size()}, {"links", read.links.size()}});
  add_input(options, run);
  const bool nodes = read.poses.front().node != 0;
  const auto is_output = [&](TrajectoryFormat format, const char* extension) {
    return named ? options.output_poses_format == format
                 : fs::path(options.output).extension() == extension;
  };
  if (!nodes &&
      (is_output(TrajectoryFormat::g2o, ".g2o") || is_output(TrajectoryFormat::toro, ".toro")))
    run.warn("the poses have no node ids; their positions 1, 2, ... in the file become vertex ids");
  run.write_output(options.output, [&](const auto& temporary) {
    if (named)
      libmap::write_trajectory_as(options.output_poses_format, temporary, read, nodes);
    else
      libmap::write_trajectory(temporary, read, nodes);
  });
}

// Returns true if a DEM is converted to points without triangles.
bool is_dem_as_cloud(const ConvertOptions& options) {
  const std::string format = libmap::format_of(options.output);
  return libmap::is_dem_path(options.input) && (format == ".pcd" || format == ".csv");
}

void convert(ConvertOptions& options, Run& run) {
  options.input = options.inputs.front();
  if (options.inputs.size() > 1)
    throw libmap::Error(
        "is a second input; only a tile store merges maps (score --tile K/N -o MAP.tiles)",
        {.file = options.inputs[1]});
  if (is_tile_store(options.input)) {
    refuse_ignored(options);
    return merge_store(options.input, options.output, {options.writing, options.pixel_size_m}, run);
  }
  const bool poses = holds_poses(options);
  if (!poses) refuse_ignored(options);
  run.claim_output(options.output, {options.input});
  if (poses)
    convert_poses(options, run);
  else if (libmap::file_kind(options.input) == libmap::FileKind::mesh && !is_dem_as_cloud(options))
    convert_mesh(options, run);
  else
    convert_cloud(options, run);
}

int convert_file(int argc, char** argv) {
  ConvertOptions options;
  Command command("convert");
  command.inputs("IN", options.inputs,
                 "cloud (.pcd .ply .csv), mesh (.ply .obj .stl ...), DEM (.tif), poses (.tum "
                 ".kitti .g2o .toro ...), or tile store (.tiles)");
  command.output(options.output,
                 "output file, whose extension determines the format, e.g. .vtp for ParaView or "
                 ".tif (GeoTIFF) for GIS; of a tile store: the whole map, with the same bytes as "
                 "from one run of score");
  command.parameters().add("encoding", options.writing.encoding,
                           {{"ascii", FileEncoding::ascii},
                            {"binary", FileEncoding::binary},
                            {"binary_compressed", FileEncoding::binary_compressed}},
                           "encoding of the output, if its format has several");
  command.parameters().add("big_endian", options.writing.big_endian,
                           "write binary PLY in big-endian order");
  command.parameters().add("pixel_size_m", options.pixel_size_m, libmap::not_negative,
                           "pixel size of a .tif output, m; 0: the map's voxel size");
  command.parameters().add("poses_format", options.poses_format, libmap::trajectory_format_names(),
                           "format of the input poses; auto: by extension, else by content");
  command.parameters().add(
      "output_poses_format", options.output_poses_format, libmap::trajectory_format_names(),
      "format of the output poses; auto: by extension; RTAB-Map's export formats are 0 kitti, 1 "
      "tum-motion-capture, 2 kitti-optical, 3 toro, 4 g2o, 10 and 11 tum");
  return command.run(argc, argv, [&](Run& run) { convert(options, run); });
}

// Arguments of a command line before parsing; values of options are also in `inputs`.
struct Words {
  std::vector<std::string> inputs;
  std::vector<std::string> options;
  fs::path output;

  bool any_input(const std::function<bool(const std::string&)>& is) const {
    return std::any_of(inputs.begin(), inputs.end(), is);
  }
  bool any_option(const std::set<std::string>& names) const {
    return std::any_of(options.begin(), options.end(),
                       [&](const std::string& option) { return names.contains(option); });
  }
};

Words words_of(int argc, char** argv) {
  Words words;
  for (int n = 1; n < argc; ++n) {
    const std::string word = argv[n];
    const std::string option = word.substr(0, word.find('='));
    if (word == "-o" || word == "--output") {
      if (n + 1 < argc) words.output = argv[++n];
    } else if (option == "--output" || word.starts_with("-o")) {
      words.output = word.substr(option == "--output" ? option.size() + 1 : 2);
    } else if (word.starts_with("-")) {
      words.options.push_back(option);
    } else {
      words.inputs.push_back(word);
    }
  }
  return words;
}

bool is_rig_folder(const std::string& path) {
  std::error_code code;
  return fs::exists(fs::path(path) / libmap::rig_file_name, code);
}

bool has_cloud_extension(const std::string& path) {
  const std::string format = libmap::format_of(path);
  return format == ".pcd" || format == ".ply" || format == ".csv" || format == ".vtp" ||
         libmap::is_dem_path(path);
}

// Selects the subcommand. A scan is a database or a folder of frames; other folders that are
// converted to a file are, for example, models of COLMAP. An output without an extension is
// otherwise a bag, of a rig or of one map; several inputs are an error.
Subcommand* subcommand_of(const Words& words) {
  if (is_world_path(words.output)) return convert_world;
  if (words.any_input([](const std::string& word) { return word.ends_with(".db"); }))
    return convert_scan;
  if (libmap::has_bag_extension(words.output) || words.any_input(libmap::is_bag_path) ||
      words.any_input(is_rig_folder) ||
      words.any_option({"--topic", "--rig", "--terrain", "--curvature", "--footholds"}))
    return convert_bag;
  if (words.output.has_extension()) return convert_file;
  if (words.any_input(is_scan_path)) return convert_scan;
  const bool is_map =
      !words.output.empty() &&
      std::count_if(words.inputs.begin(), words.inputs.end(), has_cloud_extension) == 1 &&
      !words.any_option({"--encoding", "--big-endian", "--pixel-size", "--poses-format",
                         "--output-poses-format"});
  return is_map ? convert_bag : convert_file;
}

}  // namespace

int main(int argc, char** argv) {
  return run_subcommand(argc, argv, {convert_file, convert_scan, convert_bag, convert_world},
                        subcommand_of(words_of(argc, argv)));
}
