#include "libmap/cloud/vtp_checks.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libmap/cloud/columns.h"
#include "libmap/cloud/text_rows.h"
#include "libmap/cloud/vtp_blocks.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

struct XmlTag {
  std::string_view name;
  std::vector<std::pair<std::string_view, std::string_view>> attributes;

  std::string_view attribute(std::string_view key) const {
    for (const auto& [name_of_attribute, value] : attributes)
      if (name_of_attribute == key) return value;
    return {};
  }
};

// The next tag from `at` on, which moves behind it; nothing at the end.
std::optional<XmlTag> next_tag(std::string_view xml, std::size_t& at) {
  at = xml.find('<', at);
  if (at == std::string_view::npos) return std::nullopt;
  std::size_t end = at;
  for (char quote = '\0'; end < xml.size() && (quote != '\0' || xml[end] != '>'); ++end) {
    if (quote == '\0' && (xml[end] == '"' || xml[end] == '\''))
      quote = xml[end];
    else if (xml[end] == quote)
      quote = '\0';
  }
  std::string_view rest = xml.substr(at + 1, end - at - 1);
  at = std::min(end + 1, xml.size());
  XmlTag tag{rest.substr(0, rest.find_first_of(" \t\r\n")), {}};
  rest.remove_prefix(tag.name.size());
  while (true) {
    const std::size_t equals = rest.find('=');
    if (equals == std::string_view::npos) return tag;
    const std::size_t open = rest.find_first_of("\"'", equals);
    if (open == std::string_view::npos) return tag;
    const std::size_t close = std::min(rest.find(rest[open], open + 1), rest.size());
    tag.attributes.emplace_back(trim(rest.substr(0, equals)),
                                rest.substr(open + 1, close - open - 1));
    rest.remove_prefix(std::min(close + 1, rest.size()));
  }
}

// A piece of the file for an error's single line.
std::string quotable(std::string_view text) {
  return std::string(text.substr(0, std::min<std::size_t>(text.find_first_of("\r\n"), 40)));
}

void require_sane(bool sane, const XmlTag& tag, std::string_view attribute) {
  if (sane) return;
  throw Error("nothing that this file can hold",
              {.file = {},
               .field = quotable(tag.name) + " " + quotable(attribute),
               .value = "'" + quotable(tag.attribute(attribute)) + "'",
               .bound = {}});
}

struct NumberType {
  std::string_view name;
  StoredType type;
};
constexpr std::array<NumberType, 10> number_types = {{{"Int8", StoredType::int8},
                                                      {"UInt8", StoredType::uint8},
                                                      {"Int16", StoredType::int16},
                                                      {"UInt16", StoredType::uint16},
                                                      {"Int32", StoredType::int32},
                                                      {"UInt32", StoredType::uint32},
                                                      {"Int64", StoredType::int64},
                                                      {"UInt64", StoredType::uint64},
                                                      {"Float32", StoredType::float32},
                                                      {"Float64", StoredType::float64}}};

StoredType type_of(const XmlTag& array) {
  const auto type = std::find_if(
      number_types.begin(), number_types.end(),
      [&array](const NumberType& known) { return known.name == array.attribute("type"); });
  require_sane(type != number_types.end(), array, "type");
  return type->type;
}

// The promises of a tag's attributes.
void require_sane_tag(const XmlTag& tag, double max_count) {
  constexpr double max_components = 4096.0;
  for (const auto& [name, value] : tag.attributes) {
    if (!name.starts_with("NumberOf")) continue;
    const std::optional<std::int64_t> count = parse_integer(value);
    const double limit = name == "NumberOfComponents" ? max_components : max_count;
    require_sane(count && *count >= 0 && static_cast<double>(*count) <= limit, tag, name);
  }
  if (tag.name == "VTKFile") require_sane(tag.attribute("type") == "PolyData", tag, "type");
  if (tag.name != "DataArray" && tag.name != "Array") return;
  const std::string_view format = tag.attribute("format");
  require_sane(format == "ascii" || format == "binary" || format == "appended", tag, "format");
}

