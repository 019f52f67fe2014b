#include "libmap/io/assimp_codec.h"

#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <new>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/output_lock.h"
#include "libmap/core/sandboxed_process.h"
#include "libmap/core/text.h"
#include "libmap/io/corner_key.h"

namespace libmap {
namespace {

std::uint8_t to_byte(float fraction) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(fraction, 0.0F, 1.0F) * 255.0F));
}

// glTF's vertex colors are linear (glTF 2.0, 3.9.2), ours sRGB (IEC 61966-2-1).
float linear_of(std::uint8_t byte) {
  const double srgb = byte / 255.0;
  return static_cast<float>(srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4));
}

float srgb_of(float linear) {
  const double light = std::clamp(static_cast<double>(linear), 0.0, 1.0);
  return static_cast<float>(light <= 0.0031308 ? 12.92 * light
                                               : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055);
}

Eigen::Affine3d to_eigen(const aiMatrix4x4& m) {
  Eigen::Affine3d affine = Eigen::Affine3d::Identity();
  affine.matrix().topRows<3>() =
      Eigen::Map<const Eigen::Matrix<ai_real, 3, 4, Eigen::RowMajor>>(&m.a1).cast<double>();
  return affine;
}

// Rotation from y up to z up.
Eigen::Matrix3d z_up_from_y_up() {
  Eigen::Matrix3d rotation;
  rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return rotation;
}

// Material index of a triangle without texture coordinates.
constexpr unsigned no_material = 0xffffffff;

// Collects the parts of a scene in one mesh.
class MeshBuilder {
 public:
  MeshBuilder(const aiScene& scene, const std::string& format)
      : scene_(scene), has_linear_colors_(format == "glb") {
    has_normals_ = format != "stl";
    has_colors_ = true;
    for (unsigned i = 0; i < scene.mNumMeshes; ++i) {
      has_normals_ = has_normals_ && scene.mMeshes[i]->HasNormals();
      has_colors_ = has_colors_ && scene.mMeshes[i]->HasVertexColors(0);
    }
  }

  void add_node(const aiNode& node, const Eigen::Affine3d& root_from_parent) {
    const Eigen::Affine3d root_from_node = root_from_parent * to_eigen(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= scene_.mNumMeshes) throw Error("a node refers to a missing mesh");
      add_mesh(*scene_.mMeshes[node.mMeshes[i]], root_from_node);
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(*node.mChildren[i], root_from_node);
  }
  TriangleMesh take() { return std::move(mesh_); }

  // Texture coordinates, from the top left, and material of each triangle.
  const std::vector<TextureCorners>& coordinates() const { return coordinates_; }
  const std::vector<unsigned>& materials() const { return materials_; }

