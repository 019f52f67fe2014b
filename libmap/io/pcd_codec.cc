#include "libmap/io/pcd_codec.h"

#include <pcl/io/lzf.h>

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
#include "libmap/io/cloud_columns.h"

namespace libmap {
namespace {

struct PcdField {
  std::string name;
  StoredType type = StoredType::float32;
  std::size_t count = 1;
  std::size_t size() const { return size_of(type) * count; }
  bool is_padding() const { return name == "_"; }
  bool is_packed_color() const {
    return (name == "rgb" || name == "rgba") && size_of(type) == 4 && count == 1;
  }
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t points = 0;
  FileEncoding encoding = FileEncoding::ascii;
  Pose viewpoint = Pose::Identity();
  std::size_t data_begin = 0;
  std::size_t data_line = 1;
};

using HeaderLines = std::map<std::string, std::vector<std::string>, std::less<>>;

Error bad_header(const std::string& reason, const std::string& key, const std::string& text = {},
                 const std::string& bound = {}) {
  return Error(reason,
               {.field = "header line " + key, .value = text.substr(0, 80), .bound = bound});
}

std::uint64_t header_count(const std::string& key, const std::string& word, std::uint64_t min) {
  const std::optional<std::int64_t> value = parse_integer(word);
  if (!value || *value < 0 || static_cast<std::uint64_t>(*value) < min)
    throw bad_header("not a count", key, word, ">= " + std::to_string(min));
  return static_cast<std::uint64_t>(*value);
}

// Maximum size of a header, which limits the search for line breaks in other files.
constexpr std::size_t max_header_bytes = 1U << 20U;

// Returns the lines up to DATA by key, and sets the beginning of the data in `header`.
HeaderLines read_lines(std::string_view file, PcdHeader& header) {
  const std::string_view text = file.substr(0, max_header_bytes);
  constexpr std::array<std::string_view, 10> known = {"VERSION",   "FIELDS", "COLUMNS", "SIZE",
                                                      "TYPE",      "COUNT",  "WIDTH",   "HEIGHT",
                                                      "VIEWPOINT", "POINTS"};
  HeaderLines lines;
  std::size_t position = 0;
  while (position < text.size()) {
    const std::size_t end = text.find('\n', position);
    if (end == std::string_view::npos) break;
    const std::string_view line = trim(text.substr(position, end - position));
    position = end + 1;
    ++header.data_line;
    if (line.empty() || line.front() == '#') continue;
    const std::vector<std::string_view> words = words_of(line);
    if (words.empty()) continue;
    std::string key(words.front());
    const bool is_data = key == "DATA";
    if (!is_data && std::find(known.begin(), known.end(), key) == known.end())
      throw Error(lines.empty() ? "not a PCD file" : "unknown line in the PCD header",
                  {.field = "line " + std::to_string(header.data_line - 1)});
    if (key == "COLUMNS") key = "FIELDS";
    if (!lines.try_emplace(key, words.begin() + 1, words.end()).second)
      throw bad_header("occurs twice", key);
    if (is_data) {
      header.data_begin = position;
      return lines;
    }
  }
  throw Error("missing", {.field = text.empty() ? "PCD header" : "DATA line of the PCD header"});
}

const std::string& single_word(const HeaderLines& lines, const std::string& key) {
  const std::vector<std::string>& words = lines.at(key);
  if (words.size() != 1)
    throw bad_header("contains " + std::to_string(words.size()) + " words", key, {}, "one");
  return words.front();
}

// Returns the words of a line with one word per field, or `standard` for each if it is missing.
std::vector<std::string> field_words(const HeaderLines& lines, const std::string& key,
                                     std::size_t fields, const std::string& standard) {
  const auto found = lines.find(key);
  if (found == lines.end()) return std::vector<std::string>(fields, standard);
  if (found->second.size() != fields)
    throw bad_header("does not match the line FIELDS", key,
                     std::to_string(found->second.size()) + " words long",
                     std::to_string(fields) + ", one per field");
  return found->second;
}

StoredType stored_type(const std::string& type, const std::string& size, const std::string& name) {
  static const std::map<std::string, StoredType> types = {
      {"I1", StoredType::int8},    {"U1", StoredType::uint8},   {"I2", StoredType::int16},
      {"U2", StoredType::uint16},  {"I4", StoredType::int32},   {"U4", StoredType::uint32},
      {"F4", StoredType::float32}, {"F8", StoredType::float64}, {"I8", StoredType::int64},
      {"U8", StoredType::uint64}};
  const auto found = types.find(type + size);
  if (found == types.end())
    throw Error("unknown number type",
                {.field = "TYPE and SIZE of field '" + name.substr(0, 40) + "'",
                 .value = (type + " " + size).substr(0, 80),
                 .bound = "I or U with 1, 2, 4 or 8, or F with 4 or 8"});
  return found->second;
}

std::vector<PcdField> read_fields(const HeaderLines& lines) {
  const auto names = lines.find("FIELDS");
  if (names == lines.end()) throw bad_header("is missing", "FIELDS");
  const std::size_t count = names->second.size();
  if (count == 0) throw bad_header("contains no field", "FIELDS");
  const auto sizes = field_words(lines, "SIZE", count, "4");
  const auto types = field_words(lines, "TYPE", count, "F");
  const auto counts = field_words(lines, "COUNT", count, "1");
  constexpr std::uint64_t max_record_bytes = 1 << 20;
  constexpr std::size_t max_columns = 10'000;
  std::size_t columns = 0;
  std::vector<PcdField> fields;
  std::uint64_t record = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& name = names->second[i];
    fields.push_back(
        {name, stored_type(types[i], sizes[i], name), header_count("COUNT", counts[i], 1)});
    if (fields.back().count > max_record_bytes ||
        (record += fields.back().size()) > max_record_bytes)
      throw bad_header("a point is larger than 1 MiB", "COUNT", counts[i]);
    if ((columns += fields.back().is_padding() ? 1 : fields.back().count) > max_columns)
      throw bad_header("more than 10000 columns", "FIELDS");
  }
  return fields;
}

std::uint64_t read_points(const HeaderLines& lines) {
  const bool has_points = lines.contains("POINTS");
  if (!has_points && !lines.contains("WIDTH")) throw bad_header("is missing", "POINTS");
  const std::uint64_t width =
      lines.contains("WIDTH") ? header_count("WIDTH", single_word(lines, "WIDTH"), 0) : 0;
  const std::uint64_t height =
      lines.contains("HEIGHT") ? header_count("HEIGHT", single_word(lines, "HEIGHT"), 0) : 1;
  if (height > 0 && width > std::numeric_limits<std::int64_t>::max() / height)
    throw bad_header("WIDTH x HEIGHT is too large", "WIDTH", std::to_string(width));
  if (!has_points) return width * height;
  const std::uint64_t points = header_count("POINTS", single_word(lines, "POINTS"), 0);
  if (lines.contains("WIDTH") && points != width * height)
    throw bad_header("does not match WIDTH and HEIGHT", "POINTS", std::to_string(points),
                     "WIDTH x HEIGHT = " + std::to_string(width * height));
  return points;
}

Pose read_viewpoint(const HeaderLines& lines) {
  const auto found = lines.find("VIEWPOINT");
  if (found == lines.end()) return Pose::Identity();
  std::array<double, 7> numbers{};
  if (found->second.size() != numbers.size())
    throw bad_header("contains " + std::to_string(found->second.size()) + " numbers", "VIEWPOINT",
                     {}, "tx ty tz qw qx qy qz");
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::optional<double> number = parse_double(found->second[i]);
    if (!number || !std::isfinite(*number))
      throw bad_header("not a number", "VIEWPOINT", found->second[i]);
    numbers[i] = *number;
  }
  // Some programs write 0 0 0 0 0 0 0 for an unknown viewpoint.
  return pose_of_viewpoint(numbers).value_or(Pose::Identity());
}

