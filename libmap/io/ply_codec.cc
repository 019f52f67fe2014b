#include "libmap/io/ply_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"

namespace libmap {

namespace {

struct PlyProperty {
  std::string name;
  StoredType type = StoredType::float32;
  bool is_list = false;
  StoredType count_type = StoredType::uint8;  // type of a list's length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  // True if a row's length depends on its content.
  bool has_lists() const {
    return std::any_of(properties.begin(), properties.end(),
                       [](const PlyProperty& property) { return property.is_list; });
  }
  // Size of a row in a binary file; the minimum if it has lists.
  std::size_t record_bytes() const {
    std::size_t bytes = 0;
    for (const PlyProperty& property : properties)
      bytes += size_of(property.is_list ? property.count_type : property.type);
    return bytes;
  }
};

struct PlyHeader {
  FileEncoding encoding = FileEncoding::ascii;
  bool big_endian = false;
  std::vector<PlyElement> elements;
  std::optional<Pose> viewpoint;  // "comment viewpoint tx ty tz qw qx qy qz", written by encode_ply
  std::size_t data_begin = 0;
  std::size_t data_line = 1;

  // Returns the element of that name, or nullptr.
  const PlyElement* find(std::string_view name) const {
    for (const PlyElement& element : elements)
      if (element.name == name) return &element;
    return nullptr;
  }
};

using Words = std::vector<std::string_view>;

constexpr std::array<const char*, 8> type_names = {"char", "uchar", "short", "ushort",
                                                   "int",  "uint",  "float", "double"};

Error bad_line(std::size_t line, const std::string& reason, std::string_view value = {}) {
  return Error(reason, {.field = "PLY header line " + std::to_string(line),
                        .value = std::string(value.substr(0, 60))});
}

StoredType type_of(std::string_view name, std::size_t line) {
  for (std::size_t i = 0; i < type_names.size(); ++i) {
    const auto type = static_cast<ScalarType>(i);
    if (name == type_names[i] || name == to_text(type)) return stored_as(type);
  }
  throw bad_line(line, "unknown number type", name);
}

FileEncoding encoding_of(const Words& words, std::size_t line, PlyHeader& header) {
  if (words.size() != 3 || words[2] != "1.0")
    throw bad_line(line, "expected 'format ENCODING 1.0'");
  header.big_endian = words[1] == "binary_big_endian";
  if (words[1] == "ascii") return FileEncoding::ascii;
  if (header.big_endian || words[1] == "binary_little_endian") return FileEncoding::binary;
  throw bad_line(line, "unknown encoding", words[1]);
}

PlyElement element_of(const Words& words, std::size_t line) {
  const std::optional<std::int64_t> count =
      words.size() == 3 ? parse_integer(words[2]) : std::nullopt;
  if (!count || *count < 0) throw bad_line(line, "expected 'element NAME COUNT'");
  return {std::string(words[1]), static_cast<std::uint64_t>(*count), {}};
}

PlyProperty property_of(const Words& words, std::size_t line) {
  if (words.size() == 3)
    return {std::string(words[2]), type_of(words[1], line), false, StoredType::uint8};
  if (words.size() != 5 || words[1] != "list")
    throw bad_line(line, "expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
  const StoredType count_type = type_of(words[2], line);
  if (count_type == StoredType::float32 || count_type == StoredType::float64)
    throw bad_line(line, "the type of a list's length must be an integer", words[2]);
  return {std::string(words[4]), type_of(words[3], line), true, count_type};
}

std::optional<Pose> viewpoint_of(const Words& words) {
  if (words.size() != 9 || words[1] != "viewpoint") return std::nullopt;
  std::array<double, 7> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::optional<double> number = parse_double(words[i + 2]);
    if (!number || !std::isfinite(*number)) return std::nullopt;
    numbers[i] = *number;
  }
  return pose_of_viewpoint(numbers);
}

void add_element(PlyElement element, std::size_t line, PlyHeader& header) {
  if (header.find(element.name) != nullptr) throw bad_line(line, "duplicate element", element.name);
  constexpr std::size_t max_elements = 1000;
  if (header.elements.size() == max_elements) throw bad_line(line, "more than 1000 elements");
  header.elements.push_back(std::move(element));
}

void add_property(PlyProperty property, std::size_t line, PlyHeader& header) {
  if (header.elements.empty()) throw bad_line(line, "a property before the first element");
  for (const PlyProperty& other : header.elements.back().properties)
    if (other.name == property.name) throw bad_line(line, "duplicate property", property.name);
  constexpr std::size_t max_properties = 10'000;
  if (header.elements.back().properties.size() == max_properties)
    throw bad_line(line, "more than 10000 properties");
  header.elements.back().properties.push_back(std::move(property));
}

// Throws Error (without the file's name) naming the line.
PlyHeader read_ply_header(std::string_view text) {
  if (text.empty()) throw Error("is empty");
  PlyHeader header;
  bool has_format = false;
  std::size_t position = 0;
  for (std::size_t line = 1;; ++line) {
    const std::size_t end = text.find('\n', position);
    if (line == 1 && trim(text.substr(0, std::min<std::size_t>(end, 5))) != "ply")
      throw Error("not a PLY file");
    if (end == std::string_view::npos) throw Error("the PLY header has no line 'end_header'");
    const std::string_view content = text.substr(position, end - position);
    position = end + 1;
    const Words words = words_of(content);
    if (line == 1 || words.empty() || words[0] == "obj_info") continue;
    if (words[0] == "comment") {
      if (const auto viewpoint = viewpoint_of(words)) header.viewpoint = viewpoint;
    } else if (words[0] == "format") {
      header.encoding = encoding_of(words, line, header);
      has_format = true;
    } else if (words[0] == "element") {
      add_element(element_of(words, line), line, header);
    } else if (words[0] == "property") {
      add_property(property_of(words, line), line, header);
    } else if (words[0] == "end_header") {
      if (!has_format) throw Error("the PLY header has no line 'format ENCODING 1.0'");
      header.data_begin = position;
      header.data_line = line + 1;
      return header;
    } else {
      throw bad_line(line, "unknown keyword", words[0]);
    }
  }
}

std::string ply_type_name(ScalarType type) { return type_names[static_cast<std::size_t>(type)]; }

// Position of the next element's rows in the file.
struct Cursor {
  const std::shared_ptr<const std::string>& bytes;
  std::size_t position;
  LineReader lines;
};

std::string quoted_name(const PlyElement& element) {
  return "'" + element.name.substr(0, 40) + "'";
}

std::string ends_early(const PlyElement& element, std::uint64_t row) {
  return "the header declares " + std::to_string(element.count) + " rows of " +
         quoted_name(element) + ", but the data end in row " + std::to_string(row);
}

// Throws Error unless the remaining bytes of the file are enough for the element.
void require_room(const PlyElement& element, FileEncoding encoding, std::uint64_t bytes) {
  if (encoding == FileEncoding::ascii)
    return require_room_for_text(element.count, element.properties.size(), bytes,
                                 "rows of " + quoted_name(element));
  const std::uint64_t record = element.record_bytes();
  require_rows(element.count, record, bytes, "rows of " + quoted_name(element));
}

bool is_index_list(const PlyElement& element, const PlyProperty& property) {
  return element.name == "face" && property.is_list &&
         (property.name == "vertex_indices" || property.name == "vertex_index");
}

// Reader of rows in any encoding. A property is a number, or a list's length and its numbers.
class RowReader {
 public:
  RowReader(const PlyElement& element, FileEncoding encoding, bool swapped, Cursor& cursor)
      : element_(element),
        ascii_(encoding == FileEncoding::ascii),
        swapped_(swapped),
        cursor_(cursor) {}

