// graspmap convert: any format to any other.
#include <fmt/format.h>

#include <string>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/poses/trajectory_io.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;
using libmap::FileEncoding;
using libmap::TrajectoryFormat;

struct ConvertOptions {
  std::string input;
  std::string output;
  FileEncoding encoding = FileEncoding::binary;
  bool big_endian = false;
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

bool holds_clouds_alone(const std::string& path) {
  const std::string format = libmap::format_of(path);
  return format == ".pcd" || format == ".csv";
}

libmap::PointCloud vertices_of(const libmap::TriangleMesh& mesh) {
  libmap::PointCloud cloud;
  cloud.positions = mesh.vertices;
  cloud.normals = mesh.vertex_normals;
  cloud.colors = mesh.vertex_colors;
  cloud.fields = mesh.vertex_fields;
  return cloud;
}

// The manifest of a converted map still says in which frame it is. Once it is read: what cannot be
// read need not be hashed.
void add_input(const ConvertOptions& options, Run& run) {
  run.add_input(options.input);
  if (const auto source = libmap::read_manifest_of(options.input)) {
    run.manifest().frame = source->frame;
    run.manifest().transforms = source->transforms;
  }
}

void convert_cloud(const ConvertOptions& options, Run& run) {
  const libmap::CloudReadResult read = libmap::read_cloud(options.input);
  add_input(options, run);
  if (read.dropped_points > 0)
    run.warn(fmt::format("{} points without a position were dropped", read.dropped_points));
  if (holds_meshes_alone(options.output))
    throw libmap::Error("a cloud has no faces: this format holds meshes alone",
                        {.file = options.output});
  run.manifest().results.emplace_back("points", static_cast<std::int64_t>(read.cloud.size()));
  run.write_output(options.output, [&](const auto& temporary) {
    libmap::write_cloud(temporary, read.cloud, {options.encoding, options.big_endian});
  });
}

void convert_mesh(const ConvertOptions& options, Run& run) {
  const libmap::TriangleMesh mesh = libmap::read_mesh(options.input).mesh;
  add_input(options, run);
  const bool to_cloud = holds_clouds_alone(options.output);
  if (to_cloud) run.say("the output holds the mesh's vertices alone");
  run.manifest().results.emplace_back("vertices", static_cast<std::int64_t>(mesh.vertices.size()));
  run.manifest().results.emplace_back("triangles",
                                      static_cast<std::int64_t>(mesh.triangles.size()));
  run.write_output(options.output, [&](const auto& temporary) {
    if (to_cloud)
      libmap::write_cloud(temporary, vertices_of(mesh), {options.encoding, options.big_endian});
    else
      libmap::write_mesh(temporary, mesh, {options.encoding, options.big_endian});
  });
}

void convert_poses(const ConvertOptions& options, Run& run) {
  const bool named = options.output_poses_format != TrajectoryFormat::automatic;
  if (!named) libmap::require_trajectory_format(options.output);
  const libmap::TrajectoryFile read = libmap::read_trajectory(options.input, options.poses_format);
  add_input(options, run);
  if (!read.images.empty())
    throw libmap::Error("poses of photographs: only those of the scan know its base (fuse --poses)",
                        {.file = options.input});
  run.manifest().results.emplace_back("poses", static_cast<std::int64_t>(read.poses.size()));
  run.manifest().results.emplace_back("links", static_cast<std::int64_t>(read.links.size()));
  const bool nodes = read.poses.front().node != 0;
  run.write_output(options.output, [&](const auto& temporary) {
    if (named)
      libmap::write_trajectory_as(options.output_poses_format, temporary, read, nodes);
    else
      libmap::write_trajectory(temporary, read, nodes);
  });
}

void convert(const ConvertOptions& options, Run& run) {
  const bool poses = holds_poses(options);
  if (!poses) libmap::format_of(options.output);
  run.claim_output(options.output, {options.input});
  if (poses)
    convert_poses(options, run);
  else if (libmap::file_kind(options.input) == libmap::FileKind::mesh)
    convert_mesh(options, run);
  else
    convert_cloud(options, run);
}

}  // namespace

int main(int argc, char** argv) {
  ConvertOptions options;
  graspmap_tools::Command command("convert",
                                  "Any format of clouds, maps, meshes and poses to any other.");
  command.input(
      "IN", options.input,
      "cloud (.pcd .ply .vtp .csv), mesh (.ply .obj .stl ...) or poses (.tum .kitti .g2o .toro "
      "...)");
  command.input("OUT", options.output, "the same in the format of this extension");
  command.parameters().add("encoding", options.encoding,
                           {{"ascii", FileEncoding::ascii},
                            {"binary", FileEncoding::binary},
                            {"binary_compressed", FileEncoding::binary_compressed}},
                           "how numbers are written, where the format has a choice");
  command.parameters().add("big_endian", options.big_endian, "binary PLY with the high byte first");
  command.parameters().add("poses_format", options.poses_format, libmap::trajectory_format_names(),
                           "of poses in IN; auto: by its extension, else by its content");
  command.parameters().add(
      "output_poses_format", options.output_poses_format, libmap::trajectory_format_names(),
      "of poses in OUT; auto: by its extension. RTAB-Map's formats are 0 kitti, "
      "1 tum-motion-capture, 2 kitti-optical, 3 toro, 4 g2o, 10 and 11 tum");
  return command.run(argc, argv, [&](Run& run) { convert(options, run); });
}