PcdHeader read_header(std::string_view text) {
  PcdHeader header;
  const HeaderLines lines = read_lines(text, header);
  header.fields = read_fields(lines);
  header.points = read_points(lines);
  header.viewpoint = read_viewpoint(lines);
  const std::string& encoding = single_word(lines, "DATA");
  for (const FileEncoding known :
       {FileEncoding::ascii, FileEncoding::binary, FileEncoding::binary_compressed})
    if (to_text(known) == encoding) {
      header.encoding = known;
      return header;
    }
  throw bad_header("unknown encoding", "DATA", encoding, "ascii, binary or binary_compressed");
}

std::uint64_t record_bytes(const PcdHeader& header, bool with_padding) {
  std::uint64_t bytes = 0;
  for (const PcdField& field : header.fields)
    if (with_padding || !field.is_padding()) bytes += field.size();
  return bytes;
}

// Throws Error unless the file is large enough for its points.
void require_data(const PcdHeader& header, std::uint64_t file_bytes) {
  const std::uint64_t data = file_bytes - header.data_begin;
  const std::uint64_t record = record_bytes(header, true);
  if (header.encoding == FileEncoding::ascii) {
    std::uint64_t words = 0;
    for (const PcdField& field : header.fields) words += field.count;
    require_room_for_text(header.points, words, data, "points");
  } else if (header.encoding == FileEncoding::binary) {
    require_rows(header.points, record, data, "points");
  }
}