 private:
  TextureCorners coordinates_of(const aiMesh& part, const std::array<unsigned, 3>& corners) const {
    TextureCorners result;
    result.fill(Eigen::Vector2f::Zero());
    if (!part.HasTextureCoords(0)) return result;
    for (std::size_t k = 0; k < 3; ++k) {
      // assimp's origin is the bottom left in all formats.
      const aiVector3D& c = part.mTextureCoords[0][corners[k]];
      result[k] = {c.x, 1.0F - c.y};
    }
    return result;
  }
  void add_mesh(const aiMesh& part, const Eigen::Affine3d& root_from_node) {
    const Eigen::Matrix3d normal_matrix = root_from_node.linear().inverse().transpose();
    const bool mirrored = root_from_node.linear().determinant() < 0.0;
    std::vector<std::uint32_t> corners;
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices < 3) continue;
      corners.clear();
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] >= part.mNumVertices)
          throw Error("not a vertex index", {.field = "face " + std::to_string(i),
                                             .value = std::to_string(face.mIndices[k])});
        corners.push_back(vertex(part, face.mIndices[k], root_from_node, normal_matrix));
      }
      std::vector<unsigned> indices(face.mIndices, face.mIndices + face.mNumIndices);
      if (mirrored) std::reverse(corners.begin(), corners.end());
      if (mirrored) std::reverse(indices.begin(), indices.end());
      for (std::size_t k = 2; k < corners.size(); ++k) {
        mesh_.triangles.push_back({corners[0], corners[k - 1], corners[k]});
        coordinates_.push_back(coordinates_of(part, {indices[0], indices[k - 1], indices[k]}));
        materials_.push_back(part.HasTextureCoords(0) ? part.mMaterialIndex : no_material);
      }
    }
  }

  // Returns the vertex of a corner: an equal vertex, or a new one.
  std::uint32_t vertex(const aiMesh& part, unsigned index, const Eigen::Affine3d& root_from_node,
                       const Eigen::Matrix3d& normal_matrix) {
    const aiVector3D& p = part.mVertices[index];
    const Eigen::Vector3d position = root_from_node * Eigen::Vector3f(p.x, p.y, p.z).cast<double>();
    if (!position.allFinite())
      throw Error("position is not finite", {.field = "vertex " + std::to_string(index)});
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    if (has_normals_) {
      const aiVector3D& n = part.mNormals[index];
      normal = (normal_matrix * Eigen::Vector3f(n.x, n.y, n.z).cast<double>()).cast<float>();
    }
    Color color{};
    if (has_colors_) {
      const aiColor4D& c = part.mColors[0][index];
      const auto byte = [&](float value) {
        return to_byte(has_linear_colors_ ? srgb_of(value) : value);
      };
      color = {byte(c.r), byte(c.g), byte(c.b)};
    }
    return welder_.vertex(position, has_normals_ ? &normal : nullptr,
                          has_colors_ ? &color : nullptr, mesh_);
  }

  const aiScene& scene_;
  bool has_normals_ = false;
  bool has_colors_ = false;
  bool has_linear_colors_;
  TriangleMesh mesh_;
  std::vector<TextureCorners> coordinates_;
  std::vector<unsigned> materials_;
  CornerWelder welder_;
};

std::unique_ptr<aiNode> make_root(std::size_t parts, bool y_up) {
  auto root = std::make_unique<aiNode>();
  root->mNumMeshes = static_cast<unsigned>(parts);
  root->mMeshes = new unsigned[parts];
  std::iota(root->mMeshes, root->mMeshes + parts, 0U);
  // Rotation from z up to y up, as glTF requires.
  if (y_up) root->mTransformation = aiMatrix4x4(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1);
  return root;
}

void copy_vertices(const TriangleMesh& mesh, aiMesh& part) {
  const std::size_t count = mesh.vertices.size();
  part.mNumVertices = static_cast<unsigned>(count);
  part.mVertices = new aiVector3D[count];
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f p = mesh.vertices[i].cast<float>();
    part.mVertices[i] = aiVector3D(p.x(), p.y(), p.z());
  }
  if (!mesh.vertex_normals.empty()) {
    part.mNormals = new aiVector3D[count];
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3f& n = mesh.vertex_normals[i];
      part.mNormals[i] = aiVector3D(n.x(), n.y(), n.z());
    }
  }
  if (mesh.vertex_colors.empty()) return;
  part.mColors[0] = new aiColor4D[count];
  for (std::size_t i = 0; i < count; ++i) {
    const Color& c = mesh.vertex_colors[i];
    // STL has no colors.
    part.mColors[0][i] = aiColor4D(linear_of(c[0]), linear_of(c[1]), linear_of(c[2]), 1.0F);
  }
}

void copy_faces(const TriangleMesh& mesh, aiMesh& part) {
  part.mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
  part.mNumFaces = static_cast<unsigned>(mesh.triangles.size());
  part.mFaces = new aiFace[mesh.triangles.size()];
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    part.mFaces[i].mNumIndices = 3;
    part.mFaces[i].mIndices = new unsigned[3];
    std::copy(mesh.triangles[i].begin(), mesh.triangles[i].end(), part.mFaces[i].mIndices);
  }
}

