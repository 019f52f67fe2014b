#include "libmap/mesh/glb_writer.h"

#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>

#include "libmap/core/error.h"
#include "libmap/mesh/texture_corners.h"

namespace libmap {

namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "glTF is little-endian");

// glTF's numbers for types, targets, filters and wrapping (OpenGL's).
constexpr int type_float = 5126;
constexpr int type_uint32 = 5125;
constexpr int target_vertices = 34962;
constexpr int target_indices = 34963;
constexpr int filter_linear = 9729;
constexpr int filter_mipmap_linear = 9987;
constexpr int clamp_to_edge = 33071;

// The binary part: pieces at multiples of 4 bytes, each a buffer view.
class Binary {
 public:
  template <typename T>
  std::size_t add(std::span<const T> values, int target = 0) {
    const std::size_t bytes = values.size_bytes();
    views_.push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes}});
    if (target != 0) views_.back()["target"] = target;
    const std::size_t start = bytes_.size();
    bytes_.resize((start + bytes + 3) / 4 * 4, '\0');
    if (bytes > 0) std::memcpy(bytes_.data() + start, values.data(), bytes);
    return views_.size() - 1;
  }
  const std::string& bytes() const { return bytes_; }
  const Json& views() const { return views_; }

 private:
  std::string bytes_;
  Json views_ = Json::array();
};

using Float3 = std::array<float, 3>;
using Float2 = std::array<float, 2>;

Float3 y_up(const Eigen::Vector3f& v) { return {v.x(), v.z(), -v.y()}; }

Json accessor(std::size_t view, int type, std::size_t count, const char* shape) {
  return {{"bufferView", view}, {"componentType", type}, {"count", count}, {"type", shape}};
}

class GlbBuilder {
 public:
  GlbBuilder(const TexturedMesh& model, const TexturedMeshWriteOptions& options)
      : model_(model), corners_(unite_corners(model)) {
    json_["asset"] = {{"version", "2.0"}, {"generator", "graspmap"}};
    json_["extensionsUsed"] = {"KHR_materials_unlit"};
    json_["scene"] = 0;
    json_["scenes"] = {{{"nodes", {0}}}};
    json_["nodes"] = {{{"mesh", 0}}};
    json_["materials"] = Json::array();
    json_["accessors"] = Json::array();
    add_vertices();
    add_pictures(options);
    add_primitives();
    json_["bufferViews"] = binary_.views();
    json_["buffers"] = {{{"byteLength", binary_.bytes().size()}}};
  }

  std::string bytes() const {
    std::string text = json_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const std::size_t length = 12 + 8 + text.size() + 8 + binary_.bytes().size();
    if (length > std::numeric_limits<std::uint32_t>::max())
      throw Error("too large for a .glb file", {.file = {},
                                                .field = "size",
                                                .value = std::to_string(length) + " bytes",
                                                .bound = "< 4 GB"});
    std::string result;
    result.reserve(length);
    const auto word = [&result](std::size_t value) {
      const auto word32 = static_cast<std::uint32_t>(value);
      result.append(reinterpret_cast<const char*>(&word32), sizeof(word32));
    };
    constexpr std::uint32_t magic = 0x46546C67;
    constexpr std::uint32_t chunk_json = 0x4E4F534A;
    constexpr std::uint32_t chunk_binary = 0x004E4942;
    word(magic);
    word(2);
    word(length);
    word(text.size());
    word(chunk_json);
    result += text;
    word(binary_.bytes().size());
    word(chunk_binary);
    result += binary_.bytes();
    return result;
  }

 private:
  std::size_t add_accessor(Json value) {
    json_["accessors"].push_back(std::move(value));
    return json_["accessors"].size() - 1;
  }