  void begin_row(std::uint64_t row) {
    row_ = row;
    if (!ascii_) return;
    word_ = 0;
    if (!cursor_.lines.next(line_)) throw Error(ends_early(element_, row));
  }
  double number(const PlyProperty& property, StoredType type) {
    return ascii_ ? text_number(property, type) : binary_number(type);
  }
  // Reads a list's length. Throws Error if the list is longer than the remaining data.
  std::uint64_t length(const PlyProperty& property) {
    const double length = number(property, property.count_type);
    const std::uint64_t left =
        ascii_ ? line_.words.size() - word_
               : (cursor_.bytes->size() - cursor_.position) / size_of(property.type);
    if (!(length >= 0.0) || length > static_cast<double>(left))
      throw Error("the length of the list in row " + std::to_string(row_) + " of " +
                      quoted_name(element_) + " does not fit the data",
                  {.field = property.name, .value = to_text(length)});
    return static_cast<std::uint64_t>(length);
  }
  void end_row() {
    if (ascii_ && word_ != line_.words.size())
      throw Error("contains more than one row of " + quoted_name(element_),
                  {.field = name_of(line_)});
  }

 private:
  double text_number(const PlyProperty& property, StoredType type) {
    if (word_ >= line_.words.size())
      throw Error(name_of(line_) + " ends before this number", {.field = property.name});
    return number_of(line_, word_++, property.name, scalar_type_of(type));
  }
  double binary_number(StoredType type) {
    if (size_of(type) > cursor_.bytes->size() - cursor_.position)
      throw Error(ends_early(element_, row_));
    const auto* at = reinterpret_cast<const std::byte*>(cursor_.bytes->data()) + cursor_.position;
    double number = 0.0;
    for_each_value({{}, scalar_type_of(type), type, at, 0, swapped_}, 1,
                   [&](std::size_t, double value) { number = value; });
    cursor_.position += size_of(type);
    return number;
  }