GeometryFileInfo info_of(const PcdHeader& header, std::uint64_t file_bytes) {
  GeometryFileInfo info;
  info.format = "pcd";
  info.encoding = header.encoding;
  info.bytes = file_bytes;
  info.points = header.points;
  for (const PcdField& field : header.fields) {
    if (field.is_padding())
      info.skipped.push_back("padding of " + std::to_string(field.size()) + " bytes");
    else
      info.fields.push_back({field.name, scalar_type_of(field.type), field.count});
  }
  return info;
}

// Adds the columns of `field`, whose row 0 begins at `first`.
void add_columns(const PcdField& field, const std::byte* first, std::size_t stride,
                 ColumnSet& set) {
  if (field.is_padding()) return;
  if (field.is_packed_color() && set.find("red") == nullptr) {
    return add_packed_color_columns(first, stride, false, set);
  }
  for (std::size_t i = 0; i < field.count; ++i)
    set.columns.push_back({field.count == 1 ? field.name : field.name + "_" + std::to_string(i),
                           scalar_type_of(field.type), field.type, first + i * size_of(field.type),
                           stride, false});
}

void add_binary(const PcdHeader& header, const std::byte* data, ColumnSet& set) {
  const std::size_t record = record_bytes(header, true);
  for (const PcdField& field : header.fields) {
    add_columns(field, data, record, set);
    data += field.size();
  }
}

