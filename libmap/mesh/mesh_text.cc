#include "libmap/mesh/mesh_text.h"

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "libmap/cloud/text_rows.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

template <typename Vector>
std::string numbers(const Vector& vector) {
  return to_text(vector[0]) + ' ' + to_text(vector[1]) + ' ' + to_text(vector[2]);
}

std::string color_text(const Color& color) {
  std::string text;
  for (const std::uint8_t channel : color)
    text += ' ' + to_text(static_cast<float>(channel) / 255.0F);
  return text;
}

using Words = std::vector<std::string_view>;

// The text with comments blanked out, so that lines keep their numbers.
std::string without_comments(std::string_view text) {
  std::string plain(text);
  bool in_comment = false;
  for (char& c : plain) {
    if (c == '#') in_comment = true;
    if (c == '\n') in_comment = false;
    if (in_comment) c = ' ';
  }
  return plain;
}

Error bad_line(const TextRows& rows, const std::string& reason) {
  return Error(reason, {.field = "line " + std::to_string(rows.line())});
}

std::uint64_t index_of(const TextRows& rows, std::string_view word, std::uint64_t limit) {
  const std::optional<std::int64_t> index = parse_integer(word);
  if (!index || *index < 0 || static_cast<std::uint64_t>(*index) >= limit)
    throw Error("not an index", {.field = "line " + std::to_string(rows.line()),
                                 .value = "'" + std::string(word.substr(0, 40)) + "'",
                                 .bound = "0 to " + std::to_string(limit) + " - 1"});
  return static_cast<std::uint64_t>(*index);
}

struct OffCounts {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
};

// "OFF", and the counts on the same line or on the next.
OffCounts read_off_counts(TextRows& rows) {
  Words words;
  if (!rows.next(words) || (words[0] != "OFF" && words[0] != "COFF" && words[0] != "NOFF"))
    throw Error("not an OFF file");
  words.erase(words.begin());
  if (words.empty()) rows.next(words);
  if (words.size() < 2) throw Error("the OFF file has no counts");
  constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
  OffCounts counts{index_of(rows, words[0], most), index_of(rows, words[1], most)};
  require_room_for_text(counts.vertices, 3, rows.remaining(), "vertices");
  require_room_for_text(counts.faces, 4, rows.remaining(), "faces");
  return counts;
}

Eigen::Vector3d read_off_vertex(const TextRows& rows, const Words& words) {
  if (words.size() < 3) throw bad_line(rows, "a vertex needs three numbers");
  Eigen::Vector3d vertex;
  for (std::size_t axis = 0; axis < 3; ++axis)
    vertex[static_cast<int>(axis)] =
        rows.number(words[axis], std::string(1, "xyz"[axis]), ScalarType::float64);
  if (!vertex.allFinite()) throw bad_line(rows, "position is not finite");
  return vertex;
}

void read_off_face(const TextRows& rows, const Words& words, TriangleMesh& mesh) {
  const std::uint64_t corners = index_of(rows, words[0], words.size());
  if (corners < 3) throw bad_line(rows, "a face needs three corners");
  Triangle triangle{};
  for (std::uint64_t i = 0; i < corners; ++i) {
    const auto corner =
        static_cast<std::uint32_t>(index_of(rows, words[1 + i], mesh.vertices.size()));
    triangle[1] = triangle[2];
    triangle[2] = corner;
    if (i == 0) triangle[0] = corner;
    if (i >= 2) mesh.triangles.push_back(triangle);
  }
}

}  // namespace

TriangleMesh read_off(std::string_view text) {
  const std::string plain = without_comments(text);
  TextRows rows(plain, 0, 1);
  const OffCounts counts = read_off_counts(rows);
  TriangleMesh mesh;
  Words words;
  const auto next = [&](const char* what, std::uint64_t done, std::uint64_t promised) {
    if (!rows.next(words))
      throw Error("the file promises " + std::to_string(promised) + " " + what +
                  ", but ends after " + std::to_string(done));
  };
  for (std::uint64_t i = 0; i < counts.vertices; ++i) {
    next("vertices", i, counts.vertices);
    mesh.vertices.push_back(read_off_vertex(rows, words));
  }
  for (std::uint64_t i = 0; i < counts.faces; ++i) {
    next("faces", i, counts.faces);
    read_off_face(rows, words, mesh);
  }
  return mesh;
}

void write_obj(const TriangleMesh& mesh, std::ostream& out) {
  const bool colored = !mesh.vertex_colors.empty();
  const bool has_normals = !mesh.vertex_normals.empty();
  std::string line;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    line = "v " + numbers(mesh.vertices[i]);
    if (colored) line += color_text(mesh.vertex_colors[i]);
    out << line << '\n';
  }
  for (const Eigen::Vector3f& normal : mesh.vertex_normals) out << "vn " + numbers(normal) + "\n";
  for (const Triangle& triangle : mesh.triangles) {
    line = "f";
    for (const std::uint32_t corner : triangle) {
      // Indices count from 1.
      const std::string index = std::to_string(std::uint64_t{corner} + 1);
      line += ' ' + index;
      if (has_normals) line += "//" + index;
    }
    out << line << '\n';
  }
}

void write_off(const TriangleMesh& mesh, std::ostream& out) {
  out << "OFF\n" + std::to_string(mesh.vertices.size()) + ' ' +
             std::to_string(mesh.triangles.size()) + " 0\n";
  for (const Eigen::Vector3d& vertex : mesh.vertices) out << numbers(vertex) + "\n";
  for (const Triangle& triangle : mesh.triangles)
    out << "3 " + std::to_string(triangle[0]) + ' ' + std::to_string(triangle[1]) + ' ' +
               std::to_string(triangle[2]) + "\n";
}

}  // namespace libmap