  const PlyElement& element_;
  bool ascii_;
  bool swapped_;
  Cursor& cursor_;
  TextLine line_;
  std::size_t word_ = 0;
  std::uint64_t row_ = 0;
};

// Returns columns that view the rows at `at` of a binary element without lists.
std::vector<Column> columns_at(const PlyElement& element, bool swapped, const std::byte* at) {
  std::vector<Column> columns;
  for (const PlyProperty& property : element.properties) {
    columns.push_back({property.name, scalar_type_of(property.type), property.type, at,
                       element.record_bytes(), swapped});
    at += size_of(property.type);
  }
  return columns;
}

bool is_swapped(const PlyHeader& header) {
  return header.big_endian == (std::endian::native == std::endian::little);
}

// Reads a binary element without lists, which needs no copy.
ColumnSet view_rows(const PlyElement& element, bool swapped, Cursor& cursor) {
  ColumnSet set;
  set.rows = element.count;
  set.columns = columns_at(
      element, swapped, reinterpret_cast<const std::byte*>(cursor.bytes->data()) + cursor.position);
  set.storage.push_back(cursor.bytes);
  cursor.position += element.count * element.record_bytes();
  return set;
}

void add_fan(const std::vector<double>& corners, std::uint64_t face, std::uint64_t vertices,
             GeometryColumns& content) {
  const std::string name = "face " + std::to_string(face);
  if (corners.size() < 3)
    throw Error("the number of corners is too small",
                {.field = name, .value = std::to_string(corners.size()), .bound = ">= 3"});
  for (const double corner : corners)
    if (!(corner >= 0.0) || corner >= static_cast<double>(vertices) ||
        corner > std::numeric_limits<std::uint32_t>::max())
      throw Error("not a vertex index", {.field = name,
                                         .value = to_text(corner),
                                         .bound = ">= 0 and < " + std::to_string(vertices)});
  for (std::size_t i = 2; i < corners.size(); ++i) {
    content.triangles.push_back({static_cast<std::uint32_t>(corners[0]),
                                 static_cast<std::uint32_t>(corners[i - 1]),
                                 static_cast<std::uint32_t>(corners[i])});
    content.face_of_triangle.push_back(static_cast<std::uint32_t>(face));
  }
}

// Copies rows of text or with lists.
ColumnSet copy_rows(const PlyElement& element, const PlyHeader& header, bool swapped,
                    Cursor& cursor, GeometryColumns& content) {
  ColumnSet set;
  set.rows = element.count;
  std::vector<double*> targets;
  for (const PlyProperty& property : element.properties)
    targets.push_back(
        property.is_list ? nullptr : set.add_numbers(property.name, scalar_type_of(property.type)));
  const PlyElement* const vertices = header.find("vertex");
  const std::uint64_t vertex_count = vertices == nullptr ? 0 : vertices->count;
  RowReader reader(element, header.encoding, swapped, cursor);
  std::vector<double> list;
  for (std::uint64_t row = 0; row < element.count; ++row) {
    reader.begin_row(row);
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      if (!property.is_list) {
        targets[p][row] = reader.number(property, property.type);
        continue;
      }
      list.resize(reader.length(property));
      for (double& number : list) number = reader.number(property, property.type);
      if (is_index_list(element, property)) add_fan(list, row, vertex_count, content);
    }
    reader.end_row();
  }
  return set;
}

ColumnSet read_element(const PlyElement& element, const PlyHeader& header, Cursor& cursor,
                       GeometryColumns& content) {
  const bool ascii = header.encoding == FileEncoding::ascii;
  require_room(element, header.encoding,
               ascii ? cursor.lines.remaining() : cursor.bytes->size() - cursor.position);
  const bool swapped = is_swapped(header);
  if (element.properties.empty()) return {};
  if (!ascii && !element.has_lists()) return view_rows(element, swapped, cursor);
  return copy_rows(element, header, swapped, cursor, content);
}

GeometryFileInfo info_of(const PlyHeader& header, std::uint64_t file_bytes) {
  GeometryFileInfo info;
  info.format = "ply";
  info.encoding = header.encoding;
  info.big_endian = header.big_endian;
  info.bytes = file_bytes;
  for (const PlyElement& element : header.elements) {
    if (element.name == "vertex") info.points = element.count;
    if (element.name == "face") info.faces = element.count;
    if (element.name != "vertex" && element.name != "face")
      info.skipped.push_back("element " + element.name);
    for (const PlyProperty& property : element.properties) {
      if (element.name == "vertex" && !property.is_list)
        info.fields.push_back({property.name, scalar_type_of(property.type), 1});
      else if (property.is_list && !is_index_list(element, property) &&
               (element.name == "vertex" || element.name == "face"))
        info.skipped.push_back("list " + property.name);
    }
  }
  return info;
}

void require_vertices(const PlyHeader& header) {
  if (header.find("vertex") == nullptr)
    throw Error("has no element vertex", {.field = "PLY header"});
}

// Throws Error unless the file is large enough for all elements.
PlyHeader checked_header(std::string_view head, std::uint64_t file_bytes) {
  PlyHeader header = read_ply_header(head);
  require_vertices(header);
  std::uint64_t left = file_bytes - header.data_begin;
  for (const PlyElement& element : header.elements) {
    require_room(element, header.encoding, left);
    if (header.encoding == FileEncoding::binary) left -= element.count * element.record_bytes();
  }
  return header;
}

void write_property_lines(const ColumnSet& set, std::ostream& out) {
  for (const Column& column : set.columns) {
    if (column.name.find_first_of(" \t\r\n\v\f") != std::string::npos)
      throw Error("a PLY header cannot store names with white space; rename it",
                  {.field = "field '" + column.name + "'"});
    out << "property " << ply_type_name(column.type) << ' ' << column.name << '\n';
  }
}

void write_header(const GeometryContent& content, const GeometryWriteOptions& options,
                  std::ostream& out) {
  out << "ply\nformat "
      << (options.encoding == FileEncoding::ascii ? "ascii"
          : options.big_endian                    ? "binary_big_endian"
                                                  : "binary_little_endian")
      << " 1.0\n";
  if (content.viewpoint != nullptr && !content.viewpoint->matrix().isIdentity(0.0))
    out << "comment viewpoint" << viewpoint_words(*content.viewpoint) << '\n';
  out << "element vertex " << std::to_string(content.vertices->rows) << '\n';
  write_property_lines(*content.vertices, out);
  if (content.triangles != nullptr) {
    out << "element face " << std::to_string(content.triangles->size())
        << "\nproperty list uchar int vertex_indices\n";
    if (content.faces != nullptr) write_property_lines(*content.faces, out);
  }
  out << "end_header\n";
}

void write_rows(const ColumnSet& set, const GeometryWriteOptions& options, std::ostream& out) {
  const bool swap_bytes = options.big_endian == (std::endian::native == std::endian::little);
  libmap::write_rows(set.rows, out, [&](std::size_t begin, std::size_t end, std::string& text) {
    if (options.encoding == FileEncoding::ascii)
      append_rows_of_text(set.columns, begin, end, ' ', text);
    else
      append_records(set.columns, begin, end, swap_bytes, text);
  });
}

// Writes each face as four numbers: the length 3 and the corners.
void write_faces(const GeometryContent& content, const GeometryWriteOptions& options,
                 std::ostream& out) {
  const std::vector<Triangle>& triangles = *content.triangles;
  const double three = 3.0;
  ColumnSet set;
  set.rows = triangles.size();
  if (set.rows == 0) return;
  set.columns.push_back({"", ScalarType::uint8, StoredType::float64,
                         reinterpret_cast<const std::byte*>(&three), 0, false});
  for (const std::uint32_t& corner : triangles.front())
    set.columns.push_back({"", ScalarType::int32, StoredType::uint32,
                           reinterpret_cast<const std::byte*>(&corner), sizeof(Triangle), false});
  if (content.faces != nullptr)
    set.columns.insert(set.columns.end(), content.faces->columns.begin(),
                       content.faces->columns.end());
  write_rows(set, options, out);
}

}  // namespace