std::uint32_t little_endian_u32(std::string_view bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

// Reads compressed data, which are stored field by field. The Point Cloud Library omits padding,
// other writers do not; the size distinguishes them.
void add_compressed(const PcdHeader& header, std::string_view data, ColumnSet& set) {
  if (data.size() < 8 && header.points == 0)
    return add_binary(header, reinterpret_cast<const std::byte*>(data.data()), set);
  if (data.size() < 8) throw Error("missing", {.field = "compressed size"});
  const std::uint64_t compressed = little_endian_u32(data);
  const std::uint64_t uncompressed = little_endian_u32(data.substr(4));
  if (compressed > data.size() - 8)
    throw Error("more than the file contains", {.field = "bytes of the compressed data",
                                                .value = std::to_string(compressed),
                                                .bound = "<= " + std::to_string(data.size() - 8)});
  const std::uint64_t record = record_bytes(header, true);
  const std::uint64_t record_unpadded = record_bytes(header, false);
  // No overflow: a record has at most a MiB, and a larger number of points is not equal anyway.
  const bool few = header.points <= std::numeric_limits<std::uint32_t>::max();
  const bool padded = few && uncompressed == header.points * record;
  if (!padded && !(few && uncompressed == header.points * record_unpadded))
    throw Error("differs from the size of the points",
                {.field = "bytes of the uncompressed data",
                 .value = std::to_string(uncompressed),
                 .bound = std::to_string(header.points) + " * " + std::to_string(record_unpadded)});
  // LZF expands 3 bytes to at most 264.
  if (uncompressed / 88 > compressed)
    throw Error("too few for " + std::to_string(uncompressed) + " bytes",
                {.field = "compressed data"});
  auto buffer = std::make_shared<std::string>(uncompressed, '\0');
  if (uncompressed > 0 &&
      (compressed == 0 ||
       pcl::lzfDecompress(data.data() + 8, static_cast<unsigned>(compressed), buffer->data(),
                          static_cast<unsigned>(uncompressed)) != uncompressed))
    throw Error("damaged", {.field = "compressed data"});
  const auto* at = reinterpret_cast<const std::byte*>(buffer->data());
  for (const PcdField& field : header.fields) {
    if (field.is_padding() && !padded) continue;
    add_columns(field, at, field.size(), set);
    at += field.size() * header.points;
  }
  set.storage.push_back(buffer);
}

// Converts text to binary records, so that packed colors keep the bits of a float of any value.
void add_text(const PcdHeader& header, std::string_view text, ColumnSet& set) {
  struct Target {
    const PcdField* field;
    double* values;
    std::uint32_t* packed;
  };
  std::vector<Target> targets;
  for (const PcdField& field : header.fields)
    for (std::size_t i = 0; i < field.count; ++i) {
      Target target{&field, nullptr, nullptr};
      if (field.is_packed_color() && set.find("red") == nullptr) {
        // One extra element, so that the address is valid without points too.
        auto packed = std::make_shared<std::vector<std::uint32_t>>(header.points + 1);
        target.packed = packed->data();
        set.storage.push_back(packed);
        add_columns(field, reinterpret_cast<const std::byte*>(packed->data()), 4, set);
      } else if (!field.is_padding()) {
        target.values =
            set.add_numbers(field.count == 1 ? field.name : field.name + "_" + std::to_string(i),
                            scalar_type_of(field.type));
      }
      targets.push_back(target);
    }
  LineReader lines(text.substr(header.data_begin), header.data_line);
  TextLine line;
  for (std::size_t row = 0; row < header.points; ++row) {
    if (!lines.next(line))
      throw Error("more than the lines of data", {.field = "number of points",
                                                  .value = std::to_string(header.points),
                                                  .bound = "<= " + std::to_string(row)});
    if (line.words.size() != targets.size())
      throw Error("wrong", {.field = "numbers of " + name_of(line),
                            .value = std::to_string(line.words.size()),
                            .bound = std::to_string(targets.size())});
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const Target& target = targets[i];
      if (target.values == nullptr && target.packed == nullptr) continue;
      const double value =
          number_of(line, i, target.field->name, scalar_type_of(target.field->type));
      if (target.values != nullptr)
        target.values[row] = value;
      else if (target.field->type == StoredType::float32)
        target.packed[row] =
            std::bit_cast<std::uint32_t>(static_cast<float>(as_type(value, ScalarType::float32)));
      else
        target.packed[row] = static_cast<std::uint32_t>(
            static_cast<std::int64_t>(as_type(value, scalar_type_of(target.field->type))));
    }
  }
}

void require_name(const Column& column) {
  const bool reserved = column.name == "_" || column.name == "rgb" || column.name == "rgba";
  if (reserved || column.name.find_first_of(" \t\r\n\v\f") != std::string::npos)
    throw Error("a PCD header cannot store white space and the names _, rgb, rgba; rename it",
                {.field = "field '" + column.name + "'"});
}

