#include "libmap/cloud/ply_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "libmap/cloud/text_rows.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

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
  if (words.size() != 3 || words[2] != "1.0") throw bad_line(line, "not 'format ENCODING 1.0'");
  header.big_endian = words[1] == "binary_big_endian";
  if (words[1] == "ascii") return FileEncoding::ascii;
  if (header.big_endian || words[1] == "binary_little_endian") return FileEncoding::binary;
  throw bad_line(line, "unknown encoding", words[1]);
}

PlyElement element_of(const Words& words, std::size_t line) {
  const std::optional<std::int64_t> count =
      words.size() == 3 ? parse_integer(words[2]) : std::nullopt;
  if (!count || *count < 0) throw bad_line(line, "not 'element NAME COUNT'");
  return {std::string(words[1]), static_cast<std::uint64_t>(*count), {}};
}

PlyProperty property_of(const Words& words, std::size_t line) {
  if (words.size() == 3)
    return {std::string(words[2]), type_of(words[1], line), false, StoredType::uint8};
  if (words.size() != 5 || words[1] != "list")
    throw bad_line(line, "not 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
  const StoredType count_type = type_of(words[2], line);
  if (count_type == StoredType::float32 || count_type == StoredType::float64)
    throw bad_line(line, "a list's length is an integer", words[2]);
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
  const Eigen::Quaterniond rotation(numbers[3], numbers[4], numbers[5], numbers[6]);
  if (!(rotation.norm() > 0.0)) return std::nullopt;
  return make_pose({numbers[0], numbers[1], numbers[2]}, rotation);
}

void add_element(PlyElement element, std::size_t line, PlyHeader& header) {
  if (header.find(element.name) != nullptr)
    throw bad_line(line, "this element is a duplicate", element.name);
  constexpr std::size_t max_elements = 1000;
  if (header.elements.size() == max_elements) throw bad_line(line, "more than 1000 elements");
  header.elements.push_back(std::move(element));
}

void add_property(PlyProperty property, std::size_t line, PlyHeader& header) {
  if (header.elements.empty()) throw bad_line(line, "a property before the first element");
  for (const PlyProperty& other : header.elements.back().properties)
    if (other.name == property.name)
      throw bad_line(line, "this property is a duplicate", property.name);
  constexpr std::size_t max_properties = 10'000;
  if (header.elements.back().properties.size() == max_properties)
    throw bad_line(line, "more than 10000 properties");
  header.elements.back().properties.push_back(std::move(property));
}

}  // namespace

bool PlyElement::has_lists() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& property) { return property.is_list; });
}

std::size_t PlyElement::record_bytes() const {
  std::size_t bytes = 0;
  for (const PlyProperty& property : properties)
    bytes += size_of(property.is_list ? property.count_type : property.type);
  return bytes;
}

const PlyElement* PlyHeader::find(std::string_view name) const {
  for (const PlyElement& element : elements)
    if (element.name == name) return &element;
  return nullptr;
}

PlyHeader read_ply_header(std::string_view text) {
  if (text.empty()) throw Error("is empty");
  PlyHeader header;
  bool has_format = false;
  std::size_t position = 0;
  Words words;
  for (std::size_t line = 1;; ++line) {
    const std::size_t end = text.find('\n', position);
    if (line == 1 && trim(text.substr(0, std::min<std::size_t>(end, 5))) != "ply")
      throw Error("not a PLY file");
    if (end == std::string_view::npos) throw Error("the PLY header has no line end_header");
    const std::string_view content = text.substr(position, end - position);
    position = end + 1;
    TextRows(content, 0, line).next(words);
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
      if (!has_format) throw Error("the PLY header has no line format");
      header.data_begin = position;
      header.data_line = line + 1;
      return header;
    } else {
      throw bad_line(line, "unknown word", words[0]);
    }
  }
}

std::string ply_type_name(ScalarType type) { return type_names[static_cast<std::size_t>(type)]; }

}  // namespace libmap
