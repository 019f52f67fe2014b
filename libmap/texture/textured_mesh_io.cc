#include "libmap/texture/textured_mesh_io.h"

#include <cstdint>
#include <limits>
#include <ostream>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/text.h"
#include "libmap/io/assimp_codec.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/io/obj_codec.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

struct TextureCorner {
  std::uint32_t vertex = 0;
  Eigen::Vector2f coordinate = Eigen::Vector2f::Zero();
};

// Merges corners of equal vertex and texture coordinate, in the order of their first use.
struct UnitedCorners {
  std::vector<TextureCorner> corners;
  std::vector<std::array<std::uint32_t, 3>> of_triangle;
};

UnitedCorners unite_corners(const TexturedMesh& model) {
  UnitedCorners result;
  constexpr std::uint32_t none = 0xffffffff;
  // Linked list of the corners of a vertex; few vertices have more than two.
  std::vector<std::uint32_t> newest(model.mesh.vertices.size(), none);
  std::vector<std::uint32_t> older;
  result.of_triangle.resize(model.mesh.triangles.size());
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = model.mesh.triangles[t][k];
      const Eigen::Vector2f& coordinate = model.texture_coordinates[t][k];
      std::uint32_t corner = newest[vertex];
      while (corner != none && result.corners[corner].coordinate != coordinate)
        corner = older[corner];
      if (corner == none) {
        corner = static_cast<std::uint32_t>(result.corners.size());
        result.corners.push_back({vertex, coordinate});
        older.push_back(newest[vertex]);
        newest[vertex] = corner;
      }
      result.of_triangle[t][k] = corner;
    }
  return result;
}

// Encodes a page as an image file.
std::string encode_page(const ColorImage& page, const TexturedMeshWriteOptions& options) {
  return options.image_format == ImageFormat::png ? encode_png(page)
                                                  : encode_jpeg(page, options.jpeg_quality);
}

fs::path material_path(const fs::path& model) {
  return model.parent_path() / (model.stem().string() + ".mtl");
}

std::string material_name(std::int32_t page) {
  return page == no_page ? "plain" : "page_" + std::to_string(page);
}

// Wavefront MTL without lighting.
std::string materials_text(const fs::path& path, const TexturedMesh& model,
                           const TexturedMeshWriteOptions& options) {
  std::string text;
  for (std::int32_t page = no_page; page < static_cast<std::int32_t>(model.pages.size()); ++page) {
    text += "newmtl " + material_name(page) + "\n";
    text += page == no_page ? "Ka 0.5 0.5 0.5\nKd 0.5 0.5 0.5\n" : "Ka 1 1 1\nKd 1 1 1\n";
    text += "Ks 0 0 0\nillum 0\n";
    if (page != no_page)
      text += "map_Kd " +
              texture_page_path(path, static_cast<std::size_t>(page), options.image_format)
                  .filename()
                  .string() +
              "\n";
    text += "\n";
  }
  return text;
}

template <typename Vector>
std::string numbers(const Vector& vector) {
  std::string text;
  for (Eigen::Index i = 0; i < vector.size(); ++i) text += " " + to_text(vector[i]);
  return text + "\n";
}

void write_textured_obj(const fs::path& path, const TexturedMesh& model, std::ostream& out) {
  out << "mtllib " + material_path(path).filename().string() + "\n";
  for (const Eigen::Vector3d& vertex : model.mesh.vertices) out << "v" + numbers(vertex);
  const UnitedCorners united = unite_corners(model);
  for (const TextureCorner& corner : united.corners) {
    // OBJ measures v from the bottom.
    const Eigen::Vector2d uv = corner.coordinate.cast<double>();
    out << "vt" + numbers(Eigen::Vector2f(corner.coordinate.x(), static_cast<float>(1.0 - uv.y())));
  }
  const bool has_normals = !model.mesh.vertex_normals.empty();
  for (const Eigen::Vector3f& normal : model.mesh.vertex_normals) out << "vn" + numbers(normal);
  for (std::int32_t page = no_page; page < static_cast<std::int32_t>(model.pages.size()); ++page) {
    bool named = false;
    for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t) {
      if (model.page_of_triangle[t] != page) continue;
      std::string line = named ? "f" : "usemtl " + material_name(page) + "\nf";
      named = true;
      for (std::size_t k = 0; k < 3; ++k) {
        // OBJ indices begin at 1.
        const std::string vertex = std::to_string(std::uint64_t{model.mesh.triangles[t][k]} + 1);
        line += " " + vertex + "/" + std::to_string(std::uint64_t{united.of_triangle[t][k]} + 1);
        if (has_normals) line += "/" + vertex;
      }
      out << line + "\n";
    }
  }
}

Eigen::Vector3f unit(const Eigen::Vector3f& normal) {
  const float length = normal.norm();
  return length > 0.0F && std::isfinite(length) ? Eigen::Vector3f(normal / length)
                                                : Eigen::Vector3f::UnitZ();
}

// The triangles of one page, with one vertex per distinct texture corner.
ModelPart part_of(const TexturedMesh& model, const UnitedCorners& united, std::int32_t page) {
  ModelPart part;
  part.page = page;
  constexpr auto unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> vertex_of_corner(united.corners.size(), unused);
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t) {
    if (model.page_of_triangle[t] != page) continue;
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const TextureCorner& corner = united.corners[united.of_triangle[t][k]];
      std::uint32_t& vertex = vertex_of_corner[united.of_triangle[t][k]];
      if (vertex == unused) {
        vertex = static_cast<std::uint32_t>(part.mesh.vertices.size());
        part.mesh.vertices.push_back(model.mesh.vertices[corner.vertex]);
        if (!model.mesh.vertex_normals.empty())
          part.mesh.vertex_normals.push_back(unit(model.mesh.vertex_normals[corner.vertex]));
        if (page != no_page) part.texture_coordinates.push_back(corner.coordinate);
      }
      triangle[k] = vertex;
    }
    part.mesh.triangles.push_back(triangle);
  }
  return part;
}