GeometryFileInfo ply_info(std::string_view head, std::uint64_t file_bytes) {
  const PlyHeader header = checked_header(head, file_bytes);
  return info_of(header, file_bytes);
}

std::optional<BinaryRecords> ply_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block) {
  const PlyHeader header = checked_header(head, file_bytes);
  if (header.encoding != FileEncoding::binary) return std::nullopt;
  std::uint64_t begin = header.data_begin;
  for (const PlyElement& element : header.elements) {
    if (element.has_lists()) break;
    if (element.name == "vertex")
      return BinaryRecords{begin, element.record_bytes(), element.count,
                           columns_at(element, is_swapped(header), block),
                           header.viewpoint.value_or(Pose::Identity())};
    begin += element.count * element.record_bytes();
  }
  return std::nullopt;
}

GeometryColumns decode_ply(const std::shared_ptr<const std::string>& bytes) {
  const PlyHeader header = read_ply_header(*bytes);
  require_vertices(header);
  GeometryColumns content;
  content.info = info_of(header, bytes->size());
  content.viewpoint = header.viewpoint;
  Cursor cursor{bytes, header.data_begin,
                LineReader(std::string_view(*bytes).substr(header.data_begin), header.data_line)};
  for (const PlyElement& element : header.elements) {
    ColumnSet set = read_element(element, header, cursor, content);
    if (element.name == "vertex")
      content.vertices = std::move(set);
    else if (element.name == "face")
      content.faces = std::move(set);
  }
  return content;
}

void encode_ply(const GeometryContent& content, const GeometryWriteOptions& options,
                std::ostream& out) {
  if (content.triangles != nullptr &&
      content.vertices->rows > std::numeric_limits<std::int32_t>::max())
    throw Error("too many for a PLY mesh",
                {.field = "vertices", .value = std::to_string(content.vertices->rows)});
  write_header(content, options, out);
  write_rows(*content.vertices, options, out);
  if (content.triangles != nullptr) write_faces(content, options, out);
}

}  // namespace libmap
