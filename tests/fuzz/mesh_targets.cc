// Files that hold meshes alone, and models with images.
#include <map>

#include "libmap/camera/image_codec.h"
#include "libmap/io/mesh_io.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"
#include "tests/libmap/texture/textured_samples.h"

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;

constexpr const char* obj = ".obj";
constexpr const char* off = ".off";
constexpr const char* stl = ".stl";
constexpr const char* glb = ".glb";

template <const char* const& extension>
bool run_mesh(std::string_view bytes) {
  static const ScratchFile file(std::string("mesh") + extension);
  file.write(bytes);
  if (libmap::is_textured_format(file.path()))
    accepts([&] { libmap::read_textured_mesh(file.path()); });
  return accepts([&] { libmap::read_mesh(file.path()); });
}

libmap::TriangleMesh small_mesh() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return mesh;
}

template <const char* const& extension>
Seeds mesh_seeds() {
  Seeds seeds;
  for (const auto encoding : {libmap::FileEncoding::ascii, libmap::FileEncoding::binary})
    seeds.push_back(written(std::string("mesh") + extension, [&](const fs::path& path) {
      libmap::write_mesh(path, small_mesh(), {.encoding = encoding});
    }));
  return seeds;
}

libmap::TexturedMesh small_model() {
  libmap::TexturedMesh model;
  model.mesh = small_mesh();
  model.page_of_triangle = {0, 0, 0, libmap::no_page};
  model.texture_coordinates.resize(4);
  for (auto& corners : model.texture_coordinates)
    corners = {Eigen::Vector2f(0.0F, 0.0F), Eigen::Vector2f(1.0F, 0.0F),
               Eigen::Vector2f(0.0F, 1.0F)};
  model.pages.emplace_back(2, 2);
  return model;
}

Seeds glb_seeds() {
  Seeds seeds = mesh_seeds<glb>();
  seeds.push_back(written("model.glb", [&](const fs::path& path) {
    graspmap_test::write_textured_mesh(path, small_model());
  }));
  return seeds;
}

// A model and its materials; of its images there is one.
bool run_textured_obj(std::string_view bytes) {
  static const ScratchFile model("model/model.obj");
  static const ScratchFile materials("model/model.mtl");
  static const ScratchFile image("model/model_0.png");
  image.write(libmap::encode_png(libmap::ColorImage(2, 2)));
  model.write(take_file(bytes));
  materials.write(bytes);
  return accepts([&] { libmap::read_textured_mesh(model.path()); });
}

Seeds textured_obj_seeds() {
  const libmap::TexturedMesh model = small_model();
  std::map<std::string, std::string> files;  // by extension
  for (const libmap::ModelFile& file : libmap::textured_mesh_files("model.obj", model, {}))
    files[file.path.extension()] = written(file.path.filename(), file.write);
  return {files.at(".obj") + '\f' + files.at(".mtl")};
}

}  // namespace

std::vector<FuzzTarget> mesh_targets() {
  return {
      {"glb", "GLB models", run_mesh<glb>, glb_seeds},
      {"obj", "OBJ meshes", run_mesh<obj>, mesh_seeds<obj>},
      {"off", "OFF meshes", run_mesh<off>, mesh_seeds<off>},
      {"stl", "STL meshes", run_mesh<stl>, mesh_seeds<stl>},
      {"textured_obj", "OBJ models with materials", run_textured_obj, textured_obj_seeds},
  };
}

}  // namespace graspmap_fuzz
