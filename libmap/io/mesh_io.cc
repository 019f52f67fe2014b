#include "libmap/io/mesh_io.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"
#include "libmap/io/assimp_codec.h"
#include "libmap/io/cloud_columns.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/columns.h"
#include "libmap/io/obj_codec.h"
#include "libmap/io/ply_codec.h"
#include "libmap/io/vtp_codec.h"
#include "libmap/raster/dem_reader.h"

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

// Returns the text with comments replaced by blanks, so that line numbers are preserved.
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

Error bad_line(const TextLine& line, const std::string& reason) {
  return Error(reason, {.field = name_of(line)});
}

std::uint64_t index_of(const TextLine& line, std::size_t word, std::uint64_t limit) {
  const std::optional<std::int64_t> index = parse_integer(line.words[word]);
  if (!index || *index < 0 || static_cast<std::uint64_t>(*index) >= limit)
    throw Error("not in range", {.field = name_of(line),
                                 .value = "'" + std::string(line.words[word].substr(0, 40)) + "'",
                                 .bound = ">= 0 and < " + std::to_string(limit)});
  return static_cast<std::uint64_t>(*index);
}

struct OffCounts {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
};

// Reads "OFF" and the counts, on the same line or on the next.
OffCounts read_off_counts(LineReader& lines) {
  TextLine line;
  if (!lines.next(line) ||
      (line.words[0] != "OFF" && line.words[0] != "COFF" && line.words[0] != "NOFF"))
    throw Error("not an OFF file");
  line.words.erase(line.words.begin());
  if (line.words.empty()) lines.next(line);
  if (line.words.size() < 2) throw Error("the numbers of vertices and faces are missing");
  constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
  OffCounts counts{index_of(line, 0, most), index_of(line, 1, most)};
  require_room_for_text(counts.vertices, 3, lines.remaining(), "vertices");
  require_room_for_text(counts.faces, 4, lines.remaining(), "faces");
  return counts;
}

Eigen::Vector3d read_off_vertex(const TextLine& line) {
  if (line.words.size() < 3) throw bad_line(line, "a vertex must have three numbers");
  Eigen::Vector3d vertex;
  for (std::size_t axis = 0; axis < 3; ++axis)
    vertex[static_cast<int>(axis)] =
        number_of(line, axis, std::string(1, "xyz"[axis]), ScalarType::float64);
  if (!vertex.allFinite()) throw bad_line(line, "position is not finite");
  return vertex;
}

void read_off_face(const TextLine& line, TriangleMesh& mesh) {
  const std::uint64_t corners = index_of(line, 0, line.words.size());
  if (corners < 3) throw bad_line(line, "a face must have at least three corners");
  Triangle triangle{};
  for (std::uint64_t i = 0; i < corners; ++i) {
    const auto corner = static_cast<std::uint32_t>(index_of(line, 1 + i, mesh.vertices.size()));
    triangle[1] = triangle[2];
    triangle[2] = corner;
    if (i == 0) triangle[0] = corner;
    if (i >= 2) mesh.triangles.push_back(triangle);
  }
}

// Reads the Object File Format, including COFF and NOFF without their colors and normals. Polygons
// are split into triangle fans. Throws Error for a truncated file, a vertex that is not finite, and
// a face with less than three corners or an index out of range.
TriangleMesh read_off(std::string_view text) {
  const std::string plain = without_comments(text);
  LineReader lines(plain);
  const OffCounts counts = read_off_counts(lines);
  TriangleMesh mesh;
  TextLine line;
  const auto next = [&](const char* what, std::uint64_t done, std::uint64_t promised) {
    if (!lines.next(line))
      throw Error("the file declares " + std::to_string(promised) + " " + what +
                  ", but ends after " + std::to_string(done));
  };
  for (std::uint64_t i = 0; i < counts.vertices; ++i) {
    next("vertices", i, counts.vertices);
    mesh.vertices.push_back(read_off_vertex(line));
  }
  for (std::uint64_t i = 0; i < counts.faces; ++i) {
    next("faces", i, counts.faces);
    read_off_face(line, mesh);
  }
  return mesh;
}

// Text formats are written in double precision with the shortest numbers that parse to the same
// value. (assimp writes OBJ in float32 and renumbers its vertices, does not write OFF, and ends the
// program on some damaged OFF files.)
//
// Wavefront OBJ: v (with colors r g b from 0 to 1, if any), vn, f.
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
      // OBJ indices start at 1.
      const std::string index = std::to_string(std::uint64_t{corner} + 1);
      line += ' ' + index;
      if (has_normals) line += "//" + index;
    }
    out << line << '\n';
  }
}