  void add_vertices() {
    std::vector<Float3> positions;
    std::vector<Float3> normals;
    std::vector<Float2> coordinates;
    constexpr float infinity = std::numeric_limits<float>::infinity();
    Float3 low{infinity, infinity, infinity};
    Float3 high{-infinity, -infinity, -infinity};
    for (const TextureCorner& corner : corners_.corners) {
      positions.push_back(y_up(model_.mesh.vertices[corner.vertex].cast<float>()));
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], positions.back()[k]);
        high[k] = std::max(high[k], positions.back()[k]);
      }
      if (!model_.mesh.vertex_normals.empty())
        normals.push_back(y_up(unit(model_.mesh.vertex_normals[corner.vertex])));
      coordinates.push_back({corner.coordinate.x(), corner.coordinate.y()});
    }
    const std::size_t count = positions.size();
    Json place = accessor(binary_.add(std::span<const Float3>(positions), target_vertices),
                          type_float, count, "VEC3");
    place["min"] = low;
    place["max"] = high;
    attributes_["POSITION"] = add_accessor(std::move(place));
    if (!normals.empty())
      attributes_["NORMAL"] =
          add_accessor(accessor(binary_.add(std::span<const Float3>(normals), target_vertices),
                                type_float, count, "VEC3"));
    attributes_["TEXCOORD_0"] =
        add_accessor(accessor(binary_.add(std::span<const Float2>(coordinates), target_vertices),
                              type_float, count, "VEC2"));
  }

  // Normals must be of unit length.
  static Eigen::Vector3f unit(const Eigen::Vector3f& normal) {
    const float length = normal.norm();
    return length > 0.0F && std::isfinite(length) ? Eigen::Vector3f(normal / length)
                                                  : Eigen::Vector3f::UnitZ();
  }

  void add_material(const Json& color) {
    Json surface = {{"metallicFactor", 0.0}, {"roughnessFactor", 1.0}};
    surface.update(color);
    json_["materials"].push_back({{"pbrMetallicRoughness", surface},
                                  {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  }

  void add_pictures(const TexturedMeshWriteOptions& options) {
    if (model_.pages.empty()) return;
    json_["samplers"] = {{{"magFilter", filter_linear},
                          {"minFilter", filter_mipmap_linear},
                          {"wrapS", clamp_to_edge},
                          {"wrapT", clamp_to_edge}}};
    json_["textures"] = Json::array();
    json_["images"] = Json::array();
    for (std::size_t page = 0; page < model_.pages.size(); ++page) {
      const std::string bytes = encode_page(model_.pages[page], options);
      const std::size_t view = binary_.add(std::span<const char>(bytes));
      json_["images"].push_back(
          {{"bufferView", view},
           {"mimeType", options.image_format == ImageFormat::png ? "image/png" : "image/jpeg"}});
      json_["textures"].push_back({{"sampler", 0}, {"source", page}});
      add_material({{"baseColorTexture", {{"index", page}}}});
    }
  }

  void add_primitives() {
    Json primitives = Json::array();
    for (std::int32_t page = no_page; page < static_cast<std::int32_t>(model_.pages.size());
         ++page) {
      std::vector<std::uint32_t> indices;
      for (std::size_t t = 0; t < model_.mesh.triangles.size(); ++t)
        if (model_.page_of_triangle[t] == page)
          indices.insert(indices.end(), corners_.of_triangle[t].begin(),
                         corners_.of_triangle[t].end());
      if (indices.empty()) continue;
      const std::size_t material =
          page == no_page ? json_["materials"].size() : static_cast<std::size_t>(page);
      if (page == no_page) plain_material_ = true;
      const std::size_t count = indices.size();
      primitives.push_back(
          {{"attributes", attributes_},
           {"indices", add_accessor(accessor(
                           binary_.add(std::span<const std::uint32_t>(indices), target_indices),
                           type_uint32, count, "SCALAR"))},
           {"material", material}});
    }
    if (plain_material_) add_material({{"baseColorFactor", {0.5, 0.5, 0.5, 1.0}}});
    json_["meshes"] = {{{"primitives", primitives}}};
  }

  const TexturedMesh& model_;
  UnitedCorners corners_;
  Json json_;
  Json attributes_;
  Binary binary_;
  bool plain_material_ = false;
};

}  // namespace

std::string encode_textured_glb(const TexturedMesh& model,
                                const TexturedMeshWriteOptions& options) {
  return GlbBuilder(model, options).bytes();
}

}  // namespace libmap
