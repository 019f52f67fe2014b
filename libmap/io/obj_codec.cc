#include "libmap/io/obj_codec.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"
#include "libmap/io/corner_key.h"

namespace libmap {
namespace {

constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

constexpr std::string_view blanks = " \t\r\v\f";

// The rest of the line after its first word, e.g. a name with spaces.
std::string rest_of(const TextLine& line) {
  std::string_view rest = line.text.substr(line.text.find(line.words[0]) + line.words[0].size());
  rest.remove_prefix(std::min(rest.find_first_not_of(blanks), rest.size()));
  return std::string(rest.substr(0, rest.find_last_not_of(blanks) + 1));
}

// Materials by name, with the index of their image, of all material libraries.
class MaterialReader {
 public:
  void read(std::string_view text) {
    LineReader lines(text);
    TextLine line;
    std::string name;
    while (lines.next(line)) {
      if (line.words[0] == "newmtl") name = rest_of(line);
      if (line.words[0] == "map_Kd" && line.words.size() > 1) add_image(name, line);
    }
  }
  std::int32_t page_of(const std::string& material) const {
    const auto page = page_of_.find(material);
    return page == page_of_.end() ? no_page : page->second;
  }
  std::vector<TextureImage> take() { return std::move(images_); }

 private:
  // An image is read once, even if several materials refer to it by different names. Its name is
  // the last word after options, which begin with "-".
  void add_image(const std::string& material, const TextLine& line) {
    std::string name = rest_of(line);
    if (name.front() == '-') name = line.words.back();
    std::replace(name.begin(), name.end(), '\\', '/');
    name = std::filesystem::path(name).lexically_normal().string();
    const auto same = std::find_if(images_.begin(), images_.end(),
                                   [&](const TextureImage& image) { return image.path == name; });
    page_of_.try_emplace(material, static_cast<std::int32_t>(same - images_.begin()));
    if (same == images_.end()) images_.push_back({{}, name});
  }

  std::unordered_map<std::string, std::int32_t> page_of_;
  std::vector<TextureImage> images_;
};

class ObjReader {
 public:
  // Texture coordinates and materials of the triangles; materials are indices of `names`.
  struct Textures {
    std::vector<TextureCorners> coordinates;
    std::vector<std::int32_t> material_of_triangle;  // no_page: none
    std::vector<std::string> names;
    std::vector<std::string> libraries;
  };

  // `textures` receives the textures unless it is nullptr.
  TriangleMesh read(std::string_view text, Textures* textures) {
    textures_ = textures;
    LineReader lines(text);
    TextLine line;
    while (lines.next(line)) {
      drop_comment(line);
      if (line.words.empty()) continue;
      const std::string_view key = line.words[0];
      if (key == "v")
        add_position(line);
      else if (key == "vn")
        normals_.push_back(numbers(line, 3).head<3>().cast<float>());
      else if (key == "vt")
        add_texture_coordinate(line);
      else if (key == "f")
        add_face(line);
      else if (textures_ != nullptr && line.words.size() > 1 && key == "usemtl")
        use_material(rest_of(line));
      else if (textures_ != nullptr && line.words.size() > 1 && key == "mtllib")
        textures_->libraries.push_back(rest_of(line));
    }
    return weld();
  }

 private:
  using Numbers = Eigen::Matrix<double, 7, 1>;

  static void drop_comment(TextLine& line) {
    const auto comment = std::find_if(line.words.begin(), line.words.end(),
                                      [](std::string_view word) { return word.front() == '#'; });
    line.words.erase(comment, line.words.end());
  }

  // Returns up to seven numbers after the key, at least `least`; missing ones are 0.
  static Numbers numbers(const TextLine& line, std::size_t least) {
    Numbers values = Numbers::Zero();
    if (line.words.size() <= least)
      throw Error("contains too few numbers",
                  {.field = name_of(line), .bound = ">= " + std::to_string(least)});
    for (std::size_t n = 1; n < std::min<std::size_t>(line.words.size(), 8); ++n) {
      const std::optional<double> value = parse_double(line.words[n]);
      if (!value)
        throw Error("not a number",
                    {.field = name_of(line),
                     .value = "'" + std::string(line.words[n].substr(0, 40)) + "'"});
      values[static_cast<Eigen::Index>(n - 1)] = *value;
    }
    return values;
  }

