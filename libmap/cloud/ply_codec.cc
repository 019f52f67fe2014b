#include "libmap/cloud/ply_codec.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "libmap/cloud/ply_header.h"
#include "libmap/cloud/text_rows.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

// Where in the file the next element's rows begin.
struct Cursor {
  const std::shared_ptr<const std::string>& bytes;
  std::size_t position;
  TextRows rows;
};

std::string ends_early(const PlyElement& element, std::uint64_t row) {
  return "the header promises " + std::to_string(element.count) + " rows of '" +
         element.name.substr(0, 40) + "', but the data end in row " + std::to_string(row);
}

// Throws unless the element can stand in what is left of the file.
void require_room(const PlyElement& element, FileEncoding encoding, std::uint64_t bytes) {
  if (encoding == FileEncoding::ascii)
    return require_room_for_text(element.count, element.properties.size(), bytes,
                                 "rows of '" + element.name.substr(0, 40) + "'");
  const std::uint64_t record = element.record_bytes();
  if (record > 0 && element.count > bytes / record)
    throw Error("the header promises " + std::to_string(element.count) + " rows of '" +
                element.name.substr(0, 40) + "' of " + std::to_string(record) +
                " bytes, but only " + std::to_string(bytes) + " bytes of data follow (" +
                std::to_string(bytes / record) + " rows)");
}

bool is_index_list(const PlyElement& element, const PlyProperty& property) {
  return element.name == "face" && property.is_list &&
         (property.name == "vertex_indices" || property.name == "vertex_index");
}

// One row at a time, whatever the encoding: first the number, or the list's length and numbers.
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
    if (!cursor_.rows.next(words_)) throw Error(ends_early(element_, row));
  }
  double number(const PlyProperty& property, StoredType type) {
    return ascii_ ? text_number(property, type) : binary_number(type);
  }
  // A list's length, known to fit into what is left.
  std::uint64_t length(const PlyProperty& property) {
    const double length = number(property, property.count_type);
    const std::uint64_t left =
        ascii_ ? words_.size() - word_
               : (cursor_.bytes->size() - cursor_.position) / size_of(property.type);
    if (!(length >= 0.0) || length > static_cast<double>(left))
      throw Error("row " + std::to_string(row_) + " of '" + element_.name.substr(0, 40) +
                      "' has a list longer than the data",
                  {.field = property.name, .value = to_text(length)});
    return static_cast<std::uint64_t>(length);
  }
  void end_row() {
    if (ascii_ && word_ != words_.size())
      throw Error("line " + std::to_string(cursor_.rows.line()) +
                  " contains more than one row of '" + element_.name.substr(0, 40) + "'");
  }

 private:
  double text_number(const PlyProperty& property, StoredType type) {
    if (word_ >= words_.size())
      throw Error("line " + std::to_string(cursor_.rows.line()) + " ends before the number",
                  {.field = property.name});
    return cursor_.rows.number(words_[word_++], property.name, scalar_type_of(type));
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
  std::vector<std::string_view> words_;
  std::size_t word_ = 0;
  std::uint64_t row_ = 0;
};

// Columns on the rows, from `at` on, of a binary element without lists.
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

// A binary element without lists needs no copy.
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
    throw Error("too few corners",
                {.field = name, .value = std::to_string(corners.size()), .bound = ">= 3"});
  for (const double corner : corners)
    if (!(corner >= 0.0) || corner >= static_cast<double>(vertices) ||
        corner > std::numeric_limits<std::uint32_t>::max())
      throw Error("a corner is no vertex", {.field = name,
                                            .value = to_text(corner),
                                            .bound = "0 to " + std::to_string(vertices) + " - 1"});
  for (std::size_t i = 2; i < corners.size(); ++i) {
    content.triangles.push_back({static_cast<std::uint32_t>(corners[0]),
                                 static_cast<std::uint32_t>(corners[i - 1]),
                                 static_cast<std::uint32_t>(corners[i])});
    content.face_of_triangle.push_back(static_cast<std::uint32_t>(face));
  }
}

// Rows with lists, or of text.
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
               ascii ? cursor.rows.remaining() : cursor.bytes->size() - cursor.position);
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

// Throws unless all elements can stand in a file of that size.
void require_rooms(const PlyHeader& header, std::uint64_t file_bytes) {
  std::uint64_t left = file_bytes - header.data_begin;
  for (const PlyElement& element : header.elements) {
    require_room(element, header.encoding, left);
    if (header.encoding == FileEncoding::binary) left -= element.count * element.record_bytes();
  }
}

void require_vertices(const PlyHeader& header) {
  if (header.find("vertex") == nullptr) throw Error("the PLY header has no element vertex");
}

void write_property_lines(const ColumnSet& set, std::ostream& out) {
  for (const Column& column : set.columns) {
    if (column.name.find_first_of(" \t\r\n\v\f") != std::string::npos)
      throw Error("this name cannot be used in a PLY header",
                  {.field = "field '" + column.name + "'"});
    out << "property " << ply_type_name(column.type) << ' ' << column.name << '\n';
  }
}

void write_header(const PlyContent& content, const PlyEncoding& encoding, std::ostream& out) {
  out << "ply\nformat "
      << (encoding.ascii        ? "ascii"
          : encoding.big_endian ? "binary_big_endian"
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

void write_rows(const ColumnSet& set, const PlyEncoding& encoding, std::ostream& out) {
  const bool swap_bytes = encoding.big_endian == (std::endian::native == std::endian::little);
  libmap::write_rows(set.rows, out, [&](std::size_t begin, std::size_t end, std::string& text) {
    if (encoding.ascii)
      append_rows_of_text(set.columns, begin, end, ' ', text);
    else
      append_records(set.columns, begin, end, swap_bytes, text);
  });
}

// A list of three is written as four numbers: its length, and the corners.
void write_faces(const PlyContent& content, const PlyEncoding& encoding, std::ostream& out) {
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
  write_rows(set, encoding, out);
}

}  // namespace

GeometryFileInfo ply_info(std::string_view head, std::uint64_t file_bytes) {
  const PlyHeader header = read_ply_header(head);
  require_vertices(header);
  require_rooms(header, file_bytes);
  return info_of(header, file_bytes);
}

std::optional<BinaryRecords> ply_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block) {
  const PlyHeader header = read_ply_header(head);
  require_vertices(header);
  require_rooms(header, file_bytes);
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
  Cursor cursor{bytes, header.data_begin, TextRows(*bytes, header.data_begin, header.data_line)};
  for (const PlyElement& element : header.elements) {
    ColumnSet set = read_element(element, header, cursor, content);
    if (element.name == "vertex")
      content.vertices = std::move(set);
    else if (element.name == "face")
      content.faces = std::move(set);
  }
  return content;
}

void encode_ply(const PlyContent& content, const PlyEncoding& encoding, std::ostream& out) {
  if (content.triangles != nullptr &&
      content.vertices->rows > std::numeric_limits<std::int32_t>::max())
    throw Error("too many vertices for a PLY mesh",
                {.field = "vertices", .value = std::to_string(content.vertices->rows)});
  write_header(content, encoding, out);
  write_rows(*content.vertices, encoding, out);
  if (content.triangles != nullptr) write_faces(content, encoding, out);
}

}  // namespace libmap
