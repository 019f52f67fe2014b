#include "libmap/mesh/guarded_model.h"

#include <string>
#include <vector>

#include "libmap/core/guarded_process.h"

namespace libmap {

namespace {

// assimp's scene, our mesh and its bytes; a line of OBJ becomes some hundred bytes.
constexpr std::uint64_t min_memory = std::uint64_t{1} << 30;
constexpr std::uint64_t memory_per_byte = 100;

constexpr const char* broken = "is broken: the library for its format crashed on it";

// Both ways: pass(array) of each in turn, `pictures` being as many as there are.
template <typename Pass>
void pass_arrays(DecodedModel& decoded, std::vector<char>& pictures, const Pass& pass) {
  TexturedMesh& model = decoded.model;
  pass(model.mesh.vertices);
  pass(model.mesh.triangles);
  pass(model.mesh.vertex_normals);
  pass(model.mesh.vertex_colors);
  pass(model.texture_coordinates);
  pass(model.page_of_triangle);
  pass(pictures);
  decoded.pictures.resize(pictures.size());
  for (TexturePicture& picture : decoded.pictures) {
    pass(picture.bytes);
    pass(picture.path);
  }
}

}  // namespace

DecodedModel decode_guarded(std::uint64_t file_bytes, const std::function<DecodedModel()>& decode) {
  GuardedProcess process(
      min_memory + memory_per_byte * file_bytes, [&](const GuardedProcess::Write& write) {
        try {
          DecodedModel decoded = decode();
          std::vector<char> pictures(decoded.pictures.size());
          send_error(write, nullptr);
          pass_arrays(decoded, pictures, [&](const auto& array) { send_array(write, array); });
        } catch (const Error& error) {
          send_error(write, &error);
        }
      });
  receive_error(process, broken);
  DecodedModel decoded;
  std::vector<char> pictures;
  pass_arrays(decoded, pictures, [&](auto& array) { receive_array(process, broken, array); });
  return decoded;
}

}  // namespace libmap
