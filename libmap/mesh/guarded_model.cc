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
class Sender {
 public:
  explicit Sender(const GuardedProcess::Write& write) : write_(write) {}

  template <typename Array>
  void send(const Array& values) {
    const std::uint64_t count = values.size();
    write_({reinterpret_cast<const char*>(&count), sizeof count});
    write_({reinterpret_cast<const char*>(values.data()),
            values.size() * sizeof(typename Array::value_type)});
  }

 private:
  const GuardedProcess::Write& write_;
};

class Receiver {
 public:
  explicit Receiver(GuardedProcess& process) : process_(process) {}

  template <typename Array>
  void receive(Array& values) {
    std::uint64_t count = 0;
    read(&count, sizeof count);
    values.resize(count);
    read(values.data(), values.size() * sizeof(typename Array::value_type));
  }
  std::string text() {
    std::string text;
    receive(text);
    return text;
  }

 private:
  void read(void* bytes, std::size_t count) {
    if (!process_.read(bytes, count))
      throw Error("is broken: the library for its format crashed on it" + process_.end());
  }

  GuardedProcess& process_;
};

void send_model(const DecodedModel& decoded, Sender& sender) {
  const TexturedMesh& model = decoded.model;
  sender.send(std::string());  // no error
  sender.send(model.mesh.vertices);
  sender.send(model.mesh.triangles);
  sender.send(model.mesh.vertex_normals);
  sender.send(model.mesh.vertex_colors);
  sender.send(model.texture_coordinates);
  sender.send(model.page_of_triangle);
  sender.send(std::vector<char>(decoded.pictures.size()));
  for (const TexturePicture& picture : decoded.pictures) {
    sender.send(picture.bytes);
    sender.send(picture.path);
  }
}

void send_error(const Error& error, Sender& sender) {
  for (const std::string& text :
       {error.reason(), error.context().field, error.context().value, error.context().bound})
    sender.send(text);
}

DecodedModel receive_model(Receiver& receiver) {
  if (const std::string reason = receiver.text(); !reason.empty()) {
    ErrorContext context;
    context.field = receiver.text();
    context.value = receiver.text();
    context.bound = receiver.text();
    throw Error(reason, context);
  }
  DecodedModel decoded;
  TexturedMesh& model = decoded.model;
  receiver.receive(model.mesh.vertices);
  receiver.receive(model.mesh.triangles);
  receiver.receive(model.mesh.vertex_normals);
  receiver.receive(model.mesh.vertex_colors);
  receiver.receive(model.texture_coordinates);
  receiver.receive(model.page_of_triangle);
  std::vector<char> pictures;
  receiver.receive(pictures);
  decoded.pictures.resize(pictures.size());
  for (TexturePicture& picture : decoded.pictures) {
    picture.bytes = receiver.text();
    picture.path = receiver.text();
  }
  return decoded;
}

}  // namespace

DecodedModel decode_guarded(std::uint64_t file_bytes, const std::function<DecodedModel()>& decode) {
  GuardedProcess process(min_memory + memory_per_byte * file_bytes,
                         [&](const GuardedProcess::Write& write) {
                           Sender sender(write);
                           try {
                             send_model(decode(), sender);
                           } catch (const Error& error) {
                             send_error(error, sender);
                           }
                         });
  Receiver receiver(process);
  return receive_model(receiver);
}

}  // namespace libmap