BlockLayout layout_of(const XmlTag& tag) {
  BlockLayout layout;
  const std::string_view header_type = tag.attribute("header_type");
  const std::string_view order = tag.attribute("byte_order");
  require_sane(header_type.empty() || header_type == "UInt32" || header_type == "UInt64", tag,
               "header_type");
  require_sane(order == "LittleEndian" || order == "BigEndian", tag, "byte_order");
  layout.word_bytes = header_type == "UInt64" ? 8 : 4;
  layout.big_endian = order == "BigEndian";
  layout.compressor = tag.attribute("compressor");
  return layout;
}

// The appended data behind their underscore; empty if there are none.
std::string_view appended_data(std::string_view bytes, bool& base64) {
  const std::size_t open = bytes.find("<AppendedData");
  const std::size_t close = open == std::string_view::npos ? open : bytes.find('>', open);
  if (close == std::string_view::npos) return {};
  std::size_t at = open;
  const std::string_view encoding = next_tag(bytes, at)->attribute("encoding");
  if (encoding != "raw" && encoding != "base64")
    throw Error("the appended data have no known encoding");
  base64 = encoding == "base64";
  const std::size_t begin = bytes.find_first_not_of(" \t\r\n", close + 1);
  if (begin == std::string_view::npos || bytes[begin] != '_')
    throw Error("the appended data do not begin with '_'");
  return bytes.substr(begin + 1);
}

// The XML part's arrays, one after another, with what their place says of them.
class ArrayChecks {
 public:
  ArrayChecks(std::string_view bytes, std::string_view xml)
      : xml_(xml), free_bytes_(free_memory_bytes + memory_of_file * bytes.size()) {
    appended_.data = appended_data(bytes, appended_.base64);
  }

  void enter(const XmlTag& tag) {
    constexpr std::array<std::string_view, 8> parts = {
        "FieldData", "PointData", "CellData", "Points", "Verts", "Lines", "Strips", "Polys"};
    if (tag.name == "VTKFile") layout_ = layout_of(tag);
    if (tag.name == "Piece") {
      piece_ = tag;
      points_ += points_of_piece();
      cells_ += cells_of_piece();
    }
    if (tag.name == "Piece" || std::find(parts.begin(), parts.end(), tag.name) != parts.end()) {
      require_sane_cells();
      part_ = tag.name;
      names_.clear();
    }
  }

  std::uint64_t points() const { return points_; }  // of all pieces so far

  // `behind` is where the array's tag ends.
  void check(const XmlTag& array, std::size_t behind) {
    add_name(array);
    if (array.name == "Array" && array.attribute("type") == "String")
      return require_texts(array, behind);
    const StoredType type = type_of(array);
    const std::uint64_t number_bytes = size_of(type);
    const bool is_cells =
        part_ == "Verts" || part_ == "Lines" || part_ == "Strips" || part_ == "Polys";
    const bool is_offsets = is_cells && array.attribute("Name") == "offsets";
    const bool is_corners = is_cells && array.attribute("Name") == "connectivity";
    // VTK's cells are numbers of 8 bytes.
    const std::uint64_t memory_bytes = is_cells ? 8 : number_bytes;
    take_memory(promised_numbers(array, is_offsets), memory_bytes);
    if (array.attribute("format") == "ascii") {
      if (!is_offsets && !is_corners) return;
      const std::vector<double> numbers = numbers_of_text(text_behind(behind));
      if (is_offsets) last_offset_ = last_of(numbers);
      if (is_corners) corners_ = numbers.size();
      return;
    }
    const bool is_inline = array.attribute("format") == "binary";
    const BlockPlace place =
        is_inline ? BlockPlace{text_behind(behind), true} : appended_place(array);
    if (is_inline && place.data.empty() && is_empty(array)) return;
    const std::uint64_t length = block_length(place, layout_, number_bytes);
    if (length == 0 && !is_empty(array)) throw Error("an array holds no data");
    take_memory(length / number_bytes, memory_bytes);
    if (is_corners) corners_ = length / number_bytes;
    if (is_offsets) last_offset_ = last_of(numbers_of_block(place, type));
  }

  // VTK leaves the rest of an array as the memory was.
  void require_whole_arrays() const {
    for (const auto& [place, rows] : rows_) {
      const std::uint64_t all = place.first == "PointData" ? points_ : cells_;
      if (rows != all)
        throw Error("an array is not in every piece",
                    {.file = {},
                     .field = "rows of array '" + quotable(place.second) + "'",
                     .value = std::to_string(rows),
                     .bound = std::to_string(all)});
    }
  }