// Unlit material, because photographs already contain the scene's illumination.
std::unique_ptr<aiMaterial> make_material(std::int32_t page) {
  auto material = std::make_unique<aiMaterial>();
  // The exporter requires the enumeration's type, not an int.
  const aiShadingMode unlit = aiShadingMode_Unlit;
  material->AddProperty(&unlit, 1, AI_MATKEY_SHADING_MODEL);
  if (page == no_page) {
    const float gray_128 = linear_of(128);
    const aiColor4D gray(gray_128, gray_128, gray_128, 1.0F);
    material->AddProperty(&gray, 1, AI_MATKEY_BASE_COLOR);
    return material;
  }
  const aiString image("*" + std::to_string(page));
  material->AddProperty(&image, AI_MATKEY_TEXTURE(aiTextureType_BASE_COLOR, 0));
  const int clamp = aiTextureMapMode_Clamp;
  material->AddProperty(&clamp, 1, AI_MATKEY_MAPPINGMODE_U(aiTextureType_BASE_COLOR, 0));
  material->AddProperty(&clamp, 1, AI_MATKEY_MAPPINGMODE_V(aiTextureType_BASE_COLOR, 0));
  return material;
}

// A compressed image has height 0; its width is its size in bytes.
std::unique_ptr<aiTexture> make_texture(const EncodedImage& image) {
  auto texture = std::make_unique<aiTexture>();
  texture->mWidth = static_cast<unsigned>(image.bytes.size());
  texture->pcData = new aiTexel[image.bytes.size() / sizeof(aiTexel) + 1];
  std::memcpy(static_cast<void*>(texture->pcData), image.bytes.data(), image.bytes.size());
  image.format.copy(texture->achFormatHint, sizeof(texture->achFormatHint) - 1);
  return texture;
}

void copy_coordinates(const std::vector<Eigen::Vector2f>& coordinates, aiMesh& part) {
  if (coordinates.empty()) return;
  part.mTextureCoords[0] = new aiVector3D[coordinates.size()];
  part.mNumUVComponents[0] = 2;
  // assimp's origin is the bottom left.
  for (std::size_t i = 0; i < coordinates.size(); ++i)
    part.mTextureCoords[0][i] = aiVector3D(coordinates[i].x(), 1.0F - coordinates[i].y(), 0.0F);
}

// The scene takes ownership of its elements.
template <typename T>
T** hang(std::vector<std::unique_ptr<T>>& things, unsigned& count) {
  count = static_cast<unsigned>(things.size());
  T** hung = new T*[things.size()];
  for (std::size_t i = 0; i < things.size(); ++i) hung[i] = things[i].release();
  return hung;
}

std::unique_ptr<aiScene> scene_of(std::vector<std::unique_ptr<aiMesh>> meshes,
                                  std::vector<std::unique_ptr<aiMaterial>> materials, bool y_up) {
  auto scene = std::make_unique<aiScene>();
  scene->mRootNode = make_root(meshes.size(), y_up).release();
  scene->mMeshes = hang(meshes, scene->mNumMeshes);
  scene->mMaterials = hang(materials, scene->mNumMaterials);
  return scene;
}

std::unique_ptr<aiMesh> mesh_of(const TriangleMesh& mesh, unsigned material) {
  auto part = std::make_unique<aiMesh>();
  part->mMaterialIndex = material;
  copy_vertices(mesh, *part);
  copy_faces(mesh, *part);
  return part;
}

// First line of a message, without assimp's name for bytes in memory.
std::string first_line(const char* text) {
  const std::string_view reason = text == nullptr ? "" : text;
  std::string line(reason.substr(0, std::min<std::size_t>(reason.find('\n'), 200)));
  const std::size_t at = line.find("$$$___magic___$$$");
  if (at == std::string::npos) return line;
  return line.replace(at, line.find_first_of("'\" :,", at) - at, "the file");
}