// Writes geometry only.
void write_off(const TriangleMesh& mesh, std::ostream& out) {
  out << "OFF\n" + std::to_string(mesh.vertices.size()) + ' ' +
             std::to_string(mesh.triangles.size()) + " 0\n";
  for (const Eigen::Vector3d& vertex : mesh.vertices) out << numbers(vertex) + "\n";
  for (const Triangle& triangle : mesh.triangles)
    out << "3 " + std::to_string(triangle[0]) + ' ' + std::to_string(triangle[1]) + ' ' +
               std::to_string(triangle[2]) + "\n";
}

constexpr std::array<const char*, 5> read_formats = {".ply", ".obj", ".stl", ".off", ".glb"};

bool is_read(const std::string& format) {
  return std::find(read_formats.begin(), read_formats.end(), format) != read_formats.end();
}

Error no_mesh_format(const std::filesystem::path& path, const std::string& bound) {
  const std::string format = format_of(path);
  return Error(
      "not a mesh format" + did_you_mean(format, {read_formats.begin(), read_formats.end()}),
      {.file = path.string(),
       .field = "extension",
       .value = format.empty() ? "missing" : format,
       .bound = bound});
}

// Converts a field of polygons to a field of triangles.
ScalarField field_of_triangles(const ScalarField& field, const std::vector<std::uint32_t>& faces) {
  ScalarField spread{field.name, field.type, {}};
  spread.values.reserve(faces.size());
  for (const std::uint32_t face : faces) spread.values.push_back(field.values[face]);
  return spread;
}

TriangleMesh mesh_of_columns(GeometryColumns& content) {
  PointCloud cloud = cloud_from_columns(content.vertices, NotFinite::refuse).cloud;
  TriangleMesh mesh;
  mesh.vertices = std::move(cloud.positions);
  mesh.vertex_normals = std::move(cloud.normals);
  mesh.vertex_colors = std::move(cloud.colors);
  mesh.vertex_fields = std::move(cloud.fields);
  mesh.triangles = std::move(content.triangles);
  for (const ScalarField& field : fields_of_columns(content.faces))
    mesh.face_fields.push_back(field_of_triangles(field, content.face_of_triangle));
  return mesh;
}

// File info for formats without fields.
GeometryFileInfo info_of(const TriangleMesh& mesh, const std::string& format,
                         const std::string& bytes) {
  GeometryFileInfo info;
  info.format = format;
  const bool is_text =
      format == "obj" || format == "off" || (format == "stl" && bytes.starts_with("solid"));
  info.encoding = is_text ? FileEncoding::ascii : FileEncoding::binary;
  info.bytes = bytes.size();
  info.points = mesh.vertices.size();
  info.faces = mesh.triangles.size();
  const bool is_double = format == "off" || format == "obj";
  const ScalarType type = is_double ? ScalarType::float64 : ScalarType::float32;
  for (const char* const axis : {"x", "y", "z"}) info.fields.push_back({axis, type, 1});
  return info;
}

MeshReadResult decode(const std::string& format, const std::shared_ptr<const std::string>& bytes) {
  if (format == ".ply") {
    GeometryColumns content = decode_ply(bytes);
    TriangleMesh mesh = mesh_of_columns(content);
    return {std::move(mesh), std::move(content.info)};
  }
  const std::string name = format.substr(1);
  TriangleMesh mesh = name == "off"   ? read_off(*bytes)
                      : name == "obj" ? decode_obj(*bytes)
                                      : decode_by_assimp(*bytes, name);
  GeometryFileInfo info = info_of(mesh, name, *bytes);
  return {std::move(mesh), std::move(info)};
}

MeshReadResult read_dem(const std::filesystem::path& path) {
  MeshReadResult result{read_dem_mesh(path), read_cloud_info(path)};
  if (result.mesh.triangles.empty()) throw no_elements("triangles", path);
  result.info.points = result.mesh.vertices.size();
  result.info.faces = result.mesh.triangles.size();
  return result;
}

ColumnSet columns_of_vertices(const TriangleMesh& mesh) {
  ColumnSet set;
  set.rows = mesh.vertices.size();
  add_position_columns(mesh.vertices, set);
  add_normal_columns(mesh.vertex_normals, NormalNames::short_names, set);
  add_color_columns(mesh.vertex_colors, set);
  add_field_columns(mesh.vertex_fields, set);
  return set;
}

ColumnSet columns_of_faces(const TriangleMesh& mesh) {
  ColumnSet set;
  set.rows = mesh.triangles.size();
  add_field_columns(mesh.face_fields, set);
  return set;
}

