#include "libmap/mesh/guarded_model.h"

#include <string>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/guarded_process.h"

namespace libmap {

namespace {

// assimp's scene, our mesh and its bytes; a line of OBJ becomes some hundred bytes.
constexpr std::uint64_t min_memory = std::uint64_t{1} << 30;
constexpr std::uint64_t memory_per_byte = 100;

// Arrays through the pipe: their length, then their bytes.
template <typename Array>
void send(const GuardedProcess::Write& write, const Array& values) {
  const std::uint64_t count = values.size();
  write({reinterpret_cast<const char*>(&count), sizeof count});
  write({reinterpret_cast<const char*>(values.data()), count * sizeof values[0]});
}

template <typename Array>
void receive(GuardedProcess& process, Array& values) {
  const auto read = [&](void* bytes, std::size_t count) {
    if (!process.read(bytes, count))
      throw Error("is broken: the library for its format crashed on it" + process.end());
  };
  std::uint64_t count = 0;
  read(&count, sizeof count);
  values.resize(count);
  read(values.data(), count * sizeof values[0]);
}

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
        const auto pass = [&](const auto& array) { send(write, array); };
        try {
          DecodedModel decoded = decode();
          std::vector<char> pictures(decoded.pictures.size());
          pass(std::string());  // no error
          pass_arrays(decoded, pictures, pass);
        } catch (const Error& error) {
          for (const std::string& text : {error.reason(), error.context().field,
                                          error.context().value, error.context().bound})
            pass(text);
        }
      });
  const auto pass = [&](auto& array) { receive(process, array); };
  std::string reason;
  pass(reason);
  if (!reason.empty()) {
    ErrorContext context;
    for (std::string* text : {&context.field, &context.value, &context.bound}) pass(*text);
    throw Error(reason, context);
  }
  DecodedModel decoded;
  std::vector<char> pictures;
  pass_arrays(decoded, pictures, pass);
  return decoded;
}

}  // namespace libmap