// Texture image of a material's base color; nullopt if it has none.
std::optional<TextureImage> image_of(const aiScene& scene, const aiMaterial& material) {
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
    aiString path;
    if (material.GetTexture(type, 0, &path) != aiReturn_SUCCESS) continue;
    const aiTexture* const embedded = scene.GetEmbeddedTexture(path.C_Str());
    // An image is read once, even if several materials refer to it by different names.
    if (embedded == nullptr)
      return TextureImage{{}, std::filesystem::path(path.C_Str()).lexically_normal().string()};
    // Compressed images have height 0; their width is their size in bytes.
    if (embedded->mHeight != 0) continue;
    return TextureImage{
        std::string(reinterpret_cast<const char*>(embedded->pcData), embedded->mWidth), {}};
  }
  return std::nullopt;
}

DecodedModel model_of(const aiScene& scene, MeshBuilder& builder) {
  DecodedModel result;
  // Pages in the order of the materials; several materials can share an image.
  std::vector<std::int32_t> page_of_material(scene.mNumMaterials, no_page);
  for (unsigned m = 0; m < scene.mNumMaterials; ++m) {
    std::optional<TextureImage> image = image_of(scene, *scene.mMaterials[m]);
    if (!image) continue;
    const auto same =
        std::find_if(result.images.begin(), result.images.end(), [&](const TextureImage& other) {
          return other.path == image->path && other.bytes == image->bytes;
        });
    page_of_material[m] = static_cast<std::int32_t>(same - result.images.begin());
    if (same == result.images.end()) result.images.push_back(std::move(*image));
  }
  result.model.texture_coordinates = builder.coordinates();
  for (const unsigned material : builder.materials())
    result.model.page_of_triangle.push_back(
        material < page_of_material.size() ? page_of_material[material] : no_page);
  result.model.mesh = builder.take();
  return result;
}

// assimp allocates the declared length of the JSON text before it compares it with the file size.
void require_sound_glb(std::string_view header, std::uint64_t bytes) {
  constexpr std::size_t text_length_at = 12;
  constexpr std::size_t text_at = 20;
  std::uint32_t length = 0;
  if (header.size() < text_at || !header.starts_with("glTF"))
    throw Error("not a readable glb file: no header");
  std::memcpy(&length, header.data() + text_length_at, sizeof length);
  if (text_at + std::uint64_t{length} > bytes)
    throw Error("not a readable glb file",
                {.field = "length of the JSON text",
                 .value = std::to_string(length),
                 .bound = "within the file's " + std::to_string(bytes) + " bytes"});
}

// read(importer) returns the scene, take(scene, builder) the result.
template <typename Read, typename Take>
auto decode(const std::string& format, const Read& read, const Take& take) {
  try {
    Assimp::Importer importer;
    // No aiProcess_Triangulate: on some damaged files, it ends the program with an assertion.
    const aiScene* const scene = read(importer);
    if (scene == nullptr || scene->mRootNode == nullptr)
      throw Error("not a readable " + format + " file: " + first_line(importer.GetErrorString()));
    Eigen::Affine3d root = Eigen::Affine3d::Identity();
    if (format == "glb") root.linear() = z_up_from_y_up();
    MeshBuilder builder(*scene, format);
    builder.add_node(*scene->mRootNode, root);
    return take(*scene, builder);
  } catch (const std::bad_alloc&) {
    throw Error("declares more data than fits into memory");
  } catch (const std::length_error&) {
    throw Error("declares more data than fits into memory");
  }
}

// Calls decode() in a child process, because assimp crashes on some damaged files.
DecodedModel decode_guarded(std::uint64_t file_bytes, const std::function<DecodedModel()>& decode) {
  // Memory for assimp's scene, the mesh and its bytes; a line of OBJ needs some hundred bytes.
  const std::uint64_t memory = (std::uint64_t{1} << 30) + 100 * file_bytes;
  return run_sandboxed<DecodedModel>(memory, "is damaged: assimp crashed while it read the file",
                                     decode, [](auto& pipe, DecodedModel& decoded) {
                                       TexturedMesh& model = decoded.model;
                                       pipe.array(model.mesh.vertices);
                                       pipe.array(model.mesh.triangles);
                                       pipe.array(model.mesh.vertex_normals);
                                       pipe.array(model.mesh.vertex_colors);
                                       pipe.array(model.texture_coordinates);
                                       pipe.array(model.page_of_triangle);
                                       pipe.size(decoded.images);
                                       for (TextureImage& image : decoded.images) {
                                         pipe.array(image.bytes);
                                         pipe.array(image.path);
                                       }
                                     });
}