  // Adds x y z, x y z w, x y z r g b or x y z w r g b. Of eight columns or more, x y z are read.
  void add_position(const TextLine& line) {
    const Numbers values = numbers(line, 3);
    const std::size_t count = line.words.size() - 1;
    const bool has_weight = count == 4 || count == 7;
    const bool has_color = count == 6 || count == 7;
    positions_.push_back(values.head<3>() / (has_weight ? values[3] : 1.0));
    if (!positions_.back().allFinite())
      throw Error("position is not finite",
                  {.field = "vertex " + std::to_string(positions_.size() - 1)});
    Color color{};
    for (std::size_t channel = 0; channel < 3 && has_color; ++channel)
      color[channel] = static_cast<std::uint8_t>(std::lround(
          255.0 * std::clamp(values[static_cast<Eigen::Index>(count - 3 + channel)], 0.0, 1.0)));
    colors_.push_back(color);
    has_colors_ = has_colors_ && has_color;
    normal_of_.push_back(none);
    mixed_.push_back(Eigen::Vector3f::Zero());
  }

  // OBJ measures v from the bottom.
  void add_texture_coordinate(const TextLine& line) {
    ++texture_coordinates_;
    if (textures_ == nullptr) return;
    const Eigen::Vector2f uv = numbers(line, 1).head<2>().cast<float>();
    uv_.emplace_back(uv.x(), 1.0F - uv.y());
  }

  void use_material(std::string name) {
    const auto [known, is_new] =
        material_of_.try_emplace(name, static_cast<std::int32_t>(textures_->names.size()));
    material_ = known->second;
    if (is_new) textures_->names.push_back(std::move(name));
  }

  // Index from 1, or negative from the end of the list (-1 is the last entry).
  static std::uint32_t index_of(const TextLine& line, std::string_view word, std::size_t count,
                                const char* what) {
    const std::optional<std::int64_t> number = parse_integer(word);
    const auto size = static_cast<std::int64_t>(count);
    const std::int64_t index = !number ? -1 : *number < 0 ? size + *number : *number - 1;
    if (index < 0 || index >= size)
      throw Error(std::string("a corner refers to no ") + what,
                  {.field = name_of(line),
                   .value = "'" + std::string(word.substr(0, 40)) + "'",
                   .bound = "1 to " + std::to_string(count)});
    return static_cast<std::uint32_t>(index);
  }

  // Adds a corner v, v/vt, v//vn or v/vt/vn and returns the index of v.
  std::uint32_t add_corner(const TextLine& line, std::string_view word) {
    const std::size_t first = std::min(word.find('/'), word.size());
    const std::size_t second = std::min(word.find('/', first + 1), word.size());
    const std::uint32_t vertex = index_of(line, word.substr(0, first), positions_.size(), "vertex");
    texture_corner_ = none;
    if (second > first + 1)
      texture_corner_ = index_of(line, word.substr(first + 1, second - first - 1),
                                 texture_coordinates_, "texture coordinate");
    if (second + 1 >= word.size()) {
      has_normals_ = false;
      return vertex;
    }
    add_normal(vertex, index_of(line, word.substr(second + 1), normals_.size(), "normal"));
    return vertex;
  }

  // A single normal is kept unchanged; several normals are averaged.
  void add_normal(std::uint32_t vertex, std::uint32_t normal) {
    std::uint32_t& known = normal_of_[vertex];
    if (known == none) known = normal;
    mixed_[vertex] += normals_[normal];
    if (normals_[known] != normals_[normal]) has_several_.insert(vertex);
  }

