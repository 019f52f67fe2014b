// graspmap convert: any format to any other.
#include <fmt/format.h>

#include <string>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/mesh/mesh_io.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;
using libmap::FileEncoding;

struct ConvertOptions {
  std::string input;
  std::string output;
  FileEncoding encoding = FileEncoding::binary;
  bool big_endian = false;
};

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

void convert_cloud(const ConvertOptions& options, Run& run) {
  const libmap::CloudReadResult read = libmap::read_cloud(options.input);
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

// The manifest of a converted map still says in which frame it is.
void keep_frame(const ConvertOptions& options, Run& run) {
  run.add_input(options.input);
  if (const auto source = libmap::read_manifest_of(options.input)) {
    run.manifest().frame = source->frame;
    run.manifest().transforms = source->transforms;
  }
}

void convert(const ConvertOptions& options, Run& run) {
  libmap::format_of(options.output);
  run.claim_output(options.output, {options.input});
  const libmap::FileKind kind = libmap::file_kind(options.input);
  keep_frame(options, run);
  if (kind == libmap::FileKind::mesh)
    convert_mesh(options, run);
  else
    convert_cloud(options, run);
}

}  // namespace

int main(int argc, char** argv) {
  ConvertOptions options;
  graspmap_tools::Command command("convert", "Any format of clouds, maps and meshes to any other.");
  command.input("IN", options.input, "cloud (.pcd .ply .vtp .csv) or mesh (.ply .obj .stl ...)");
  command.input("OUT", options.output, "the same in the format of this extension");
  command.parameters().add("encoding", options.encoding,
                           {{"ascii", FileEncoding::ascii},
                            {"binary", FileEncoding::binary},
                            {"binary_compressed", FileEncoding::binary_compressed}},
                           "how numbers are written, where the format has a choice");
  command.parameters().add("big_endian", options.big_endian, "binary PLY with the high byte first");
  return command.run(argc, argv, [&](Run& run) { convert(options, run); });
}