void encode(const std::string& format, const TriangleMesh& mesh,
            const GeometryWriteOptions& options, std::ostream& out) {
  if (format == ".obj") return write_obj(mesh, out);
  if (format == ".off") return write_off(mesh, out);
  if (format == ".stl" || format == ".glb") {
    const std::string bytes =
        encode_by_assimp(mesh, format.substr(1), options.encoding == FileEncoding::ascii);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return;
  }
  const ColumnSet vertices = columns_of_vertices(mesh);
  const ColumnSet faces = columns_of_faces(mesh);
  const GeometryContent content{&vertices, &mesh.triangles, &faces, nullptr};
  if (format == ".ply")
    encode_ply(content, options, out);
  else
    encode_vtp(content, options.encoding, out);
}

}  // namespace

std::vector<std::filesystem::path> mesh_tiles(const std::filesystem::path& given) {
  if (!std::filesystem::is_directory(given)) return {given};
  std::vector<std::filesystem::path> tiles;
  for (const auto& entry : std::filesystem::directory_iterator(given))
    if (is_read(format_of(entry.path())) && entry.is_regular_file() &&
        entry.path().filename().string().front() != '.')
      tiles.push_back(entry.path());
  if (tiles.empty())
    throw Error("the folder contains no mesh (.ply, .obj, .stl, .off, .glb)",
                {.file = given.string()});
  std::sort(tiles.begin(), tiles.end());
  return tiles;
}

void require_mesh_format(const std::filesystem::path& path) {
  const std::string format = format_of(path);
  if (!is_read(format) && format != ".vtp")
    throw no_mesh_format(path, ".ply, .obj, .stl, .off, .glb or .vtp");
}

MeshReadResult read_mesh(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    MeshReadResult joined;
    for (const std::filesystem::path& tile : mesh_tiles(path)) {
      MeshReadResult read = read_mesh(tile);
      append_mesh(read.mesh, joined.mesh);
      joined.info = std::move(read.info);
    }
    return joined;
  }
  refuse_vtp(path);
  if (is_dem_path(path)) return read_dem(path);
  if (!is_read(format_of(path))) throw no_mesh_format(path, ".ply, .obj, .stl, .off, .glb or .tif");
  const auto bytes = read_geometry_bytes(path);
  return in_file(path, [&] {
    MeshReadResult result = decode(format_of(path), bytes);
    if (result.mesh.triangles.empty()) throw no_elements("triangles");
    return result;
  });
}

void require_single_precision(const TriangleMesh& mesh, const std::string& format) {
  constexpr auto most = static_cast<double>(std::numeric_limits<float>::max());
  for (std::size_t n = 0; n < mesh.vertices.size(); ++n) {
    const double farthest = mesh.vertices[n].cwiseAbs().maxCoeff();
    if (!(farthest <= most))
      throw Error("too far away for " + format, {.field = "vertex " + std::to_string(n),
                                                 .value = to_text(farthest) + " m",
                                                 .bound = "<= " + to_text(most)});
  }
}

void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                const GeometryWriteOptions& options) {
  require_mesh_format(path);
  mesh.check();
  for (std::size_t n = 0; n < mesh.vertices.size(); ++n)
    if (!mesh.vertices[n].allFinite())
      throw Error("the position of this vertex is not finite",
                  {.file = path.string(), .field = "vertex", .value = std::to_string(n)});
  const std::string format = format_of(path);
  if (format == ".obj" || format == ".stl" || format == ".glb")
    in_file(path, [&] { require_single_precision(mesh, format); });
  write_geometry_file(path, [&](std::ostream& out) { encode(format, mesh, options, out); });
}

FileKind file_kind(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    const auto is_mesh = [](const std::filesystem::directory_entry& entry) {
      return is_read(format_of(entry.path())) && file_kind(entry.path()) == FileKind::mesh;
    };
    const std::filesystem::directory_iterator entries(path);
    return std::any_of(begin(entries), end(entries), is_mesh) ? FileKind::mesh : FileKind::cloud;
  }
  refuse_vtp(path);
  const std::string format = format_of(path);
  if (format == ".ply") return read_cloud_info(path).faces > 0 ? FileKind::mesh : FileKind::cloud;
  if (is_read(format) || is_dem_path(path)) return FileKind::mesh;
  if (format == ".pcd" || format == ".csv") return FileKind::cloud;
  throw Error("neither a cloud nor a mesh",
              {.file = path.string(),
               .field = "extension",
               .value = format.empty() ? "missing" : format,
               .bound = ".pcd, .ply, .csv, .obj, .stl, .off, .glb or .tif"});
}

}  // namespace libmap