  void add_face(const TextLine& line) {
    if (line.words.size() < 4)
      throw Error("a face must have at least three corners", {.field = name_of(line)});
    Triangle triangle{};
    Triangle textured{};
    for (std::size_t n = 1; n < line.words.size(); ++n) {
      triangle[1] = triangle[2];
      textured[1] = textured[2];
      triangle[2] = add_corner(line, line.words[n]);
      textured[2] = texture_corner_;
      if (n == 1) triangle[0] = triangle[2];
      if (n == 1) textured[0] = textured[2];
      if (n < 3) continue;
      triangles_.push_back(triangle);
      if (textures_ != nullptr) add_texture(textured);
    }
  }

  void add_texture(const Triangle& corners) {
    TextureCorners& coordinates = textures_->coordinates.emplace_back();
    coordinates.fill(Eigen::Vector2f::Zero());
    const bool has_texture = std::find(corners.begin(), corners.end(), none) == corners.end();
    for (std::size_t k = 0; has_texture && k < corners.size(); ++k)
      coordinates[k] = uv_[corners[k]];
    textures_->material_of_triangle.push_back(has_texture ? material_ : no_page);
  }

  Eigen::Vector3f normal_at(std::uint32_t vertex) const {
    if (!has_normals_) return Eigen::Vector3f::Zero();
    const Eigen::Vector3f& first = normals_[normal_of_[vertex]];
    if (!has_several_.contains(vertex) || mixed_[vertex].isZero(1e-6F)) return first;
    return mixed_[vertex].stableNormalized();
  }

  TriangleMesh weld() {
    TriangleMesh mesh;
    CornerWelder welder;
    std::vector<std::uint32_t> welded(positions_.size(), none);
    has_colors_ = has_colors_ && !positions_.empty();
    for (Triangle& triangle : triangles_) {
      for (std::uint32_t& corner : triangle) {
        std::uint32_t& vertex = welded[corner];
        if (vertex == none) {
          const Eigen::Vector3f normal = normal_at(corner);
          vertex = welder.vertex(positions_[corner], has_normals_ ? &normal : nullptr,
                                 has_colors_ ? &colors_[corner] : nullptr, mesh);
        }
        corner = vertex;
      }
    }
    mesh.triangles = std::move(triangles_);
    return mesh;
  }

  std::vector<Eigen::Vector3d> positions_;
  std::vector<Color> colors_;
  std::vector<Eigen::Vector3f> normals_;
  std::size_t texture_coordinates_ = 0;
  std::vector<std::uint32_t> normal_of_;           // first normal of each position
  std::vector<Eigen::Vector3f> mixed_;             // sum of the normals of each position
  std::unordered_set<std::uint32_t> has_several_;  // positions with different normals
  std::vector<Triangle> triangles_;
  bool has_normals_ = true;
  bool has_colors_ = true;
  Textures* textures_ = nullptr;
  std::vector<Eigen::Vector2f> uv_;  // only with textures_
  std::unordered_map<std::string, std::int32_t> material_of_;
  std::int32_t material_ = no_page;
  std::uint32_t texture_corner_ = none;  // of the last corner
};

TriangleMesh read_obj(std::string_view text, ObjReader::Textures* textures) {
  // A backslash continues a line.
  const std::string_view continued = "\\\n";
  if (text.find(continued) == std::string_view::npos) return ObjReader().read(text, textures);
  std::string joined(text);
  for (std::size_t at = joined.find(continued); at != std::string::npos;
       at = joined.find(continued, at))
    joined.replace(at, 2, "  ");
  return ObjReader().read(joined, textures);
}

}  // namespace

TriangleMesh decode_obj(std::string_view text) { return read_obj(text, nullptr); }

DecodedModel decode_obj_model(
    std::string_view text,
    const std::function<std::string(const std::string& name)>& read_library) {
  ObjReader::Textures textures;
  DecodedModel decoded;
  decoded.model.mesh = read_obj(text, &textures);
  decoded.model.texture_coordinates = std::move(textures.coordinates);
  MaterialReader materials;
  for (const std::string& library : textures.libraries) materials.read(read_library(library));
  for (const std::int32_t material : textures.material_of_triangle)
    decoded.model.page_of_triangle.push_back(
        material == no_page
            ? no_page
            : materials.page_of(textures.names[static_cast<std::size_t>(material)]));
  decoded.images = materials.take();
  return decoded;
}

}  // namespace libmap