  // VTK takes memory for as many corners as the last offset says.
  void require_sane_cells() {
    if (last_offset_ > corners_)
      throw Error("the offsets of cells claim more corners than the file holds");
    last_offset_ = corners_ = 0;
  }

 private:
  // Few bytes can stand for many, and many arrays for the same.
  void take_memory(std::uint64_t numbers, std::uint64_t number_bytes) {
    if (numbers > free_bytes_ / number_bytes)
      throw Error("the arrays take more memory than those of a file of this size do");
    free_bytes_ -= numbers * number_bytes;
  }
  // For what VTK takes memory before it reads an array.
  std::uint64_t promised_numbers(const XmlTag& array, bool is_offsets) const {
    const std::uint64_t parts = std::max<std::uint64_t>(1, count_of(array, "NumberOfComponents"));
    if (part_ == "Points") return points_of_piece() * parts;
    if (part_ == "PointData" || part_ == "CellData") return rows_of_part() * parts;
    if (part_ == "FieldData") return count_of(array, "NumberOfTuples") * parts;
    return is_offsets ? count_of(piece_, "NumberOf" + std::string(part_)) : 0;
  }
  static std::uint64_t count_of(const XmlTag& tag, std::string_view count) {
    return static_cast<std::uint64_t>(
        std::max<std::int64_t>(0, parse_integer(tag.attribute(count)).value_or(0)));
  }
  std::uint64_t points_of_piece() const { return count_of(piece_, "NumberOfPoints"); }
  std::uint64_t cells_of_piece() const {
    return count_of(piece_, "NumberOfVerts") + count_of(piece_, "NumberOfLines") +
           count_of(piece_, "NumberOfStrips") + count_of(piece_, "NumberOfPolys");
  }
  std::uint64_t rows_of_part() const {
    return part_ == "PointData" ? points_of_piece() : cells_of_piece();
  }
  // VTK finds arrays by their names, and takes the first of a name for the second.
  void add_name(const XmlTag& array) {
    if (part_ == "FieldData") return;
    const std::string_view name = array.attribute("Name");
    if (!names_.insert(name).second)
      throw Error(
          "two arrays of one name",
          {.file = {}, .field = "array '" + quotable(name) + "'", .value = {}, .bound = {}});
    if (part_ == "PointData" || part_ == "CellData") rows_[{part_, name}] += rows_of_part();
  }
  bool is_zero(std::string_view count) const { return count_of(piece_, count) == 0; }
  bool is_empty(const XmlTag& array) const {
    if (part_ == "FieldData") return array.attribute("NumberOfTuples") == "0";
    if (part_ == "Points" || part_ == "PointData") return is_zero("NumberOfPoints");
    if (part_ == "CellData") return cells_of_piece() == 0;
    return is_zero("NumberOf" + std::string(part_));
  }
  // VTK reads on behind the last byte until it has found as many texts as there are to be.
  void require_texts(const XmlTag& array, std::size_t behind) {
    const bool is_data = part_ == "PointData" || part_ == "CellData";
    require_sane(is_data || part_ == "FieldData", array, "type");
    const std::uint64_t rows = is_data ? rows_of_part() : count_of(array, "NumberOfTuples");
    const std::uint64_t texts =
        rows * std::max<std::uint64_t>(1, count_of(array, "NumberOfComponents"));
    if (texts == 0) return;
    const std::string bytes = bytes_of_texts(array, behind);
    const auto found = static_cast<std::uint64_t>(std::count(bytes.begin(), bytes.end(), '\0'));
    if (found != texts || bytes.back() != '\0')
      throw Error("an array of texts holds another number of them than its data",
                  {.file = {},
                   .field = "array '" + quotable(array.attribute("Name")) + "'",
                   .value = std::to_string(found),
                   .bound = std::to_string(texts)});
  }
  // Each text ends with a zero.
  std::string bytes_of_texts(const XmlTag& array, std::size_t behind) {
    if (array.attribute("format") != "ascii") {
      const BlockPlace place = array.attribute("format") == "binary"
                                   ? BlockPlace{text_behind(behind), true}
                                   : appended_place(array);
      take_memory(block_length(place, layout_, 1), 1);
      return unpack_block(place, layout_, 1);
    }
    std::string bytes;
    std::vector<std::string_view> words;
    TextRows rows(text_behind(behind), 0, 1);
    while (rows.next(words))
      for (const std::string_view word : words) {
        const std::optional<std::int64_t> byte = parse_integer(word);
        if (!byte || *byte < 0 || *byte > 255)
          throw Error("an array of texts holds something that is no byte");
        bytes += static_cast<char>(*byte);
      }
    return bytes;
  }
  std::string_view text_behind(std::size_t behind) const {
    const std::string_view text = xml_.substr(std::min(behind, xml_.size()));
    return trim(text.substr(0, text.find('<')));
  }
  BlockPlace appended_place(const XmlTag& array) const {
    const std::optional<std::int64_t> offset = parse_integer(array.attribute("offset"));
    require_sane(
        offset && *offset >= 0 && static_cast<std::uint64_t>(*offset) < appended_.data.size(),
        array, "offset");
    return {appended_.data.substr(static_cast<std::size_t>(*offset)), appended_.base64};
  }
  static std::vector<double> numbers_of_text(std::string_view text) {
    std::vector<double> numbers;
    std::vector<std::string_view> words;
    TextRows rows(text, 0, 1);
    while (rows.next(words))
      for (const std::string_view word : words) {
        const std::optional<double> number = parse_double(word);
        if (!number) throw Error("an array of cells holds something that is no number");
        numbers.push_back(*number);
      }
    return numbers;
  }
  std::vector<double> numbers_of_block(const BlockPlace& place, StoredType type) const {
    const std::string bytes = unpack_block(place, layout_, size_of(type));
    std::vector<double> numbers(bytes.size() / size_of(type));
    const bool swapped = layout_.big_endian == (std::endian::native == std::endian::little);
    for_each_value({{},
                    scalar_type_of(type),
                    type,
                    reinterpret_cast<const std::byte*>(bytes.data()),
                    size_of(type),
                    swapped},
                   numbers.size(), [&](std::size_t i, double value) { numbers[i] = value; });
    return numbers;
  }
  // The last of numbers that never fall.
  static std::uint64_t last_of(const std::vector<double>& offsets) {
    double last = 0.0;
    for (const double offset : offsets) {
      if (!(offset >= last && offset <= 1e18)) throw Error("the offsets of cells are broken");
      last = offset;
    }
    return static_cast<std::uint64_t>(last);
  }