// glTF stores lengths in 32 bits. Assimp does not check them.
void require_room_in_glb(const std::vector<ModelPart>& parts,
                         const std::vector<EncodedImage>& images) {
  std::size_t bytes = std::size_t{1} << 20;  // JSON part
  for (const ModelPart& part : parts)
    bytes += part.mesh.vertices.size() * (3 + 3 + 2) * sizeof(float) +
             part.mesh.triangles.size() * 3 * sizeof(std::uint32_t);
  for (const EncodedImage& image : images) bytes += image.bytes.size();
  if (bytes > std::numeric_limits<std::uint32_t>::max())
    throw Error("too large for .glb; write an .obj instead",
                {.field = "size", .value = std::to_string(bytes) + " bytes", .bound = "< 4 GB"});
}

std::vector<ModelPart> parts_of(const TexturedMesh& model) {
  const UnitedCorners united = unite_corners(model);
  std::vector<ModelPart> parts;
  for (std::int32_t page = no_page; page < static_cast<std::int32_t>(model.pages.size()); ++page) {
    ModelPart part = part_of(model, united, page);
    if (!part.mesh.triangles.empty()) parts.push_back(std::move(part));
  }
  return parts;
}

void write_textured_glb(const fs::path& path, const TexturedMesh& model,
                        const TexturedMeshWriteOptions& options) {
  std::vector<ModelPart> parts = parts_of(model);
  std::vector<EncodedImage> images;
  for (const ColorImage& page : model.pages)
    images.push_back({encode_page(page, options), file_extension(options.image_format).substr(1)});
  require_room_in_glb(parts, images);
  write_model_by_assimp(path, std::move(parts), std::move(images));
}

ColorImage read_image(const TextureImage& image, const fs::path& model) {
  if (!image.bytes.empty()) return decode_color(image.bytes, max_decoded_pixels);
  const fs::path path = model.parent_path() / image.path;
  return in_file(path, [&] { return decode_color(read_whole_file(path), max_decoded_pixels); });
}

// A model without its material library has no textures.
DecodedModel read_obj_model(const fs::path& path) {
  return decode_obj_model(read_whole_file(path), [&](const std::string& name) {
    const fs::path library = path.parent_path() / name;
    std::error_code code;  // a name that no file can have is a missing library
    return fs::is_regular_file(library, code) ? read_whole_file(library) : std::string();
  });
}

}  // namespace

fs::path texture_page_path(const fs::path& model, std::size_t page, ImageFormat format) {
  return model.parent_path() /
         (model.stem().string() + "_" + std::to_string(page) + file_extension(format));
}

std::vector<fs::path> additional_model_files(const fs::path& model,
                                             const TexturedMeshWriteOptions& options) {
  if (format_of(model) != ".obj") return {};
  return {texture_page_path(model, 0, options.image_format), material_path(model)};
}

bool is_textured_format(const fs::path& path) {
  return format_of(path) == ".obj" || format_of(path) == ".glb";
}

void require_textured_format(const fs::path& path) {
  if (is_textured_format(path)) return;
  throw Error("unsupported format of a textured mesh",
              {.file = path.string(),
               .field = "extension",
               .value = format_of(path).empty() ? "missing" : format_of(path),
               .bound = ".obj or .glb"});
}

std::vector<ModelFile> textured_mesh_files(const fs::path& path, const TexturedMesh& model,
                                           const TexturedMeshWriteOptions& options) {
  require_textured_format(path);
  model.check();
  if (model.mesh.triangles.empty()) throw no_elements("triangles of the mesh");
  require_single_precision(model.mesh, format_of(path));
  std::vector<ModelFile> files;
  if (format_of(path) == ".glb") {
    files.push_back({path, [&model, options](const fs::path& temporary) {
                       write_textured_glb(temporary, model, options);
                     }});
    return files;
  }
  for (std::size_t page = 0; page < model.pages.size(); ++page)
    files.push_back({texture_page_path(path, page, options.image_format),
                     [&model, options, page](const fs::path& temporary) {
                       write_text(temporary, encode_page(model.pages[page], options));
                     }});
  files.push_back({material_path(path), [&model, options, path](const fs::path& temporary) {
                     write_text(temporary, materials_text(path, model, options));
                   }});
  files.push_back({path, [&model, path](const fs::path& temporary) {
                     write_geometry_file(temporary, [&](std::ostream& out) {
                       write_textured_obj(path, model, out);
                     });
                   }});
  return files;
}

TexturedMesh read_textured_mesh(const fs::path& path) {
  require_textured_format(path);
  require_readable_file(path);
  require_file_size(path, machine_memory());
  return in_file(path, [&] {
    DecodedModel decoded =
        format_of(path) == ".glb" ? decode_glb_model(path) : read_obj_model(path);
    if (decoded.model.mesh.triangles.empty()) throw no_elements("triangles");
    for (const TextureImage& image : decoded.images)
      decoded.model.pages.push_back(read_image(image, path));
    decoded.model.check();
    return std::move(decoded.model);
  });
}

}  // namespace libmap