Error not_written(const Assimp::Exporter& exporter) {
  return Error("assimp cannot write the file: " + first_line(exporter.GetErrorString()), {},
               ErrorKind::failed);
}

}  // namespace

TriangleMesh decode_by_assimp(const std::string& bytes, const std::string& format) {
  if (format == "glb") require_sound_glb(bytes, bytes.size());
  const auto read = [&](Assimp::Importer& importer) {
    return importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, format.c_str());
  };
  const auto take = [](const aiScene&, MeshBuilder& builder) {
    DecodedModel result;
    result.model.mesh = builder.take();
    return result;
  };
  return decode_guarded(bytes.size(), [&] { return decode(format, read, take); }).model.mesh;
}

DecodedModel decode_glb_model(const std::filesystem::path& path) {
  require_sound_glb(file_head(path, 20), std::filesystem::file_size(path));
  const auto read = [&](Assimp::Importer& importer) { return importer.ReadFile(path.string(), 0); };
  return decode_guarded(std::filesystem::file_size(path),
                        [&] { return decode("glb", read, model_of); });
}

std::string encode_by_assimp(const TriangleMesh& mesh, const std::string& format, bool ascii) {
  if (mesh.triangles.empty())
    throw Error("there are none, so that the mesh cannot be written as " + format,
                {.field = "triangles"});
  const bool is_glb = format == "glb";
  std::vector<std::unique_ptr<aiMesh>> meshes;
  meshes.push_back(mesh_of(mesh, 0));
  std::vector<std::unique_ptr<aiMaterial>> materials;
  materials.push_back(std::make_unique<aiMaterial>());
  const auto scene = scene_of(std::move(meshes), std::move(materials), is_glb);
  Assimp::Exporter exporter;
  const aiExportDataBlob* const blob = exporter.ExportToBlob(scene.get(), is_glb  ? "glb2"
                                                                          : ascii ? "stl"
                                                                                  : "stlb");
  if (blob == nullptr) throw not_written(exporter);
  return std::string(static_cast<const char*>(blob->data), blob->size);
}

void write_model_by_assimp(const std::filesystem::path& path, std::vector<ModelPart> parts,
                           std::vector<EncodedImage> images) {
  std::vector<std::unique_ptr<aiMesh>> meshes;
  std::vector<std::unique_ptr<aiMaterial>> materials;
  std::vector<std::unique_ptr<aiTexture>> textures;
  // The exporter copies the scene, so the memory of each part is released at once.
  for (ModelPart& part : parts) {
    meshes.push_back(mesh_of(part.mesh, static_cast<unsigned>(materials.size())));
    copy_coordinates(part.texture_coordinates, *meshes.back());
    materials.push_back(make_material(part.page));
    part = {};
  }
  for (EncodedImage& image : images) {
    textures.push_back(make_texture(image));
    image = {};
  }
  const auto scene = scene_of(std::move(meshes), std::move(materials), true);
  scene->mTextures = hang(textures, scene->mNumTextures);
  Assimp::Exporter exporter;
  errno = 0;
  if (exporter.Export(scene.get(), "glb2", path.string()) != aiReturn_SUCCESS) {
    if (errno != 0) throw system_failure(path, "cannot be written", errno);
    throw not_written(exporter);
  }
  const int failure = errno;
  // The header contains the file's length (glTF 2.0, 4.4.2). assimp does not detect write errors
  // when it closes the file.
  std::ifstream file(path, std::ios::binary);
  std::array<std::uint32_t, 3> header{};
  file.read(reinterpret_cast<char*>(header.data()), sizeof header);
  if (!file || header[2] != std::filesystem::file_size(path))
    throw system_failure(path, "cannot be written", failure != 0 ? failure : EIO);
}

}  // namespace libmap