  // What all arrays of a file may take as it is read and as VTK keeps them: 256 MB, and 64 times
  // its own bytes.
  static constexpr std::uint64_t free_memory_bytes = std::uint64_t{1} << 28;
  static constexpr std::uint64_t memory_of_file = 64;

  std::string_view xml_;
  std::uint64_t free_bytes_;
  BlockPlace appended_;
  BlockLayout layout_;
  XmlTag piece_;
  std::string_view part_;
  std::set<std::string_view> names_;                                             // in this part
  std::map<std::pair<std::string_view, std::string_view>, std::uint64_t> rows_;  // part, array
  std::uint64_t points_ = 0;
  std::uint64_t cells_ = 0;
  std::uint64_t corners_ = 0;
  std::uint64_t last_offset_ = 0;
};

}  // namespace

std::uint64_t require_sane_vtp(std::string_view bytes) {
  if (bytes.empty()) throw Error("is empty");
  const std::string_view xml = bytes.substr(0, bytes.find("<AppendedData"));
  if (xml.find("<VTKFile") == std::string_view::npos) throw Error("not a VTK XML file");
  // Nobody writes them, and they could hide tags from this scan.
  for (const char* const mark : {"<!", "&#"})
    if (xml.find(mark) != std::string_view::npos)
      throw Error("comments, entities and document types are not read in VTK XML files");
  // VTK takes memory for what the XML promises; zlib unpacks at most 1032 bytes of one.
  const double max_count = 1032.0 * static_cast<double>(bytes.size());
  ArrayChecks checks(bytes, xml);
  std::size_t at = 0;
  while (const std::optional<XmlTag> tag = next_tag(xml, at)) {
    require_sane_tag(*tag, max_count);
    checks.enter(*tag);
    if (tag->name == "DataArray" || tag->name == "Array") checks.check(*tag, at);
  }
  checks.require_sane_cells();
  checks.require_whole_arrays();
  return checks.points();
}

}  // namespace libmap