void write_compressed(const ColumnSet& set, std::ostream& out) {
  std::string data;
  const std::uint64_t size = static_cast<std::uint64_t>(record_size(set.columns)) * set.rows;
  // The size of LZF's output buffer, 1.5 times the data, is limited to 32 bits as well.
  if (size / 2 * 3 + 16 > std::numeric_limits<std::uint32_t>::max())
    throw Error("too large for binary_compressed PCD; write it as binary",
                {.field = "data", .value = std::to_string(size) + " bytes"});
  data.reserve(size);
  for (const Column& column : set.columns) append_records({column}, 0, set.rows, false, data);
  std::string compressed(size + size / 2 + 16, '\0');
  const unsigned length =
      size == 0 ? 0
                : pcl::lzfCompress(data.data(), static_cast<unsigned>(size), compressed.data(),
                                   static_cast<unsigned>(compressed.size()));
  if (size > 0 && length == 0) throw Error("cannot be compressed", {}, ErrorKind::failed);
  std::string sizes;
  for (const std::uint64_t number : {std::uint64_t{length}, size})
    for (unsigned shift = 0; shift < 32; shift += 8) sizes += static_cast<char>(number >> shift);
  out << sizes;
  out.write(compressed.data(), static_cast<std::streamsize>(length));
}

}  // namespace

GeometryFileInfo pcd_info(std::string_view head, std::uint64_t file_bytes) {
  const PcdHeader header = read_header(head);
  require_data(header, file_bytes);
  return info_of(header, file_bytes);
}

std::optional<BinaryRecords> pcd_records(std::string_view head, std::uint64_t file_bytes,
                                         const std::byte* block) {
  const PcdHeader header = read_header(head);
  require_data(header, file_bytes);
  if (header.encoding != FileEncoding::binary) return std::nullopt;
  ColumnSet set;
  add_binary(header, block, set);
  return BinaryRecords{header.data_begin, record_bytes(header, true), header.points,
                       std::move(set.columns), header.viewpoint};
}

GeometryColumns decode_pcd(std::string_view bytes, const std::shared_ptr<const void>& owner) {
  const PcdHeader header = read_header(bytes);
  require_data(header, bytes.size());
  GeometryColumns content;
  content.info = info_of(header, bytes.size());
  content.viewpoint = header.viewpoint;
  ColumnSet& set = content.vertices;
  set.rows = header.points;
  const auto* data = reinterpret_cast<const std::byte*>(bytes.data()) + header.data_begin;
  switch (header.encoding) {
    case FileEncoding::ascii:
      add_text(header, bytes, set);
      break;
    case FileEncoding::binary:
      add_binary(header, data, set);
      break;
    case FileEncoding::binary_compressed:
      add_compressed(header, bytes.substr(header.data_begin), set);
      break;
  }
  set.storage.push_back(owner);
  return content;
}

std::string pcd_header(const ColumnSet& columns, std::uint64_t points, const Pose& viewpoint,
                       FileEncoding encoding) {
  for (const Column& column : columns.columns) require_name(column);
  ColumnSet empty = columns;
  empty.rows = 0;
  std::string names, sizes, types, counts;
  for (const Column& column : with_packed_color(empty).columns) {
    const std::string type = to_text(column.type);
    names += " " + column.name;
    sizes += " " + std::to_string(size_of(stored_as(column.type)));
    types += type.front() == 'f' ? " F" : type.front() == 'u' ? " U" : " I";
    counts += " 1";
  }
  const std::string number = std::to_string(points);
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS" + names + "\nSIZE" +
         sizes + "\nTYPE" + types + "\nCOUNT" + counts + "\nWIDTH " + number +
         "\nHEIGHT 1\nVIEWPOINT" + viewpoint_words(viewpoint) + "\nPOINTS " + number + "\nDATA " +
         to_text(encoding) + "\n";
}

void encode_pcd_points(const ColumnSet& columns, FileEncoding encoding, std::ostream& out) {
  const ColumnSet set = with_packed_color(columns);
  if (encoding == FileEncoding::binary_compressed) return write_compressed(set, out);
  write_rows(set.rows, out, [&](std::size_t begin, std::size_t end, std::string& text) {
    if (encoding == FileEncoding::ascii)
      append_rows_of_text(set.columns, begin, end, ' ', text);
    else
      append_records(set.columns, begin, end, false, text);
  });
}

void encode_pcd(const ColumnSet& columns, const Pose& viewpoint, FileEncoding encoding,
                std::ostream& out) {
  out << pcd_header(columns, columns.rows, viewpoint, encoding);
  encode_pcd_points(columns, encoding, out);
}

}  // namespace libmap
